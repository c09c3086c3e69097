"""Three-vectors as tuples of scalars: they live in registers, no array is allocated."""

from math import sqrt

from .jit import inlined


@inlined
def point(x, vertex):
    """Position of one vertex of x (nv, 3)."""
    return x[vertex, 0], x[vertex, 1], x[vertex, 2]


@inlined
def add(a, b):
    """Sum a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def sub(a, b):
    """Difference a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined
def scale(s, a):
    """Multiple s a."""
    return s * a[0], s * a[1], s * a[2]


@inlined
def combine(s, a, t, b):
    """Linear combination s a + t b."""
    return s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]


@inlined
def dot(a, b):
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@inlined
def norm(a):
    """Euclidean length."""
    return sqrt(dot(a, a))
