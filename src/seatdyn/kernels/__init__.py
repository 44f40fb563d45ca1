"""Compiled code on plain arrays and numbers; it knows no object of the model."""
