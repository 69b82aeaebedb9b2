"""Pressure that follows the crack of bodies whose faces turn (finite strain)."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from specimens import HELD_FAR, assert_same, column, onsets

import fxcrack as fx
from fxcrack.continuum.follower_pressure import FollowerPressure
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.interface.crack_fluid import CrackFluid
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.penny import penny

RUBBER = fx.Isotropic(1000.0, 0.3)
TIP, P = 5.0, 0.2
FLUID = [fx.Pressure("bond", P, name="fluid", follows_crack=True)]


def by_hand(values: Any) -> list[fx.Pressure]:
    """The same on fixed facets of both faces."""
    faces = ("upper_face", "lower_face")
    return [fx.Pressure(face, values, follows=True, name=face) for face in faces]


def arms(comm: MPI.Intracomm, loads: Any, kind: str = "2d", order: int = 1) -> fx.Scene:
    """A DCB whose arms are blown apart, without growth."""
    size: dict[str, Any] = {"length": 8.0, "height": 0.5, "dx": 1.0, "ny": 1, "order": order}
    flat = kind in ("2d", "ring")
    if not flat:
        size |= {"width": 2.0, "dy": 1.0, "cell": kind}
    held = HELD_FAR
    if not flat:
        held = [fx.Displacement(f"far_{s}", x=0.0, y=0.0, z=0.0) for s in ("upper", "lower")]
    bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= TIP - 1e-9, name="bond")
    models = {"2d": fx.PlaneStrain(thickness=2.0), "ring": fx.Axisymmetric()}
    return fx.Scene(
        (dcb_2d if flat else dcb_3d)(comm, **size),
        materials=RUBBER,
        model=models.get(kind, fx.Solid()),
        supports=held,
        loads=loads,
        monitors=[
            fx.Monitor("pin_top", (1.0, *[0.0] * (1 if flat else 2)), "x"),
            fx.Monitor("pin_top", (0.0, 1.0, *[0.0] * (0 if flat else 1)), "y"),
        ],
        debonds=[fx.Debond(bond, fx.VCCT(GIc=1e9))],
        effects=[fx.FiniteStrain()],
        # increments are not divided for their energies: states are compared
        newton=fx.NewtonOptions(balance=math.inf),
    )


def largest(values: Any, chosen: Any) -> float:
    """Of all ranks."""
    mine = float(np.abs(values)[chosen].max(initial=0.0))
    return float(MPI.COMM_WORLD.allreduce(mine, op=MPI.MAX))


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize(
    ("kind", "order"),
    [("2d", 2), ("ring", 1), ("hexahedron", 1), ("hexahedron", 2), ("tetrahedron", 2)],
)
def test_forces_and_tangent_on_moved_faces(comm: MPI.Intracomm, kind: str, order: int) -> None:
    """Where meshes match, those of a pressure on all of both faces, by forms, to round-off."""
    scene = arms(comm, FLUID, kind, order)
    solver, continuum = scene.solver, scene.continuum
    forms, fluid = solver.bodies, solver.fluids[0]
    terms = [FollowerPressure(continuum, load) for load in by_hand(lambda x: P + 0.1 * x[0])]
    fluid = CrackFluid(
        continuum, replace(fluid.pressure, value=lambda x: P + 0.1 * x[0], _shares=[]), scene.pairs
    )
    u, move = forms.u, fem.Function(continuum.space)
    for k, field in enumerate((u, move)):
        field.interpolate(lambda x, k=k: 0.1 * np.cos(x[: continuum.gdim] * (1.0 + k) + x[0]))
    for term in (fluid, *terms):
        term.begin(1.0, 0.0)
        term.update(u)
    matrix = forms.tangent().copy()
    hand = WeakForm(continuum, terms)
    hand.u.x.array[:] = u.x.array
    expected, form_matrix = hand.residual(), hand.tangent()
    found = np.zeros(len(u.x.array))
    fluid.add_residual(found, u)
    dead = fluid.pressure.vector(continuum)
    n, free = continuum.n_local, solver.supports.which < 0  # what never opens takes no force
    got = found[:n] - dead.array  # a vector of forces, and minus them in a residual
    # forms on second-order facets in 3-D are integrated by fewer points
    exact = 1e-11 if order == 1 or kind == "2d" else 1e-4
    assert largest(got - expected.array, free) < exact * largest(expected.array, free)
    matrix.zeroEntries()
    fluid.add_tangent(matrix, u)
    matrix.assemble()
    one, other = matrix.createVecLeft(), matrix.createVecLeft()
    matrix.mult(move.x.petsc_vec, one)
    form_matrix.mult(move.x.petsc_vec, other)
    assert largest(one.array - other.array, free) < 10.0 * exact * largest(other.array, free)
    for thing in (expected, dead, matrix, one, other):
        thing.destroy()
    hand.destroy()
    scene.close()


@pytest.mark.mpi
@pytest.mark.three
def test_faces_of_arms_that_turn(comm: MPI.Intracomm) -> None:
    """Beside the same pressure prescribed by hand on the open facets of both faces."""
    hand = by_hand(lambda x: np.where(x[0] < TIP, P, 0.0))
    step = fx.Static(until=fx.Time(1.0), stepping="increment", initial=0.5, maximum=0.5)
    fluid, other = (arms(comm, loads) for loads in (FLUID, hand))
    rows = [scene.run(step, progress=False)[-1] for scene in (fluid, other)]
    # other integrals of the same forces, to the tolerance of the iteration
    for name in ("m[x]", "m[y]", "strain_energy"):
        assert rows[0][name] == pytest.approx(rows[1][name], rel=1e-6)
    assert rows[0]["m[x]"] > 0.05  # far from small rotations
    assert rows[0]["v[fluid]"] == pytest.approx(P * area_between(fluid) * 2.0, rel=1e-9)


def area_between(scene: fx.Scene) -> float:
    """Area between the deformed faces, the mouth closed by a straight line."""
    pair, continuum = scene.pairs[0], scene.continuum
    u = scene.solver.displacement()
    with u as values:
        mine = np.column_stack(
            [continuum.positions()[: len(values) // 2, :2], values.reshape(-1, 2)]
        )
    u.destroy()
    every = np.concatenate(continuum.comm.allgather(mine))
    order = np.argsort(pair.surface.x[:, 0])
    lines = []
    for nodes in (pair.surface.dofs[order], pair.masters[order, np.argmax(pair.weights, axis=1)]):
        lines.append(every[nodes, :2] + every[nodes, 2:])
    x, y = np.concatenate([lines[0], lines[1][::-1]]).T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


def inflated(comm: MPI.Intracomm, E: float, *, finite: bool = True, **options: Any) -> fx.Scene:
    """A penny crack in a cylinder, filled by a fluid."""
    crack = fx.Interface(
        "upper_face", "lower_face", bonded=lambda x: x[0] >= 1.8 - 1e-9, name="crack"
    )
    return fx.Scene(
        penny(comm, a=2.0, radius=10.0, half_height=10.0, dr=0.2, fine=0.3, growth=1.6),
        materials=fx.Isotropic(E, 0.3),
        model=fx.Axisymmetric(),
        supports=[
            fx.Displacement("axis_upper", x=0.0),
            fx.Displacement("axis_lower", x=0.0),
            fx.Displacement("outer_bottom", y=0.0),
        ],
        loads=[fx.Pressure("crack", 1.0, name="fluid", follows_crack=True)],
        debonds=[fx.Debond(crack, fx.VCCT(GIc=0.01), fx.StepRelease())],
        effects=[fx.FiniteStrain()] if finite else [],
        **options,
    )


VOLUME: dict[str, Any] = {"stepping": "opening", "opening": "fluid"}


@pytest.mark.mpi
@pytest.mark.slow
def test_growth_under_injected_volume(comm: MPI.Intracomm) -> None:
    """In a stiff body that of small strain; in a soft one the path does not depend on the control.

    A soft body is blown up (openings of a tenth of the radius), which stiffens it.
    """
    if comm.size == 1:
        step = fx.Static(until=fx.Releases(1), **VOLUME)
        small, stiff = (
            onsets(inflated(comm, 1e5, finite=f).run(step, progress=False)) for f in (False, True)
        )
        for name in ("F[fluid]", "v[fluid]"):  # strains of 1e-3 change stiffnesses by as much
            assert column(stiff, name) == pytest.approx(column(small, name), rel=1e-3)
    runs = [
        inflated(comm, 10.0).run(fx.Static(until=fx.Releases(2), **s), progress=False)
        for s in (VOLUME, {"stepping": "path"})
    ]
    by_volume, by_path = (onsets(run) for run in runs)
    for name in ("F[fluid]", "v[fluid]"):
        assert column(by_volume, name) == pytest.approx(column(by_path, name), rel=1e-6)
    volumes = runs[0]["v[fluid]"].astype(float)
    release = np.flatnonzero(runs[0]["event"] == "release")
    assert volumes[release] == pytest.approx(volumes[release - 1], rel=1e-6)
    for run in runs:
        assert np.abs(run["balance"]).max() < 1e-3 * run["strain_energy"].max()


@pytest.mark.slow
def test_restart_with_a_fluid(tmp_path: Path) -> None:
    kept = fx.Checkpoint(tmp_path / "fluid.npz", every=1)

    class Stopped(Exception):
        """Ends the run."""

    left = [3]

    def stop(event: str, row: Any) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise Stopped

    step = fx.Static(until=fx.Releases(2), **VOLUME)
    whole = inflated(MPI.COMM_SELF, 1e3).run(step, progress=False)
    with pytest.raises(Stopped):
        inflated(MPI.COMM_SELF, 1e3).run(step, checkpoint=kept, observers=[stop], progress=False)
    again = inflated(MPI.COMM_SELF, 1e3).run(step, checkpoint=kept, restart=True, progress=False)
    assert_same(whole, again, 1e-6)  # increments of Newton's method begin anew
