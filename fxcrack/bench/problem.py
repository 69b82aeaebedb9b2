"""The two speed problems: a double cantilever beam whose crack grows from a = 30 to a = 60.

Two arms 100 x 1.5, E 70e3, nu 0.3, G_Ic 0.2 (N, mm, MPa). "dcb2d": plane strain, bilinear
quadrilaterals, opened at the outer corners of the arm ends. "dcb3d": 20 wide, trilinear
hexahedra, far end clamped, end faces moved.
"""

from __future__ import annotations

from dataclasses import dataclass

from mpi4py import MPI

from fxcrack.base.errors import InputError
from fxcrack.beam_theory import CorrectedBeam
from fxcrack.condensation.options import CondensedOptions
from fxcrack.continuum.kinematics import PlaneStrain, Solid
from fxcrack.continuum.loads import Displacement
from fxcrack.continuum.materials import Isotropic
from fxcrack.criteria import VCCT, StepRelease
from fxcrack.history import Row
from fxcrack.interface.definition import Interface
from fxcrack.mesh import Mesh
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.scene import Scene
from fxcrack.steps.debond import Debond
from fxcrack.steps.end_conditions import CrackLength
from fxcrack.steps.static import Static

LENGTHS = (30.0, 45.0, 60.0)
"""Crack lengths at which opening and load are reported."""

_E, _NU, _GC = 70e3, 0.3, 0.2
_HEIGHT, _WIDTH = 1.5, 20.0

# opening and load at onset, by name, dx and elements per arm height; docs/reference-values.md
_REFERENCE: dict[tuple[str, float, int], dict[float, tuple[float, float]]] = {
    ("dcb2d", 0.5, 4): {30.0: (1.8893, 2.1826), 60.0: (7.3327, 1.1079)},
    ("dcb2d", 0.25, 8): {30.0: (1.9303, 2.1386), 60.0: (7.4835, 1.0862)},
    ("dcb2d", 0.125, 16): {30.0: (1.9427, 2.1265), 60.0: (7.5260, 1.0804)},
}
_REFERENCE_3D = {(1.0, 2.0, 2): 41.77, (0.5, 1.0, 4): 38.56}

NAMES = ("dcb2d", "dcb3d")


@dataclass(frozen=True)
class Problem:
    """One speed problem in one size.

    Attributes:
        name: "dcb2d" or "dcb3d".
        dx: Element length along the arms, length.
        dy: Element length across the width (3-D only), length.
        ny: Elements over the height of an arm.
    """

    name: str
    dx: float
    dy: float
    ny: int

    @classmethod
    def make(
        cls, name: str, dx: float | None = None, dy: float | None = None, ny: int | None = None
    ) -> Problem:
        """A problem with the missing sizes chosen.

        Args:
            name: "dcb2d" or "dcb3d".
            dx: 0.0625 in 2-D and 0.5 in 3-D by default.
            dy: 2 dx by default.
            ny: 2/dx, at least 1, by default.

        Raises:
            InputError: The name is unknown or a size makes no mesh.
        """
        if name not in NAMES:
            raise InputError(f"there is no benchmark '{name}'; choose {' or '.join(NAMES)}")
        if dx is None:
            dx = 0.0625 if name == "dcb2d" else 0.5
        if not 0.0 < dx <= 5.0:
            raise InputError(f"dx = {dx}: choose an element length between 0 and 5")
        dy = 2.0 * dx if dy is None else dy
        if not 0.0 < dy <= _WIDTH:
            raise InputError(f"dy = {dy}: choose an element length between 0 and {_WIDTH:g}")
        ny = max(round(2.0 / dx), 1) if ny is None else ny
        if ny < 1:
            raise InputError(f"ny = {ny}: choose at least 1 element over the height of an arm")
        return cls(name, dx, dy, ny)

    @property
    def is_3d(self) -> bool:
        """Whether it is the one in three dimensions."""
        return self.name == "dcb3d"

    def mesh(self, comm: MPI.Intracomm) -> Mesh:
        """Make the mesh; collective."""
        mesh: Mesh
        if self.is_3d:
            mesh = dcb_3d(comm, dx=self.dx, dy=self.dy, ny=self.ny, width=_WIDTH)
        else:
            mesh = dcb_2d(comm, dx=self.dx, ny=self.ny)
        return mesh

    def scene(self, mesh: Mesh, options: CondensedOptions | None = None) -> Scene:
        """Material, supports and the bonded interface "bond" on a mesh; collective."""
        bond = Interface(
            slave="upper_face",
            master="lower_face",
            bonded=lambda x: x[0] >= LENGTHS[0] - 1e-9,
            name="bond",
        )
        upper, lower = self._ends
        if self.is_3d:
            supports = [Displacement(f"far_{k}", x=0.0, y=0.0, z=0.0) for k in ("upper", "lower")]
            supports += [Displacement(upper, y=0.5), Displacement(lower, y=-0.5)]
        else:
            supports = [Displacement(upper, x=0.0, y=0.5), Displacement(lower, x=0.0, y=-0.5)]
        return Scene(
            mesh,
            materials=Isotropic(_E, _NU),
            model=Solid() if self.is_3d else PlaneStrain(),
            supports=supports,
            # node by node, as the programs and baselines it is compared with
            debonds=[Debond(bond, VCCT(GIc=_GC), StepRelease())],
            options=options,
        )

    def step(self, scene: Scene) -> Static:
        """Grow the crack just beyond the last length, so that the onset there is recorded."""
        return Static(until=CrackLength(scene.debonds[0].interface, LENGTHS[-1] + self.dx))

    @property
    def _ends(self) -> tuple[str, str]:
        return ("end_upper", "end_lower") if self.is_3d else ("pin_top", "pin_bottom")

    def opening(self, row: Row) -> float:
        """Opening of both arms together in a row of the history, length."""
        upper, lower = (float(row[f"u[{end}.y]"]) for end in self._ends)
        return upper - lower

    def load(self, row: Row) -> float:
        """Load in a row of the history: the reaction of the upper arm's end, force."""
        return float(row[f"R[{self._ends[0]}.y]"])

    def load_columns(self, scene: Scene) -> tuple[int, int]:
        """Numbers of the two moving support components, upper then lower, among all."""
        titles = [c.title for c in scene.supports.columns]
        upper, lower = (titles.index(f"{end}.y") for end in self._ends)
        return upper, lower

    def beam_load(self, opening: float) -> float:
        """Load of corrected beam theory at an opening while the crack grows, force."""
        modulus = _E if self.is_3d else _E / (1.0 - _NU**2)
        width = _WIDTH if self.is_3d else 1.0
        beam = CorrectedBeam(E=modulus, E22=modulus, G=0.5 * _E / (1.0 + _NU), h=_HEIGHT, b=width)
        return beam.dcb_load_at_opening(opening, _GC)

    def reference(self) -> dict[float, tuple[float | None, float]]:
        """Known openings and loads at onset by crack length; empty for other sizes."""
        if self.is_3d:
            load = _REFERENCE_3D.get((self.dx, self.dy, self.ny))
            return {} if load is None else {LENGTHS[0]: (None, load)}
        return dict(_REFERENCE.get((self.name, self.dx, self.ny), {}))
