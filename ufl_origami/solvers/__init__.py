"""Solvers of ufl_origami."""
