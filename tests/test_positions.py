"""Functions of position: one convention everywhere, the former one told by shapes, clear errors.

A function gets x of shape (3, n), as DOLFINx gives it. Toughness and interface temperature took
shape (n, gdim) before; such functions still work, with a warning.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

import fxcrack as fx
from fxcrack.base.positions import marks_at, numbers_at
from fxcrack.continuum.starting_velocity import starting_velocity
from fxcrack.mesh import mesh_from_domain
from fxcrack.meshes.dcb import dcb_2d

HELD = [fx.Displacement("far_upper", x=0.0, y=0.0), fx.Displacement("far_lower", x=0.0, y=0.0)]
PULL = [fx.PointForce("pin_top", (0.0, 1.0)), fx.PointForce("pin_bottom", (0.0, -1.0))]


def scene(comm: MPI.Comm, **parts: Any) -> fx.Scene:
    bond = {"bonded": lambda x: x[0] >= 3.0} | parts.pop("bond", {})
    debond = {"criterion": fx.VCCT(GIc=0.2)} | parts.pop("debond", {})
    interface = fx.Interface("upper_face", "lower_face", name="bond", **bond)
    given = {"materials": fx.Isotropic(70e3, 0.3, expansion=1e-5), "supports": HELD, "loads": PULL}
    return fx.Scene(
        dcb_2d(comm, length=8.0, dx=1.0, ny=1),
        model=fx.PlaneStrain(),
        debonds=[fx.Debond(interface, **debond)],
        **given | parts,
    )


def run(comm: MPI.Comm, **parts: Any) -> fx.History:
    made = scene(comm, **parts)
    try:
        return made.run(fx.Static(until=fx.Releases(1)), progress=False)
    finally:
        made.close()


def of_vcct(function: Any) -> dict[str, Any]:
    return {"debond": {"criterion": fx.VCCT(GIc=function)}}


def of_temperature(function: Any) -> dict[str, Any]:
    tough = fx.VCCT(GIc=fx.Tabulated([0.0, 100.0], [0.2, 0.3]))
    return {"debond": {"criterion": tough, "temperature": function}}


PLACES: dict[str, tuple[Callable[[Any], dict[str, Any]], str]] = {
    "support": (lambda f: {"supports": [*HELD, fx.Displacement("pin_top", y=f)]}, "pin_top"),
    "pressure": (lambda f: {"loads": [*PULL, fx.Pressure("top", f)]}, "load 'top'"),
    "follower": (
        lambda f: {"loads": [*PULL, fx.Pressure("top", f, follows=True)]},
        "load 'top'",
    ),
    "traction": (lambda f: {"loads": [*PULL, fx.Traction("top", (0.0, f))]}, "load 'top'"),
    "body force": (lambda f: {"loads": [*PULL, fx.BodyForce((f, 0.0))]}, "load 'body_force'"),
    "temperature": (lambda f: {"effects": [fx.Temperature(f)]}, "Temperature"),
    "velocity": (lambda f: {"effects": [fx.Inertia(density=1.0, velocity=(0.0, f))]}, "velocity"),
    "friction": (lambda f: {"bond": {"contact": True, "friction": f}}, "friction"),
    "bonded": (lambda f: {"bond": {"bonded": f}}, "bonded"),
    "toughness": (of_vcct, "GIc"),
    "interface temperature": (of_temperature, "temperature"),
}


MISTAKES: dict[str, tuple[Callable[[Any], Any], str]] = {
    "raises": (lambda x: {}["mine"], "fails: KeyError"),
    "a shape": (lambda x: np.ones(2), r"gives shape \(2,\)"),
    "components": (lambda x: np.ones_like(x), r"gives shape \(3, \d+\)"),
    "nothing": (lambda x: None, "gives None"),
    "words": (lambda x: ["a"] * x.shape[1], "type <U1|gives 'a'"),
    "complex": (lambda x: 1j * x[0], "complex128|gives [0-9.e-]+j"),
    "no array": (lambda x: x.missing, "fails: AttributeError"),
    "arguments": (lambda: 1.0, "fails: TypeError"),
}


@pytest.mark.mpi
@pytest.mark.parametrize("place", PLACES)
def test_a_mistake_is_named_with_its_place(place: str, comm: MPI.Comm) -> None:
    """On all ranks, also on those that have none of the positions."""
    parts, name = PLACES[place]
    for mistake, words in MISTAKES.values():
        with pytest.raises(fx.InputError) as caught:
            run(comm, **parts(mistake))
        text = str(caught.value)
        assert name in text
        assert caught.match(words)
        if "fails" in words or "shape" in words:
            assert "positions x of shape (3, " in text and "the first coordinate is x[0]" in text


@pytest.mark.parametrize("place", PLACES)
def test_the_same_function_serves_everywhere(place: str) -> None:
    """x[0] is the first coordinate: values at the two ends decide, and no warning is given."""
    seen = []

    def field(x: Any) -> Any:
        seen.append(x.shape)
        return x[0] >= 3.0 if place == "bonded" else 1e-3 * (1.0 + x[0])

    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        made = scene(MPI.COMM_SELF, **PLACES[place][0](field))
        if place != "velocity":  # a Static step has no velocity
            made.run(fx.Static(until=fx.Time(1e-6)), progress=False)
    assert seen and all(len(shape) == 2 and shape[0] == 3 for shape in seen)
    made.close()


def test_the_former_convention_is_told_by_its_shape() -> None:
    new = scene(MPI.COMM_SELF, **of_vcct(lambda x: 0.2 + 0.1 * x[0]))
    old = scene(MPI.COMM_SELF, **of_vcct(lambda x: 0.2 + 0.1 * x[:, 0]))
    step = fx.Static(until=fx.Releases(2))
    rows = new.run(step, progress=False)
    with pytest.warns(DeprecationWarning, match=r"write it for shape \(3, n\)"):
        former = old.run(step, progress=False)
    assert former["F[pin_top]"].tolist() == rows["F[pin_top]"].tolist()


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7])
@pytest.mark.parametrize("gdim", [2, 3])
def test_shapes_tell_the_conventions_apart_for_any_number_of_positions(n: int, gdim: int) -> None:
    x = np.random.default_rng(n).random((n, gdim))
    assert numbers_at("mine", "f", lambda x: x[1], x) == pytest.approx(x[:, 1])
    with pytest.warns(DeprecationWarning, match="takes positions of shape"):
        assert numbers_at("mine", "f", lambda x: x[:, 1], x) == pytest.approx(x[:, 1])
    assert numbers_at("mine", "f", lambda x: 3, x).tolist() == [3.0] * n
    assert marks_at("mine", "f", lambda x: x[0] > 0.5, x).tolist() == (x[:, 0] > 0.5).tolist()


@pytest.mark.mpi
def test_a_starting_velocity_in_explicit_dynamics(comm: MPI.Comm) -> None:
    """The former convention is told there as well, and a mistake is named on all ranks."""

    def velocities(field: Any) -> Any:
        made = scene(comm, effects=[fx.Inertia(density=1e-9, velocity=(0.0, field))], loads=[])
        found = starting_velocity(made.continuum, made.input.effects[0].velocity)
        made.close()
        return found

    new = velocities(lambda x: 3.0 * x[0] - x[1])
    assert max(comm.allgather(float(np.abs(new).max(initial=0.0)))) > 20.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # on ranks that own nodes
        assert velocities(lambda x: 3.0 * x[:, 0] - x[:, 1]).tolist() == new.tolist()
    with pytest.raises(fx.InputError, match=r"Inertia: velocity\[1\] gives shape \(2,\)"):
        velocities(lambda x: np.ones(2))


def test_loads_on_the_ring_of_the_domain_integral() -> None:
    """Pressure on the crack face and body force by either convention give the same G."""

    def rate(first: Any) -> float:
        loads = [fx.Pressure("upper_face", first), fx.BodyForce((0.0, first))]
        made = scene(
            MPI.COMM_SELF, loads=loads, debond={"criterion": fx.VCCT(GIc=0.2, method="domain")}
        )
        row = made.run(fx.Static(until=fx.Time(1e-3)), progress=False)[-1]
        made.close()
        return float(row["GI[bond]"])

    with pytest.warns(DeprecationWarning, match="takes positions of shape"):
        former = rate(lambda x: 1.0 + x[:, 0])
    assert former == rate(lambda x: 1.0 + x[0]) > 0.0


def test_distances_are_no_booleans() -> None:
    x = np.array([[0.0, 0.0], [2.0, 0.0]])
    with pytest.raises(fx.InputError, match=r"f gives -1.5; one boolean per position"):
        marks_at("mine", "f", lambda x: x[0] - 1.5, x)
    assert marks_at("mine", "f", lambda x: np.array([0, 1, 0, 1]), x).tolist() == [False, True]


@pytest.mark.mpi
def test_markers_of_groups_say_what_is_wrong(comm: MPI.Comm) -> None:
    domain = dcb_2d(comm, length=8.0, dx=1.0, ny=1).domain
    with pytest.raises(fx.InputError, match="group 'left' fails: KeyError"):
        mesh_from_domain(domain, {"left": (1, lambda x: {}["mine"])})
    with pytest.raises(fx.InputError, match=r"group 'left' gives shape \(2,\)"):
        mesh_from_domain(domain, {"left": (1, lambda x: np.ones(2))})
