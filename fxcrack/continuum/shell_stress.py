"""Section forces of shells, and stresses on their faces, as means of cells.

    (N, M) = [A B; B D] (e0, e1),      s = C (e0 + z e1) in the ply at a face

Transverse shear is given by the section forces; it is zero on a free face, as stresses here are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.continuum.shell_bodies import ShellBodies, ShellPart
from fxcrack.continuum.shell_temperature import ShellTemperature

_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


@dataclass(frozen=True)
class ShellStress:
    """Means over the owned cells of one section, cells in the order of its part.

    Attributes:
        strains: e0 and e1 in the axes of the section, shape (n_cells, 12), 1 and 1/length.
        forces: N and M in these axes, shape (n_cells, 12), force/length and force.
        faces: Stress on bottom and top in global axes, shape (2, n_cells, 6), Voigt order 11, 22,
            33, 23, 13, 12, force/length^2.
    """

    strains: Array
    forces: Array
    faces: Array


def shell_stress(shell: ShellBodies, q: Array, *, finite: bool = False) -> list[ShellStress]:
    """Section forces and stresses of each part.

    Args:
        shell: The shells.
        q: Unknowns of the local nodes, ghosts too, shape (6 n_local_nodes,).
            The temperature is the present one.
        finite: Green-Lagrange strains and second Piola-Kirchhoff stresses, along the undeformed
            axes.
    """
    vectors = q.reshape(-1, 2, 3)
    out = []
    temperature = None if shell.temperature is None else ShellTemperature(shell)
    for i, part in enumerate(shell.shell_parts):
        change = vectors[part.nodes].reshape(len(part.nodes), 2 * part.nodes.shape[1], 3)
        given = None if temperature is None else temperature.stress(i)
        e = part.strain_cells.strains(change, finite=finite, stress=given)
        share = part.area / part.area.sum(axis=1, keepdims=True)
        axes = part.axes
        rise = np.zeros((*e.shape[:2], 2)) if temperature is None else temperature.values(i)
        faces = [
            np.einsum("cp,cpi->ci", share, _global(_at_face(part, e, rise, side), axes))
            for side in ("bottom", "top")
        ]
        mean = np.einsum("cp,cpi->ci", share, e)
        forces = mean @ part.section.stiffness().T
        forces -= np.einsum("cp,cpi->ci", share, rise) @ part.section.thermal_forces()
        out.append(ShellStress(mean, forces, np.stack(faces)))
    return out


def _at_face(part: ShellPart, e: Array, rise: Array, side: str) -> Array:
    """Stress in the axes of the section on a face, shape (n_cells, n_points, 6)."""
    section = part.section
    ply = section.laminate.plies[-1 if side == "top" else 0]
    z = section.face(side)
    strain = e[..., :6] + z * e[..., 6:]
    stress = strain @ ply.stiffness()
    held = ply.stiffness() @ section.thermal_strains()[-1 if side == "top" else 0]
    stress -= (rise[..., :1] + z * rise[..., 1:]) * held
    stress[..., 3:5] = 0.0
    return np.asarray(stress)


def _global(stress: Array, axes: Array) -> Array:
    """Voigt stresses in global axes of those in local ones, whose rows are the axes."""
    tensor = np.empty((*stress.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(_PAIRS):
        tensor[..., i, j] = tensor[..., j, i] = stress[..., k]
    turned = np.einsum("...ai,...ab,...bj->...ij", axes, tensor, axes)
    return np.stack([turned[..., i, j] for i, j in _PAIRS], axis=-1)


__all__ = ["ShellStress", "shell_stress"]
