"""What a checkpoint must share with the scene that continues it."""

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass

from mpi4py import MPI

import numpy as np

from ufl_origami.partition import pair_keys
from ufl_origami.scene import Scene
from ufl_origami.sheet import SheetMesh


def mix(columns: np.ndarray) -> int:
    """Sum of a 64-bit hash of each row of integers (n, k), so that the order does not matter.

    The hash is the finaliser of SplitMix64 (Steele, Lea, Flood 2014, doi:10.1145/2660193.2660195).
    """
    rows = np.atleast_2d(columns).astype(np.uint64, copy=False)
    value: np.ndarray = np.zeros(len(rows), dtype=np.uint64)
    for column in rows.T:
        value += column + np.uint64(0x9E3779B97F4A7C15)
        value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        value ^= value >> np.uint64(31)
    return int(value.sum(dtype=np.uint64))


def edge_keys(sheet: SheetMesh, facets: np.ndarray) -> np.ndarray:
    """One integer per local facet from its ends' input vertices: the same on any ranks (n,)."""
    ends = sheet.input_vertex[sheet.edge_vertices()[facets]]
    return pair_keys(ends, sheet.num_vertices_global)


def sheet_digest(sheet: SheetMesh) -> str:
    """Hash of coordinates, triangles, panels and names, the same on any ranks; collective."""
    n, nc = sheet.num_owned_vertices, sheet.num_owned_cells
    vertices = np.column_stack([sheet.input_vertex[:n].astype(np.int64), bits(sheet.rest[:n])])
    corners = sheet.input_vertex[sheet.cells[:nc]]
    cells = np.column_stack([sheet.input_cell[:nc], corners, sheet.cell_panel[:nc]])
    local = [mix(vertices), mix(cells.astype(np.int64))]
    for name in sorted(sheet.edges):
        facets = sheet.edges[name]
        local.append(mix(edge_keys(sheet, facets[facets < sheet.num_owned_edges])[:, None]))
    total = np.array(local, dtype=np.uint64)
    sheet.comm.Allreduce(MPI.IN_PLACE, total, op=MPI.SUM)
    names = [sorted(sheet.edges), sheet.creases, sheet.panel_names, sorted(sheet.points)]
    return hashlib.sha256(total.tobytes() + repr(names).encode()).hexdigest()


def bits(values: np.ndarray) -> np.ndarray:
    """Floating point numbers as integers, -0.0 as 0.0."""
    return np.ascontiguousarray(values + 0.0).view(np.int64)


def declaration(scene: Scene) -> dict[str, str]:
    """What a scene declares, part by part, as text; of functions and objects only their kind."""
    return {
        part.name: text(getattr(scene, part.name)) for part in fields(scene) if part.name != "sheet"
    }


def text(value: object) -> str:
    """Text of numbers, names and containers with all digits."""
    if is_dataclass(value) and not isinstance(value, type):
        parts = (f"{f.name}={text(getattr(value, f.name))}" for f in fields(value))
        return f"{type(value).__name__}({', '.join(parts)})"
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{k}: {text(v)}' for k, v in sorted(value.items()))}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(text, value))}]"
    if isinstance(value, np.ndarray | np.generic):
        return text(value.tolist())
    if value is None or isinstance(value, bool | int | float | str):
        return repr(value)
    return "function" if callable(value) else type(value).__name__
