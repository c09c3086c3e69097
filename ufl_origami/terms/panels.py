"""Elastic data of the panels, cell by cell."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class PanelData:
    """Elastic data of each local cell.

    Attributes:
        young: (nc,) Young's modulus.
        poisson: (nc,) Poisson's ratio.
        thickness: (nc,) thickness.
        curvature: (nc, 3, 3) natural curvature added to the rest shape's, a symmetric tensor in
            space whose value along a tangent t is t.K t, positive towards the panel's normal; or
            None.
        membrane: whether the term carries the membrane energy (False where a form does).
    """

    young: np.ndarray
    poisson: np.ndarray
    thickness: np.ndarray
    curvature: np.ndarray | None = None
    membrane: bool = True
