"""Small patterns that several test files use."""

import math

import numpy as np

from ufl_origami.pattern import CreasePattern

SQUARE = [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]
TWO = [(0, 1, 4, 3), (1, 2, 5, 4)]


def two_squares(**options):
    """Two unit squares in the plane that share the side x = 1."""
    return CreasePattern.from_arrays(SQUARE, TWO, **options)


def folded(theta, rng=None):
    """Two random quadrilaterals (one vertex between the ends of each outer side) at an angle."""
    widths = np.ones(4) if rng is None else rng.uniform(0.5, 2.0, 4)
    skew = np.zeros(4) if rng is None else rng.uniform(-0.4, 0.4, 4)
    c, s = math.cos(theta), math.sin(theta)
    left = [(-w, y, 0.0) for w, y in zip(widths[:2], (skew[0], 1 + skew[1]), strict=True)]
    right = [(w * c, y, w * s) for w, y in zip(widths[2:], (skew[2], 1 + skew[3]), strict=True)]
    points = np.array([(0, 0, 0), (0, 1, 0), *left, *right])
    return points, [(0, 1, 3, 2), (1, 0, 4, 5)]


def random_rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0 else -q


def t_junction():
    points = [(x, y, z) for x, z in ((0, 0), (1, 0), (-1, 0), (0, 1)) for y in (0, 1)]
    return CreasePattern.from_arrays(points, [(0, 2, 3, 1), (4, 0, 1, 5), (0, 1, 7, 6)])


def grid(n):
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    loops = corner[:, None] + np.array([0, n + 1, n + 2, 1])
    return np.stack([x.ravel(), y.ravel()], axis=1), loops.tolist()
