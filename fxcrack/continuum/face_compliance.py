"""Compliance of the face of a shell to a traction on it, beyond that of the shell itself.

A traction on the face of a plate of height h raises stresses across and along it that vary over the
height z = h x, 0 at the free face and 1 at the loaded one, as (Reissner 1945)

    sigma_33 = p f(x),    f = 3 x^2 - 2 x^3,    int f^2 dx = 13/35
    sigma_13 = s g(x),    g = 3 x^2 - 2 x,      int g^2 dx = 2/15

so that with the compliances of the plies the face moves by c_n p across and c_s s along, relative
to the mean motion of the plate,

    c_n = int f^2/E_33 dz,    c_s = int g^2/G_13 dz

(G_23 likewise, and their coupling in plies that are turned). A shell with a thickness strain moves
its face by h^2/(4 int C_33 dz) p already, which is taken off c_n.
"""

from __future__ import annotations

import dolfinx.la
import numpy as np
from dolfinx import fem

from fxcrack.base.arrays import Array
from fxcrack.continuum.face import Face
from fxcrack.continuum.section import Section
from fxcrack.continuum.shell_bodies import ShellBodies

_SYMMETRIC = np.array([0, 1, 2, 1, 2, 0]), np.array([0, 1, 2, 2, 0, 1])
"""Rows and columns of the six components of a symmetric tensor."""


def section_compliance(section: Section, side: str) -> Array:
    """Motion of a face of a section per traction on it, in the axes of the section.

    Args:
        section: The section.
        side: "top" or "bottom".

    Returns:
        Shape (3, 3), length^3/force; zero between across and along.
    """
    laminate = section.laminate
    height, points = laminate.thickness, np.polynomial.legendre.leggauss(4)
    out = np.zeros((3, 3))
    below = 0.0
    for ply in laminate.plies:
        x = (below + 0.5 * ply.thickness * (points[0] + 1.0)) / height
        x = x if side == "top" else 1.0 - x
        weight = 0.5 * ply.thickness * points[1]
        compliance = np.linalg.inv(ply.stiffness())
        out[2, 2] += weight @ (3.0 * x**2 - 2.0 * x**3) ** 2 * compliance[2, 2]
        along = compliance[np.ix_([4, 3], [4, 3])]
        out[:2, :2] += weight @ (3.0 * x**2 - 2.0 * x) ** 2 * along
        below += ply.thickness
    out[2, 2] -= height**2 / (4.0 * laminate.moments(0)[0][2, 2])
    return out


def face_compliance(bodies: ShellBodies, face: Face) -> Array:
    """Motion of the points of a face per traction on them, means over the cells around a node.

    Collective.

    Args:
        bodies: The shells.
        face: A face of them.

    Returns:
        Of the owned nodes in global axes, shape (n_owned, 3, 3), length^3/force; zero away from the
        face.
    """
    inside = bodies.mesh.group(face.group, dim=2).entities
    total, count = fem.Function(bodies.space), fem.Function(bodies.space)
    sums, counts = total.x.array.reshape(-1, 6), count.x.array.reshape(-1, 6)
    for part in bodies.shell_parts:
        of_section = section_compliance(part.section, face.side)
        cells = np.flatnonzero(np.isin(part.cells, inside))
        axes = part.axes[cells]
        tensor = np.einsum("cpai,ab,cpbj->cij", axes, of_section, axes) / axes.shape[1]
        components = tensor[:, _SYMMETRIC[0], _SYMMETRIC[1]]
        nodes = part.nodes[cells]
        np.add.at(sums, nodes, components[:, None])
        np.add.at(counts, nodes, 1.0)
    for function in (total, count):
        function.x.scatter_reverse(dolfinx.la.InsertMode.add)
    n = bodies.layout.n_owned
    means = sums[:n] / np.maximum(counts[:n], 1.0)
    out = np.zeros((n, 3, 3))
    out[:, _SYMMETRIC[0], _SYMMETRIC[1]] = means
    out[:, _SYMMETRIC[1], _SYMMETRIC[0]] = means
    return out


__all__ = ["face_compliance", "section_compliance"]
