"""Compliant origami on FEniCSx: thin elastic sheets with creases."""

__version__ = "0.1.0"
