"""PETSc options of one solver under its own prefix, without traces in the global database."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc


@contextmanager
def option_scope(prefix: str, options: Mapping[str, object]) -> Iterator[None]:
    """Lend options to PETSc under a prefix; what the user has set there already wins.

    Args:
        prefix: prefix of the solver, such as "ufl_origami_".
        options: name without prefix -> value (None: a flag).
    """
    database = PETSc.Options(prefix)
    ours = [name for name in options if not database.hasName(name)]
    for name in ours:
        database.setValue(name, options[name])
    try:
        yield
    finally:
        for name in ours:
            database.delValue(name)
