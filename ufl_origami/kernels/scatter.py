"""Sum element values into a vector."""

from .jit import kernel


@kernel
def add_at(values, dofs, out):
    """Add values[i, j] to out[dofs[i, j]].

    Args:
        values: (n, k) element values.
        dofs: (n, k) int32 indices into out.
        out: (nd,) vector, updated in place.
    """
    for i in range(dofs.shape[0]):
        for j in range(dofs.shape[1]):
            out[dofs[i, j]] += values[i, j]
