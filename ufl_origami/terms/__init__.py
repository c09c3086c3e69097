"""Terms of ufl_origami."""
