"""Warning of first-order tetrahedra in slender bodies, which are far too stiff in bending."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from fxcrack.base import compat, log
from fxcrack.continuum.continuum import Continuum
from fxcrack.interface.pair import Pair

_SLENDER = 3.0
"""Root of the area of an interface over the mean height of the bodies on either side of it, from
which bodies count as slender."""


def warn_of_locking(continuum: Continuum, pairs: Sequence[Pair]) -> None:
    """Warn where bodies beside an interface are slender and made of first-order tetrahedra.

    Double cantilever beams of them are 27 to 63 % too stiff with three to one elements over the
    height of an arm. Collective.

    Args:
        continuum: The bodies.
        pairs: Interfaces that may come apart.
    """
    domain = continuum.mesh.domain
    if continuum.order != 1 or domain.topology.cell_name() != "tetrahedron" or not pairs:
        return
    n = domain.topology.index_map(3).size_local
    corner = domain.geometry.x[compat.geometry_dofmap(domain)[:n, :4]]
    edges = corner[:, 1:] - corner[:, :1]
    volume = continuum.comm.allreduce(float(np.abs(np.linalg.det(edges)).sum()) / 6.0, op=MPI.SUM)
    for pair in pairs:
        area = float(pair.surface.areas.sum())
        height = 0.5 * volume / area if area > 0.0 else np.inf
        if np.sqrt(area) > _SLENDER * height:
            log.warn(
                "interface '%s': bodies of first-order tetrahedra, %.3g high beside an interface "
                "%.3g long, are too stiff in bending (double cantilever beams by 27 to 63 %%), "
                "and G is too low; take second-order tetrahedra (Scene(order=2), or a mesh of "
                "order 2) or hexahedra",
                pair.title,
                height,
                np.sqrt(area),
            )
