"""Random signals: spectra, realisations of them, and counts."""
