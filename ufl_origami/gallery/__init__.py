"""Gallery of ufl_origami."""
