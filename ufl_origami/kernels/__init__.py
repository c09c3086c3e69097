"""Kernels of ufl_origami."""
