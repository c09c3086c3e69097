"""Where a path is to stop."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ufl_origami.errors import InputError


def require_stops(stops: Sequence[float], start: float | None = None) -> None:
    """Refuse stops that are no increasing numbers, or not after the start.

    Args:
        stops: load factors or times.
        start: where the path starts; None: a path to be resumed may have passed some.

    Raises:
        InputError: the message names the stops.
    """
    if not np.isfinite(stops).all():
        raise InputError(f"stops {list(stops)} are not finite")
    if any(later <= earlier for earlier, later in pairwise(stops)):
        raise InputError(f"stops {list(stops)} do not increase")
    if start is not None and any(stop <= start for stop in stops):
        raise InputError(f"stops {list(stops)} are not after {start:g}, where the model is")
