"""The monolithic tangent: dense stencil blocks and UFL forms in one PETSc matrix.

The sparsity comes from the stencils by PETSc's coordinate (COO) assembly, whose two functions
petsc4py does not wrap; forms over triangles fall inside that pattern and are added afterwards.
The loop over terms knows no physics.
"""

import ctypes
from collections.abc import Sequence

from petsc4py import PETSc

import numpy as np

from ufl_origami.configuration import Configuration, State
from ufl_origami.terms.base import MatrixTerm, StencilTerm, Term

_petsc = ctypes.CDLL(PETSc.__file__)
_petsc.MatSetPreallocationCOOLocal.argtypes = [
    ctypes.c_void_p,
    ctypes.c_ssize_t,
    ctypes.c_void_p,
    ctypes.c_void_p,
]
_petsc.MatSetValuesCOO.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int]


def _check(code: int, function: str) -> None:
    if code:
        raise RuntimeError(f"{function} failed with PETSc error code {code}")


def pattern(batches: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of each entry of dense blocks, batch after batch, -1 where unused.

    Args:
        batches: unknowns (n, k) of the stencils; their blocks are (n, k, k).
    """
    size = sum(n * k * k for n, k in (dofs.shape for dofs in batches))
    rows, cols, start = np.empty(size, PETSc.IntType), np.empty(size, PETSc.IntType), 0
    for dofs in batches:
        n, k = dofs.shape
        part = slice(start, start + n * k * k)
        rows[part].reshape(n, k, k)[:] = dofs[:, :, None]
        cols[part].reshape(n, k, k)[:] = dofs[:, None, :]
        start = part.stop
    return rows, cols


class Tangent:
    """Tangent stiffness of a list of terms in one AIJ matrix.

    Args:
        configuration: numbering of the unknowns.
        terms: the scene's terms; stencil terms set the sparsity.
    """

    def __init__(self, configuration: Configuration, terms: Sequence[Term]):
        self.configuration = configuration
        self.stencil_terms = [t for t in terms if isinstance(t, StencilTerm)]
        self.matrix_terms = [t for t in terms if isinstance(t, MatrixTerm)]
        self.matrix = self._create_matrix(all(t.symmetric for t in terms))
        self._preallocate()

    def _create_matrix(self, symmetric: bool) -> PETSc.Mat:
        local = (self.configuration.size_local, PETSc.DETERMINE)
        matrix = PETSc.Mat().create(self.configuration.comm)
        matrix.setSizes((local, local))
        matrix.setType(PETSc.Mat.Type.AIJ)
        matrix.setLGMap(self.configuration.lgmap, self.configuration.lgmap)
        if symmetric:
            matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
            matrix.setOption(PETSc.Mat.Option.SYMMETRY_ETERNAL, True)
        return matrix

    def _diagonal(self) -> np.ndarray:
        """Local indices of the owned unknowns, in the order of the global vector."""
        c = self.configuration
        owned = [np.arange(3 * c.nv_owned), 3 * c.nv + np.arange(c.ns_owned)]
        return np.concatenate(owned).astype(PETSc.IntType)

    def _preallocate(self) -> None:
        """Hand the pattern to PETSc and lay out one array of values with a view a batch."""
        stencils = [batch for term in self.stencil_terms for batch in term.stencils()]
        diagonal = self._diagonal()
        rows, cols = pattern([*stencils, diagonal[:, None]])
        code = _petsc.MatSetPreallocationCOOLocal(
            self.matrix.handle, len(rows), rows.ctypes.data, cols.ctypes.data
        )
        _check(code, "MatSetPreallocationCOOLocal")
        self.matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
        self.matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        self.values = np.zeros(len(rows))
        self.blocks, start = [], 0
        for n, k in (batch.shape for batch in stencils):
            self.blocks.append(self.values[start : start + n * k * k].reshape(n, k, k))
            start += n * k * k

    def evaluate(self, state: State) -> None:
        """Ask each stencil term for its Hessian blocks (kernels only, no insertion)."""
        start = 0
        for term in self.stencil_terms:
            count = len(term.stencils())
            term.tangent(state, self.blocks[start : start + count])
            start += count

    def insert(self, state: State) -> PETSc.Mat:
        """Sum the blocks into the matrix and add the forms."""
        code = _petsc.MatSetValuesCOO(
            self.matrix.handle, self.values.ctypes.data, int(PETSc.InsertMode.INSERT)
        )
        _check(code, "MatSetValuesCOO")
        for term in self.matrix_terms:
            term.add_tangent(state, self.matrix)
        if self.matrix_terms:
            self.matrix.assemble()
        return self.matrix

    def assemble(self, state: State) -> PETSc.Mat:
        """Tangent of all terms at a state, without constraints."""
        self.evaluate(state)
        return self.insert(state)
