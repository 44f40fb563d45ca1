"""Human response to vibration as standards define it: weightings, metrics, exposure, spinal dose.

Pure numpy and scipy. None of the standards was at hand; every constant says where it is from.
"""
