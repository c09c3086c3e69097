"""Analytic of ufl_origami."""
