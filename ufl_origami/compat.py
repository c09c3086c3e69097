"""The one module that knows the dolfinx version (0.9 and later)."""

import logging

import dolfinx
import numpy as np
from dolfinx import cpp, fem, la

VERSION = tuple(int(part) for part in dolfinx.__version__.split(".")[:2])

# ffcx, which dolfinx imports, hands all warnings of the process to a logger; in a program that has
# set up no logging they would vanish there.
if not logging.getLogger().handlers:
    logging.captureWarnings(False)


def constants_and_coefficients(form: fem.Form):
    """Packed constants and coefficients of a form, as the assemblers of dolfinx take them."""
    return (
        cpp.fem.pack_constants(form._cpp_object),
        cpp.fem.pack_coefficients(form._cpp_object),
    )


def assemble_scalar(form: fem.Form) -> float:
    """This rank's share of a functional."""
    return fem.assemble_scalar(form)


def add_vector(form: fem.Form, out: np.ndarray) -> None:
    """Add a linear form to local values (owned and ghost unknowns of its space)."""
    constants, coefficients = constants_and_coefficients(form)
    cpp.fem.assemble_vector(out, form._cpp_object, constants, coefficients)


def add_matrix(form: fem.Form, matrix) -> None:
    """Add a bilinear form to a PETSc matrix by its local-to-global map, entry by entry."""
    constants, coefficients = constants_and_coefficients(form)
    cpp.fem.petsc.assemble_matrix(matrix, form._cpp_object, constants, coefficients, [], True)


def assemble_into(matrix: la.MatrixCSR, form: fem.Form) -> None:
    """Assemble a bilinear form of one process into its own matrix."""
    matrix.data[:] = 0.0
    fem.assemble_matrix(matrix, form)  # type: ignore[arg-type]


def local_matrix(form: fem.Form):
    """This process's share of a bilinear form, ghosts included, as a SciPy matrix."""
    return fem.assemble_matrix(form).to_scipy(ghosted=True)
