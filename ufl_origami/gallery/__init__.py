"""Ready-made crease patterns."""

from ufl_origami.gallery.z_fold import z_fold

__all__ = ["z_fold"]
