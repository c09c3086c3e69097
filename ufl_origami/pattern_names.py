"""Names of the parts of a crease pattern: panels, creases, boundaries, lines and points."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from types import MappingProxyType
from typing import NoReturn

import numpy as np
import numpy.typing as npt

from ufl_origami.errors import PatternError
from ufl_origami.pattern_arrays import read_only
from ufl_origami.pattern_topology import Ints

NameList = tuple[str | None, ...]


@dataclass(frozen=True)
class PatternNames:
    """Names of vertices, edges and faces, None where there is none; an empty tuple means none."""

    vertices: NameList = ()
    edges: NameList = ()
    faces: NameList = ()

    def filled(self, num_vertices: int, num_edges: int, num_faces: int) -> "PatternNames":
        """Return the names with one entry for each vertex, edge and face."""
        return PatternNames(
            _filled(self.vertices, num_vertices, "vertices"),
            _filled(self.edges, num_edges, "edges"),
            _filled(self.faces, num_faces, "faces"),
        )


def _filled(names: Sequence[str | None], number: int, what: str) -> NameList:
    if all(name is None for name in names):
        return (None,) * number
    if len(names) != number:
        raise PatternError(f"{len(names)} names are given for {number} {what}")
    for k, name in enumerate(names):
        if name is not None and (not isinstance(name, str) or not name.strip()):
            raise PatternError(f"entry {k} of the names of {what} is {name!r}: not a name")
    return tuple(names)


def unknown(kind: str, name: str, known: Sequence[str]) -> NoReturn:
    """Raise PatternError about a name that is none of the known ones, with the closest ones."""
    close = get_close_matches(name, known)
    hint = f"; did you mean {' or '.join(map(repr, close))}?" if close else ""
    raise PatternError(f"no {kind} has the name {name!r}{hint} (there are: {', '.join(known)})")


def name_panels(face_panel: Ints, names: NameList) -> Mapping[str, Ints]:
    """Faces of each panel by name; a panel without a name is `panel<number>`.

    Raises:
        PatternError: two names in one panel, or two panels of one name.
    """
    order = np.argsort(face_panel, kind="stable")
    ends = np.cumsum(np.bincount(face_panel))[:-1]
    named: dict[str, Ints] = {}
    for p, faces in enumerate(np.split(order, ends)):
        given = sorted({name for f in faces if (name := names[f]) is not None})
        if len(given) > 1:
            raise PatternError(
                f"faces {faces.tolist()} are one panel (joined through F or J edges), but have "
                f"the names {', '.join(map(repr, given))}"
            )
        name = given[0] if given else f"panel{p}"
        if name in named:
            raise PatternError(
                f"two panels have the name {name!r}: faces {named[name].tolist()} and "
                f"{faces.tolist()}"
            )
        named[name] = read_only(faces)
    return MappingProxyType(named)


def name_edges(
    names: NameList, selected: npt.NDArray[np.bool_], default: Callable[[int], str | None]
) -> Mapping[str, Ints]:
    """Selected edges by name, ascending; `default` names those without one (None: left out)."""
    given = {name: e for e, name in enumerate(names) if name is not None}
    sets: dict[str, list[int]] = {}
    for e in map(int, np.flatnonzero(selected)):
        name = names[e] or default(e)
        if names[e] is None and name is not None and name in given:
            raise PatternError(
                f"the name {name!r} of edge {given[name]} is the default name of edge {e}, "
                f"which has none: rename the former or name the latter"
            )
        if name is not None:
            sets.setdefault(name, []).append(e)
    return MappingProxyType({name: read_only(np.array(e)) for name, e in sets.items()})


def check_kinds(names: NameList, kinds: Sequence[str]) -> None:
    """Edges with one name must be of one kind (crease, boundary, line)."""
    seen: dict[str, int] = {}
    for e, name in enumerate(names):
        if name is not None:
            first = seen.setdefault(name, e)
            if kinds[first] != kinds[e]:
                raise PatternError(
                    f"edges {first} and {e} have the same name {name!r}, but one is a "
                    f"{kinds[first]} and the other a {kinds[e]}"
                )


def name_points(names: NameList) -> Mapping[str, int]:
    """Vertex of each named point."""
    named: dict[str, int] = {}
    for v, name in enumerate(names):
        if name is not None:
            if name in named:
                raise PatternError(f"vertices {named[name]} and {v} have the same name {name!r}")
            named[name] = v
    return MappingProxyType(named)
