"""Fields of a run for ParaView: displacement, panels and energies per triangle.

VTX files (ADIOS2) where dolfinx has them, else XDMF. The sheet is written at rest; "warp by vector"
with the displacement shows it deformed.

* VTX holds one element type a file: NAME.bp has the displacement (P1), NAME_cells.bp the fields of
  the triangles (as discontinuous P1, constant on each).
* XDMF: NAME.xdmf with NAME.h5 holds both; it is closed after every state, so that a run that is
  killed leaves a readable file.
"""

from pathlib import Path

import dolfinx
import numpy as np
from dolfinx import fem, io

from ufl_origami.errors import InputError
from ufl_origami.model import Model

FORMATS = ("auto", "vtx", "xdmf")


def field_format(wanted: str = "auto") -> str:
    """The format to write: "vtx" or "xdmf".

    Args:
        wanted: "auto" (VTX where dolfinx has ADIOS2), "vtx" or "xdmf".

    Raises:
        InputError: unknown format, or VTX without ADIOS2.
    """
    if wanted not in FORMATS:
        raise InputError(f"field format {wanted!r} is none of {FORMATS}")
    if wanted == "auto":
        return "vtx" if dolfinx.has_adios2 else "xdmf"
    if wanted == "vtx" and not dolfinx.has_adios2:
        raise InputError("field format 'vtx': this dolfinx has no ADIOS2")
    return wanted


def energy_densities(model: Model) -> dict[str, np.ndarray]:
    """Energies per rest area of this rank's owned triangles, by kind: (num_owned_cells,) each.

    The membrane's are left out where the scene computes them by a UFL form.
    """
    corners = model.sheet.rest[model.sheet.cells[: model.sheet.num_owned_cells]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 0.5 * np.linalg.norm(normal, axis=1)
    return {k: v / area for k, v in model.shell.element_energies(model.state).items()}


class FieldWriter:
    """Writes a model's current state to files, one time level a call.

    Args:
        model: the model.
        path: folder and name of the files, without suffix.
        format: see `field_format`.
    """

    def __init__(self, model: Model, path: str | Path, format: str = "auto"):
        self.model, mesh = model, model.sheet.mesh
        chosen = field_format(format)
        self.displacement = fem.Function(model.sheet.V, name="displacement")
        element = ("Discontinuous Lagrange", 1) if chosen == "vtx" else ("DG", 0)
        self._space = fem.functionspace(mesh, element)
        names = ["panel", *(f"energy_{kind}" for kind in energy_densities(model))]
        self.cells = {name: fem.Function(self._space, name=name) for name in names}
        self._set_cells("panel", model.sheet.cell_panel[: model.sheet.num_owned_cells])
        maker = _VtxFiles if chosen == "vtx" else _XdmfFile
        self._files = maker(Path(path), self.displacement, list(self.cells.values()))

    def _set_cells(self, name: str, values: np.ndarray) -> None:
        """Set a field of the triangles from the owned ones' values, ghosts included."""
        function = self.cells[name]
        dofs = self._space.dofmap.list[: len(values)]
        function.x.array[dofs] = np.asarray(values, dtype=float)[:, None]
        function.x.scatter_forward()

    def write(self) -> None:
        """Write the current state at the problem's time; collective."""
        self.displacement.x.array[:] = self.model.state.q[: 3 * self.model.configuration.nv]
        for kind, density in energy_densities(self.model).items():
            self._set_cells(f"energy_{kind}", density)
        self._files.write(self.model.problem.time)

    def close(self) -> None:
        """Close the files; collective."""
        self._files.close()


class _VtxFiles:
    """NAME.bp and NAME_cells.bp."""

    def __init__(self, path: Path, displacement: fem.Function, cells: list[fem.Function]):
        comm = displacement.function_space.mesh.comm
        cells_path = path.with_name(f"{path.name}_cells.bp")
        self._writers = [
            io.VTXWriter(comm, path.with_suffix(".bp"), displacement),
            io.VTXWriter(comm, cells_path, cells),
        ]

    def write(self, time: float) -> None:
        for writer in self._writers:
            writer.write(time)

    def close(self) -> None:
        for writer in self._writers:
            writer.close()


class _XdmfFile:
    """NAME.xdmf with NAME.h5, opened for each state anew."""

    def __init__(self, path: Path, displacement: fem.Function, cells: list[fem.Function]):
        self._path, self._functions = path.with_suffix(".xdmf"), [displacement, *cells]
        mesh = displacement.function_space.mesh
        self._comm = mesh.comm
        with io.XDMFFile(self._comm, self._path, "w") as file:
            file.write_mesh(mesh)

    def write(self, time: float) -> None:
        with io.XDMFFile(self._comm, self._path, "a") as file:
            for function in self._functions:
                file.write_function(function, time)

    def close(self) -> None:
        """Nothing is open between states."""
