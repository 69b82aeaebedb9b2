"""Whether supports and bonds hold every body: told by its rigid motions, not by pivots."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from mpi4py import MPI
from specimens import PINS, specimen
from stability.beams import FAR, arms

import fxcrack as fx
from fxcrack.meshes.blocks import Blocks, build

Array = npt.NDArray[np.float64]
E = 70e3
GROW = fx.Static(until=fx.Releases(3))
CLOSURE = fx.VCCT(GIc=1.0, method="closure")


def first_loads(mesh: fx.Mesh, **options: Any) -> Array:
    """Loads at the first three onsets; energies to what round-off leaves of them, 1e-6 measured."""
    history = specimen(mesh, a0=20.0, **options).run(GROW, progress=False)
    assert history.reason == "3 nodes released"
    work = np.abs(history["external_work"].astype(float)).max()
    assert np.abs(history["balance"].astype(float)).max() < 1e-4 * work
    return np.array(
        [float(r["R[pin_top.y]"]) for r in history if r["event"] in ("onset", "unstable")]
    )


# -- held, however small the pivots ----------------------------------------------------------------


@pytest.mark.parametrize("far", [True, False], ids=["held at both ends", "held by its loads"])
@pytest.mark.parametrize("soft", ["upper", "lower"])
def test_stiffness_contrast(soft: str, far: bool) -> None:
    """Loads of a beam on a next to rigid one go with the root of the modulus, from 1e5 on.

    A load of the soft body alone: 1e-5 of the stiffness is the other's, and 1e-5 is the tolerance
    there. Beyond, round-off takes digits: 1e-14/pivot, 1e-2 at a contrast of 1e9.
    """
    loads = {}
    for power in (5, 7, 9):
        materials = {"upper": fx.Isotropic(E, 0.3), "lower": fx.Isotropic(E, 0.3)}
        materials[soft] = fx.Isotropic(E * 10.0**-power, 0.3)
        supports = [*PINS, *FAR] if far else PINS
        options = {"criterion": CLOSURE, "materials": materials, "supports": supports}
        if far and soft == "lower":  # its pin is where the load is
            pins = [fx.Displacement("pin_top", x=0.0, y=0.0), fx.Displacement("pin_bottom", x=0.0,
                    y=-1.0)]  # fmt: skip
            options["supports"] = [*pins, *FAR]
            history = specimen(arms(), a0=20.0, **options).run(GROW, progress=False)
            loads[power] = np.array(
                [
                    -float(r["R[pin_bottom.y]"])
                    for r in history
                    if r["event"] in ("onset", "unstable")
                ]
            )
        else:
            loads[power] = first_loads(arms(), **options)
    assert loads[7] == pytest.approx(loads[5] * 1e-1, rel=1e-3)
    assert loads[9] == pytest.approx(loads[5] * 1e-2, rel=3e-2)


@pytest.mark.parametrize("solver", ["linear", "newton"])
def test_thin_arms(solver: str, caplog: pytest.LogCaptureFixture) -> None:
    """Arms 2e4 times as long as thick: P goes with the root of h, as an element's length is 1 in
    all of them and far greater than h (a warning says that round-off takes digits).
    """
    loads = [
        first_loads(arms(heights=(h, h)), criterion=CLOSURE, solver=solver) for h in (0.012, 0.003)
    ]
    assert loads[1] == pytest.approx(0.5 * loads[0], rel=1e-2)
    assert "all bodies are held, but stiffnesses are so far apart" in caplog.text


def test_nearly_incompressible_and_soft() -> None:
    """nu = 0.499999 beside a body 1e6 times stiffer, of second order, which does not lock."""
    loads = []
    for nu in (0.4999, 0.499999):
        materials = {"upper": fx.Isotropic(E, nu), "lower": fx.Isotropic(E * 1e-6, nu)}
        options = {"criterion": CLOSURE, "materials": materials, "supports": [*PINS, *FAR]}
        loads.append(first_loads(arms(order=2), **options))
    assert loads[1] == pytest.approx(loads[0], rel=3e-2)


def test_units() -> None:
    """P = P0 E L for toughnesses that go with E L and displacements with L."""
    loads = []
    for modulus, s in ((1.0, 1.0), (70e9, 1e-3), (7e-9, 1e-6), (70e3, 1e3)):
        mesh = arms()
        mesh.domain.geometry.x[:] *= s
        pins = [
            fx.Displacement("pin_top", x=0.0, y=s),
            fx.Displacement("pin_bottom", x=0.0, y=-s),
        ]
        soft = {"upper": fx.Isotropic(modulus, 0.3), "lower": fx.Isotropic(1e-6 * modulus, 0.3)}
        criterion = fx.VCCT(GIc=1e-5 * modulus * s, method="closure")
        options = {"a0": 20.0 * s, "criterion": criterion, "materials": soft, "supports": pins}
        history = specimen(mesh, **options).run(GROW, progress=False)
        load = next(float(r["R[pin_top.y]"]) for r in history if r["event"] == "onset")
        loads.append(load / (modulus * s))
    # round-off of the contrast
    assert loads == pytest.approx(np.full(4, loads[0]), rel=1e-4)


def test_newton_does_not_wait_for_f_to_be_more_than_it_resolves() -> None:
    """f came to 1 - 6e-9 and no nearer; that counted as reached, but nothing was released, ever."""
    materials = {"upper": fx.Isotropic(E, 0.3), "lower": fx.Isotropic(1e-5 * E, 0.3)}
    options = {"materials": materials, "supports": [*PINS, *FAR]}
    linear, newton = (
        first_loads(arms(), criterion=CLOSURE, solver=s, **options) for s in ("linear", "newton")
    )
    assert newton == pytest.approx(linear, rel=1e-6)  # round-off of the contrast


# -- free, and how -----------------------------------------------------------------------------


def stack(comm: MPI.Intracomm, n: int = 3, solid: bool = False) -> fx.Mesh:
    """Blocks "b0", "b1", ... on top of each other, 2 long, with faces "top0", "under1", ..."""

    def make() -> Blocks:
        model = Blocks()
        x = np.linspace(0.0, 2.0, 5)
        z = (np.linspace(0.0, 1.0, 3),) if solid else ()
        for i in range(n):
            cell = "hexahedron" if solid else "quadrilateral"
            block = model.add(f"b{i}", [x, np.array([0.0, 0.5, 1.0]) + i, *z], cell, 1)
            model.group(f"under{i}", block.part(y=float(i)))
            model.group(f"top{i}", block.part(y=float(i + 1)))
            model.group(f"left{i}", block.part(x=0.0))
        return model

    return build(comm, "stack", make)


def bonds(n: int, *bonded: Any, **options: Any) -> list[fx.Interface]:
    return [
        fx.Interface(f"top{i}", f"under{i + 1}", bonded=bonded[i], name=f"bond{i}", **options)
        for i in range(n - 1)
    ]


def everywhere(x: Array) -> npt.NDArray[np.bool_]:
    return np.ones(x.shape[1], dtype=bool)


def nowhere(x: Array) -> npt.NDArray[np.bool_]:
    return np.zeros(x.shape[1], dtype=bool)


def one_node(x: Array) -> npt.NDArray[np.bool_]:
    return np.asarray(np.isclose(x[0], 1.0))


def line(x: Array) -> npt.NDArray[np.bool_]:
    return np.asarray(np.isclose(x[0], 2.0))


def run(comm: MPI.Intracomm, mesh: fx.Mesh, **options: Any) -> None:
    scene = fx.Scene(
        mesh,
        materials=options.pop("materials", fx.Isotropic(1.0, 0.3)),
        model=fx.Solid() if mesh.gdim == 3 else fx.PlaneStrain(),
        **options,
    )
    scene.run(fx.Static(until=fx.Time(1.0), stepping="increment", initial=1.0), progress=False)


HOLD = [fx.Displacement("under0", x=0.0, y=0.0)]


@pytest.mark.mpi
@pytest.mark.parametrize("solver", ["linear", "newton"])
@pytest.mark.parametrize(
    ("bonded", "words"),
    [
        ((everywhere, nowhere), "leave body 'b2' free to move along x and y, and free to turn"),
        ((everywhere, one_node), "leave body 'b2' free to turn"),
        (
            (nowhere, everywhere),
            "leave body 'b1' free to move along x and y, and free to turn; body 'b2' free to move",
        ),
    ],
)
def test_free_bodies_are_named(
    comm: MPI.Intracomm, bonded: tuple[Any, Any], words: str, solver: str
) -> None:
    with pytest.raises(fx.FxcrackError, match=f"can still move freely.*{words}"):
        run(comm, stack(comm), supports=HOLD, bonds=bonds(3, *bonded), solver=solver)


def test_a_solid_that_is_bonded_along_a_line_turns_about_it(comm: MPI.Intracomm) -> None:
    hold = [fx.Displacement("under0", x=0.0, y=0.0, z=0.0)]
    words = r"leave body 'b1' free to turn about an axis along \(0, 0, 1\)\)"
    with pytest.raises(fx.FxcrackError, match=words):
        run(comm, stack(comm, 2, True), supports=hold, bonds=bonds(2, line))


@pytest.mark.mpi
@pytest.mark.three
@pytest.mark.parametrize(
    ("end", "axis"),
    [((0.0, 4.0, 0.0), r"\(0, 1, 0\)"), ((3.0, 4.0, 0.0), r"\(0.6, 0.8, 0\)")],
)
def test_the_axis_about_which_a_solid_turns_is_named(
    comm: MPI.Intracomm, end: tuple[float, float, float], axis: str
) -> None:
    def make() -> Blocks:
        model = Blocks()
        x = [np.linspace(0.0, 3.0, 4), np.linspace(0.0, 4.0, 3), np.array([0.0, 1.0])]
        block = model.add("block", x, "hexahedron", 1)
        for name, place in (("one", (0.0, 0.0, 0.0)), ("other", end)):
            model.group(name, block.part(**dict(zip("xyz", place, strict=True))))
        return model

    hold = [fx.Displacement(name, x=0.0, y=0.0, z=0.0) for name in ("one", "other")]
    words = rf"leave the whole model free to turn about an axis along {axis}\)"
    with pytest.raises(fx.FxcrackError, match=words):
        run(comm, build(comm, "block", make), supports=hold)


def test_bonds_in_the_normal_direction_let_a_body_slide(comm: MPI.Intracomm) -> None:
    with pytest.raises(fx.FxcrackError, match=r"leave body 'b1' free to move along x\)"):
        run(comm, stack(comm, 2), supports=HOLD, bonds=bonds(2, everywhere, normal_only=True))


def test_stiffness_does_not_make_a_free_body_held(comm: MPI.Intracomm) -> None:
    """Nor far coordinates, which leave round-off in the motions."""
    mesh = stack(comm, 2)
    mesh.domain.geometry.x[:] += 1e6
    materials = {"b0": fx.Isotropic(1e9, 0.3), "b1": fx.Isotropic(1.0, 0.49)}
    bond = bonds(2, lambda x: np.abs(x[0] - 1e6 - 1.0) < 1e-3)
    with pytest.raises(fx.FxcrackError, match="leave body 'b1' free to turn"):
        run(comm, mesh, supports=HOLD, bonds=bond, materials=materials)
