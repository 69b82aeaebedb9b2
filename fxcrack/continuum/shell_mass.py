"""Mass of shells at the nodes alone, for explicit dynamics.

    m = int rho_0 N_i dA,    c = int rho_1 N_i dA/m
    j = int (rho_2 + beta rho_0 l^2/12) N_i dA - m c^2

with the moments rho_0, rho_1, rho_2 = int rho (1, z, z^2) dz of the section. The mass of a node
lies at the height c above the reference surface; its kinetic energy is 1/2 m (u' + c w')^2 + 1/2 j
w'^2. The inertia of the change w of the director, rho_0 h^2/12 of one material of thickness h, is
so small that transverse shear and thickness strain would oscillate at c/h and set the increment. It
is enlarged by that of a shell as thick as its cells are long: l is the smallest height of a cell,
and

    beta = 4 max(A_33, A_23, A_13)/max(A_11, A_22)

puts the highest frequency of w alone at sqrt(3/4) of that of membrane waves, 2 c/l, at any
thickness (both act together where Poisson's ratio couples them). The mass of translations stays as
it is. What is added vanishes with l^2: it lowers the frequency of bending
waves of wave number k by the part beta (k l)^2/24.
"""

from __future__ import annotations

import numpy as np

from fxcrack.base.arrays import Array
from fxcrack.base.errors import InputError
from fxcrack.continuum.cell_assembly import cell_vector
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.section import Section
from fxcrack.continuum.shell_bodies import ShellBodies, ShellPart

_CENTRED = 1e-9
"""Height of the mass over its radius of gyration that counts as none."""


def shell_mass(shell: ShellBodies, effect: Inertia) -> tuple[Array, Array, Array]:
    """Mass of every owned dof, what of it was added to the inertia of directors, and where it lies.

    Collective.

    Args:
        shell: The shells; first order.
        effect: Density of the bodies.

    Returns:
        Shape (n_local,) twice: m at displacements and j at directors, mass times length^2. Height c
        of the mass of the owned nodes above the reference surface, shape (n_nodes,), length.

    Raises:
        InputError: A section has no density.
    """
    whole, more, first = [], [], []
    for part in shell.shell_parts:
        moments = _moments(part.section, effect)
        share = part.area @ shell.element.values
        added = _factor(part.section) * moments[0] * _heights(part, shell) ** 2 / 12.0
        values = np.zeros((*share.shape, 6))
        values[..., 3:] = (share * added[:, None])[..., None]
        more.append((part.nodes, values.reshape(len(share), 6 * share.shape[1])))
        values = values.copy()
        values[..., :3] = (moments[0] * share)[..., None]
        values[..., 3:] += (moments[2] * share)[..., None]
        whole.append((part.nodes, values.reshape(len(share), 6 * share.shape[1])))
        off = np.zeros_like(values)
        off[..., 0] = moments[1] * share
        first.append((part.nodes, off.reshape(len(share), 6 * share.shape[1])))
    out = []
    for parts in (whole, more, first):
        vector = cell_vector(shell.space, parts)
        out.append(np.array(vector.array_r))
        vector.destroy()
    by_node = shell.layout.by_node(out[0])
    mass = by_node[:, 0]
    height = shell.layout.by_node(out[2])[:, 0] / mass
    height[height**2 <= _CENTRED**2 * by_node[:, 3] / mass] = 0.0
    by_node[:, 3:] -= (mass * height**2)[:, None]
    return by_node.ravel(), out[1], height


def _moments(section: Section, effect: Inertia) -> Array:
    """Moments of the density of a section, shape (3,).

    Raises:
        InputError: It has none.
    """
    moments = section.mass(effect.density)
    if moments is None:
        raise InputError(
            f"Inertia: {section} has no density; give Inertia(density=...) or density= in the "
            "material"
        )
    return moments


def _factor(section: Section) -> float:
    """Beta: transverse stiffness over that of membrane waves, times 4."""
    stiffness = np.diag(section.stiffness())
    return 4.0 * float(stiffness[2:5].max() / stiffness[:2].max())


def _heights(part: ShellPart, shell: ShellBodies) -> Array:
    """Smallest height of each cell of a part, shape (n_cells,), length."""
    corners = shell.positions()[part.nodes]
    if corners.shape[1] == 4:
        corners = corners[:, [0, 1, 3, 2]]  # once around
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=-1)
    area = part.area.sum(axis=1) * (1.0 if corners.shape[1] == 4 else 2.0)
    return np.asarray(area / sides.max(axis=1, initial=1e-300))


__all__ = ["shell_mass"]
