"""Modes of crack closure between two materials at a stated length of closure.

Closed form: a crack of length 2 a between two half-planes under tension has K = p sqrt(pi a)
(1 + 2 i eps)(2 a)^{-i eps} (Rice 1988), and the closure integral over l of its asymptotic field
the angle that ``closure_angle`` adds. Second method: the domain integral at the same length.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from test_domain_integral import INFLATED, SOFT, STIFF, oscillation, plate
from test_shell_interfaces import bond as between_shells
from test_shell_interfaces import two_arms

import fxcrack as fx
from fxcrack.criteria.crack_tip_fields import TipFields
from fxcrack.criteria.mode_length import closure_angle
from fxcrack.meshes.dcb import dcb_2d, dcb_3d

LENGTH = 0.1
PLY = fx.Orthotropic(E=(140e3, 10e3, 10e3), nu=(0.3, 0.3, 0.4), G=(5e3, 5e3, 3.6e3))
ACROSS = fx.Orthotropic(E=(10e3, 70e3, 10e3), nu=(0.02, 0.3, 0.3), G=(6e3, 4e3, 4e3))
METAL, RESIN = fx.Isotropic(70e3, 0.3), fx.Isotropic(3e3, 0.38)


def angle(row: fx.history.Row, name: str = "bond", method: str = "") -> float:
    """Angle psi of tan^2 psi = G_II/G_I in degrees."""
    one, two = (float(row[f"G{mode}{method}[{name}]"]) for mode in ("I", "II"))
    return float(np.degrees(np.arctan2(np.sqrt(two), np.sqrt(one))))


def strip(
    upper: Any, lower: Any, *, dx: float, order: int = 1, gdim: int = 2,
    comm: MPI.Intracomm = MPI.COMM_SELF, **options: Any,
) -> fx.history.Row:  # fmt: skip
    """A strip between grips that are moved apart and along each other."""
    bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= 3.0 - 1e-9, name="bond")
    size: dict[str, Any] = {"length": 6.0, "height": 1.0, "dx": dx, "ny": round(1.0 / dx)}
    flat: dict[str, float] = {} if gdim == 2 else {"z": 0.0}
    supports = [
        fx.Displacement("top", x=0.003, y=0.01, **flat),
        fx.Displacement("bottom", x=0.0, y=0.0, **flat),
    ]
    if gdim == 2:
        mesh, model = dcb_2d(comm, **size, order=order), fx.PlaneStrain()
    else:
        mesh = dcb_3d(comm, **size, width=0.5, z_spacing=[0.0, 0.25, 0.5])
        model = fx.Solid()
        supports += [fx.Displacement(side, z=0.0) for side in ("side_0", "side_w")]
    scene = fx.Scene(
        mesh,
        materials={"upper": upper, "lower": lower},
        model=model,
        supports=supports,
        debonds=[
            fx.Debond(
                bond,
                fx.VCCT(GIc=1e5, **(options or {"mode_length": LENGTH})),
                watch=[fx.VCCT(GIc=1e5, method="domain", reference_length=LENGTH)],
            )
        ],
    )
    row = scene.run(fx.Static(until=fx.Time(1.0)), progress=False)[-1]
    scene.close()
    return row


@pytest.mark.parametrize("method", ["vcct", "closure"])
@pytest.mark.parametrize(
    ("order", "n", "near"),
    [
        # measured 1.4, 1.1 and 0.9 degrees (vcct) in first order, 0.16 and 0.08 in second
        pytest.param(1, 4, 2.0, marks=pytest.mark.slow),
        (1, 8, 1.5),
        pytest.param(1, 16, 1.2, marks=pytest.mark.slow),
        (2, 4, 0.4),
        pytest.param(2, 8, 0.25, marks=pytest.mark.slow),
    ],
)
def test_angle_is_that_of_the_closed_form(method: str, order: int, n: int, near: float) -> None:
    # elements are 0.25 to 0.06 of a long: without mode_length the angle changes by 4.5 degrees
    # each time they are halved
    criterion = fx.VCCT(GIc=1.0, method=method, mode_length=LENGTH)
    row = plate(INFLATED, criterion, materials={"upper": STIFF, "lower": SOFT}, order=order, n=n)
    eps = oscillation(STIFF, SOFT)
    k = (1.0 + 2j * eps) * (0.5 * LENGTH) ** (1j * eps)
    exact = np.angle(k, deg=True) + np.degrees(closure_angle(eps))
    assert angle(row) == pytest.approx(exact, abs=near)


@pytest.mark.parametrize(
    ("upper", "lower", "near"),
    [(METAL, RESIN, 0.1), (ACROSS, PLY, 0.8), (PLY, RESIN, 0.3)],
    ids=["isotropic", "orthotropic", "both"],
)
def test_angle_is_that_of_the_domain_integral(upper: Any, lower: Any, near: float) -> None:
    """Second order; measured 0.004, 0.43 and 0.14 degrees, the same on elements half as long."""
    row = strip(upper, lower, dx=0.2, order=2)
    frame = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]).T
    eps = TipFields(upper.stiffness(), lower.stiffness(), frame, LENGTH).oscillation
    sign = np.sign(float(row["KI[bond]"]) * float(row["KII[bond]"]))
    exact = sign * angle(row, method="_domain") + np.degrees(closure_angle(eps))
    assert angle(row) == pytest.approx(abs(exact), abs=near)


@pytest.mark.parametrize("order", [1, pytest.param(2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("pair", [(METAL, RESIN), (ACROSS, PLY)], ids=["isotropic", "orthotropic"])
def test_modes_do_not_depend_on_the_mesh(order: int, pair: tuple[Any, Any]) -> None:
    # elements of 0.2, 0.1 and 0.05: measured 0.16 degrees at most; without a length
    # psi turns by eps ln 2, 2.2 and 0.7 degrees, each time they are halved
    sizes = (0.2, 0.1) if order == 1 else (0.2, 0.1, 0.05)
    found = [angle(strip(*pair, dx=dx, order=order)) for dx in sizes]
    assert np.ptp(found) < 0.3


def test_at_the_length_of_the_elements_modes_are_those_of_crack_closure(
    caplog: pytest.LogCaptureFixture,
) -> None:
    # to the order of eps^2: the sum of the modes exactly
    mixed: dict[str, Any] = {"GIIc": 2e5, "mix": fx.BK(2.0)}
    turned = strip(METAL, RESIN, dx=0.2, mode_length=0.2, **mixed)
    assert "belong to the length of the elements" not in caplog.text
    plain = strip(METAL, RESIN, dx=0.2, **mixed)
    # eps ln 2 of this pair is 2.2 degrees
    assert "they turn by 2.2 degrees of phase each time elements become half" in caplog.text
    sums = [float(r["GI[bond]"]) + float(r["GII[bond]"]) for r in (turned, plain)]
    assert sums[0] == pytest.approx(sums[1], rel=1e-12)
    assert float(turned["GI[bond]"]) == pytest.approx(float(plain["GI[bond]"]), rel=0.01)


def test_one_material_has_no_length() -> None:
    mixed: dict[str, Any] = {"GIIc": 2e5, "mix": fx.BK(2.0)}
    turned, plain = (
        strip(PLY, PLY, dx=0.2, **o) for o in ({"mode_length": 1e-3}, mixed)
    )  # fmt: skip
    for mode in ("GI[bond]", "GII[bond]"):
        assert float(turned[mode]) == pytest.approx(float(plain[mode]), rel=1e-12)


@pytest.mark.mpi
def test_along_a_front_and_on_any_number_of_ranks(comm: MPI.Intracomm) -> None:
    """Plane strain between two planes: the angle of the same strip in 2-D, on any ranks."""
    flat = strip(METAL, RESIN, dx=0.5)
    deep = strip(METAL, RESIN, dx=0.5, gdim=3, comm=comm)
    assert angle(deep) == pytest.approx(angle(flat), abs=1e-6)


def test_refusals() -> None:
    with pytest.raises(fx.InputError, match="reference_length"):
        fx.VCCT(GIc=1.0, method="domain", mode_length=0.1)
    with pytest.raises(fx.InputError, match="belongs to the modes of method='domain'"):
        fx.VCCT(GIc=1.0, reference_length=0.1)
    with pytest.raises(fx.InputError, match="mode_length"):
        fx.VCCT(GIc=1.0, mode_length=-0.1)


def test_refused_where_the_fields_of_the_tip_are_not_known() -> None:
    """Moduli that change with the temperature, shells, explicit dynamics."""
    bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= 3.0 - 1e-9, name="bond")
    options: dict[str, Any] = {
        "supports": [fx.Displacement("far_upper", x=0.0, y=0.0),
                     fx.Displacement("far_lower", x=0.0, y=0.0)],
        "debonds": [fx.Debond(bond, fx.VCCT(GIc=1.0, mode_length=LENGTH))],
    }  # fmt: skip
    mesh = dcb_2d(MPI.COMM_SELF, length=6.0, height=1.0, dx=1.0, ny=1)
    flat: dict[str, Any] = {"model": fx.PlaneStrain(), **options}

    def refused(step: Any, on: Any = mesh, **arguments: Any) -> str:
        with pytest.raises(fx.InputError, match="mode_length") as error:
            fx.Scene(on, **arguments).run(step, progress=False)
        return str(error.value)

    still = fx.Static(until=fx.Time(1.0))
    table = fx.ByTemperature({0.0: METAL, 100.0: RESIN})
    warm = [fx.Temperature(1.0, reference=0.0)]
    assert "temperature" in refused(still, materials=table, effects=warm, **flat)
    heavy = fx.Isotropic(70e3, 0.3, density=1e-9)
    assert "explicit" in refused(fx.Explicit(until=fx.Time(1e-6)), materials=heavy, **flat)
    sheets = two_arms(MPI.COMM_SELF, length=6.0, width=1.0, heights=(0.5, 0.5), dx=1.0, ny=1)
    options["supports"] = [fx.Clamp("upper_a1"), fx.Clamp("lower_a1")]
    options["debonds"] = [fx.Debond(between_shells(3.0), fx.VCCT(GIc=1.0, mode_length=LENGTH))]
    section = fx.Section(METAL, thickness=0.5)
    assert "shells" in refused(still, sheets, model=fx.Shell(), materials=section, **options)
