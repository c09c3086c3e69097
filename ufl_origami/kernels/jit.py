"""How the kernels are compiled: cached on disk, IEEE semantics, division by zero gives inf or NaN.

Numba stores compiled code next to a stamp of the *one* file a function is defined in, so that an
edit of a helper in another file would leave stale kernels behind. `kernel` therefore stamps its
entries with all files of this package.
"""

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

from numba import njit


@cache
def source_stamp() -> str:
    """Hash of the sources of all kernels: compiled code is valid only for this value."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def kernel(function: Callable) -> Callable:
    """Compile a batch kernel, cached on disk as long as no source of this package changes."""
    dispatcher = njit(cache=True, error_model="numpy", fastmath={"contract"})(function)
    dispatcher._cache._cache_file._source_stamp = source_stamp()
    return dispatcher


def inlined(function: Callable) -> Callable:
    """Compile a helper that disappears into the kernels that call it."""
    return njit(forceinline=True, error_model="numpy", fastmath={"contract"})(function)
