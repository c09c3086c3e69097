"""PETSc options of one solver under its own prefix, without traces in the global database."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc


@contextmanager
def option_scope(prefix: str, options: Mapping[str, object]) -> Iterator[PETSc.Options]:
    """Lend options to PETSc under a prefix; what the user has set there already wins.

    Args:
        prefix: prefix of the solver, such as "ufl_origami_".
        options: name without prefix -> value (None: a flag).

    Yields:
        The options under the prefix.
    """
    database = PETSc.Options(prefix)
    ours = [name for name in options if not database.hasName(name)]
    for name in ours:
        database.setValue(name, options[name])
    try:
        yield database
    finally:
        for name in ours:
            database.delValue(name)
