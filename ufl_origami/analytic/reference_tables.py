"""Tables of published or computed load paths: CSV files with `# key: value` head lines."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ufl_origami.errors import InputError


@dataclass(frozen=True)
class ReferenceTable:
    """Columns of a reference table with what its head says about them.

    Attributes:
        columns: name -> values (rows,), in the file's order.
        head: key -> text of the head lines (source, problem, confidence, ...).
    """

    columns: Mapping[str, NDArray[np.float64]]
    head: Mapping[str, str]

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Values of a column."""
        if name not in self.columns:
            raise InputError(f"reference table: no column {name!r} among {list(self.columns)}")
        return self.columns[name]


def read_table(file: str | Path) -> ReferenceTable:
    """Read a table: head lines `# key: value`, one line of column names, rows of numbers.

    Raises:
        InputError: a head line without a key, a row of the wrong length or a cell that is no
            finite number (with file and row).
    """
    lines = Path(file).read_text(encoding="ascii").splitlines()
    head_lines = [line for line in lines if line.startswith("#")]
    names, *rows = [*csv.reader(line for line in lines if not line.startswith("#"))] or [[]]
    if not rows:
        raise InputError(f"{file}: no rows")
    values = np.array([_row(file, names, row, n) for n, row in enumerate(rows, 1)])
    return ReferenceTable(
        columns={name: values[:, i] for i, name in enumerate(names)},
        head=dict(_key_value(file, line) for line in head_lines),
    )


def _key_value(file: str | Path, line: str) -> tuple[str, str]:
    key, colon, text = line[1:].partition(":")
    if not colon or not key.strip().isidentifier():
        raise InputError(f"{file}: head line without a key: {line!r}")
    return key.strip(), text.strip()


def _row(file: str | Path, names: list[str], row: list[str], number: int) -> list[float]:
    if len(row) != len(names):
        raise InputError(f"{file}: row {number} has {len(row)} cells for {len(names)} columns")
    try:
        values = [float(cell) for cell in row]
    except ValueError as error:
        raise InputError(f"{file}: row {number}: {error}") from error
    if not np.all(np.isfinite(values)):
        raise InputError(f"{file}: row {number} is not finite")
    return values
