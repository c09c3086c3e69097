"""A crease pattern in words; `pattern` is a `CreasePattern` (which imports this module)."""

from collections import Counter
from typing import Any

import numpy as np


def title(pattern: Any) -> str:
    """One line: how many of what."""
    counts = Counter(pattern.edges_assignment)
    kinds = ", ".join(f"{number} {letter}" for letter, number in sorted(counts.items()))
    return (
        f"CreasePattern: {len(pattern.vertices_coords)} vertices, "
        f"{len(pattern.edges_vertices)} edges ({kinds}), {len(pattern.panels)} panels, "
        f"{'folded form' if pattern.is_folded else 'unfolded'}"
    )


def summary(pattern: Any) -> str:
    """One line for the pattern and one for each of its named parts."""
    lengths = pattern.edge_lengths
    lines = [title(pattern)]
    lines += [f"  panel {name}: faces {faces.tolist()}" for name, faces in pattern.panels.items()]
    for name, edges in pattern.creases.items():
        lines.append(f"  crease {name}: length {lengths[edges].sum():.6g}, {_turn(pattern, edges)}")
    for kind in ("boundaries", "lines"):
        for name, edges in getattr(pattern, kind).items():
            word = "boundary" if kind == "boundaries" else "line"
            lines.append(f"  {word} {name}: length {lengths[edges].sum():.6g}")
    for name, vertex in pattern.points.items():
        lines.append(f"  point {name}: {pattern.vertices_coords[vertex].tolist()}")
    return "\n".join(lines)


def _turn(pattern: Any, edges: Any) -> str:
    """Letters, geometric and given fold angles of a crease."""
    letters = "/".join(sorted({pattern.edges_assignment[e] for e in edges}))
    geometric = _range(np.degrees(pattern.geometric_angles[edges]))
    given = _range(pattern.edges_foldAngle[edges])
    return f"{letters}, geometric fold angle {geometric}, given {given}"


def _range(angles: Any) -> str:
    known = angles[~np.isnan(angles)]
    if not len(known):
        return "none"
    low, high = f"{known.min():.6g}", f"{known.max():.6g}"
    return f"{low} deg" if low == high else f"{low} to {high} deg"
