"""The studies that come with fxcrack: the specimens of the demos, in any discretisation.

Every size is halved as a whole: the elements over the height of the arms, and where a mesh grows
away from the crack also the ratio of neighbouring elements, go with the size along the crack.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fxcrack.accuracy.bending import STRIPS
from fxcrack.accuracy.study import (
    Case,
    ClosedForm,
    Measured,
    Setting,
    Study,
    along,
    as_number,
    critical,
    study,
)
from fxcrack.base.arrays import Array
from fxcrack.base.errors import unknown_name
from fxcrack.continuum.kinematics import Axisymmetric, PlaneStrain, PlaneStress
from fxcrack.continuum.loads import Displacement, Monitor, PointForce, Pressure
from fxcrack.continuum.materials import Isotropic
from fxcrack.criteria import VCCT, Fatigue
from fxcrack.history import History
from fxcrack.interface.definition import Interface
from fxcrack.meshes.dcb import dcb_2d
from fxcrack.meshes.enf import enf_2d
from fxcrack.meshes.mmb import mmb_2d
from fxcrack.meshes.penny import penny as penny_mesh
from fxcrack.scene import Scene
from fxcrack.steps.cycles import Cycles
from fxcrack.steps.debond import Debond
from fxcrack.steps.end_conditions import CrackLength, Releases

_METHODS = ("vcct", "closure", "domain")
"""How G is found in quasi-static studies."""


def _bond(start: float, *, contact: bool = False) -> Interface:
    """The interface "bond" of two arms, bonded from x = start on."""

    def bonded(x: Array) -> Array:
        return np.asarray(x[0] >= start * (1.0 - 1e-9))

    return Interface(
        slave="upper_face", master="lower_face", bonded=bonded, contact=contact, name="bond"
    )


def _pins() -> list[Displacement]:
    """Both arms of a DCB pulled apart by the pins at their ends."""
    return [Displacement("pin_top", x=0.0, y=1.0), Displacement("pin_bottom", x=0.0, y=-1.0)]


def _rollers() -> list[Displacement]:
    """A beam on two supports, one of which holds it along."""
    return [Displacement("support_left", y=0.0), Displacement("support_right", x=0.0, y=0.0)]


def _elements(height: float, size: float) -> int:
    """Elements over a height, about as high as long."""
    return max(1, round(height / size))


@study(
    sizes=(1.0, 0.5, 0.25, 0.125, 0.0625),
    methods=_METHODS,
    steppings=("event", "increment"),
    tolerances=(0.2, 0.05, 0.01),
    solvers=("auto", "columns", "iterative"),
    ranks=(1, 2),
    title="DCB of carbon fibre, plane strain, growth from 30 to 42 mm",
    unit="mm",
)
def dcb(setting: Setting) -> Case:
    """Load at a = 35, G at a load of 60 at a = 30, crack length at an opening of 2.1."""
    from fxcrack.demos.dcb import ARMS, BEAM, G_IC

    mesh = dcb_2d(
        length=100.0, height=BEAM.h, dx=setting.size, ny=_elements(BEAM.h, setting.size),
        cell=setting.cell, order=setting.order,
    )  # fmt: skip
    bond = _bond(30.0)
    scene = Scene(
        mesh,
        materials=ARMS,
        model=PlaneStrain(thickness=BEAM.b),
        supports=_pins(),
        debonds=[Debond(bond, VCCT(GIc=G_IC, **setting.rate_options()))],
        options=setting.options(),
    )
    force, far = 60.0, 2.1

    def measure(history: History) -> Measured:
        rows = critical(history, "bond")
        first = rows[0]
        rate = float(first["GI[bond]"]) * (force / float(first["R[pin_top.y]"])) ** 2
        return Measured(
            load=along(rows, "a[bond]", 35.0, "R[pin_top.y]"),
            G=rate,
            length=along(rows, "u[pin_top.y]", 0.5 * far, "a[bond]"),
        )

    beam = replace(BEAM, E=BEAM.E / (1.0 - 0.30**2 * BEAM.E22 / BEAM.E))
    ae = 30.0 + beam.chi * beam.h
    rate = (force * ae) ** 2 / (beam.b * beam.E * beam.inertia)
    strength = np.sqrt(G_IC * beam.b * beam.E * beam.inertia)
    length = np.sqrt(1.5 * beam.E * beam.inertia * far / strength) - beam.chi * beam.h
    theory = Measured(
        load=as_number(beam.dcb_load(35.0, G_IC)), G=as_number(rate), length=as_number(length)
    )
    return Case(
        scene,
        setting.step(CrackLength(bond, 42.0)),
        measure,
        ClosedForm("corrected beam theory", theory),
    )


@study(
    sizes=(1.0, 0.5, 0.25, 0.125),
    methods=_METHODS,
    steppings=("event", "increment"),
    tolerances=(0.2, 0.05, 0.01),
    ranks=(1, 2),
    title="ENF of carbon fibre with contact, plane stress, growth from 36 to 41 mm",
    unit="mm",
)
def enf(setting: Setting) -> Case:
    """Load at a = 40, G at a load of 1000 at a = 36.

    Not at a deflection: under a point support in the plane it grows with the logarithm of 1/size.
    """
    from fxcrack.demos.enf import ARMS, BEAM, G_IIC

    mesh = enf_2d(
        half_span=50.0, height=BEAM.h, dx=setting.size, ny=_elements(BEAM.h, setting.size),
        cell=setting.cell, order=setting.order,
    )  # fmt: skip
    bond, force = _bond(36.0, contact=True), 1000.0
    scene = Scene(
        mesh,
        materials=ARMS,
        model=PlaneStress(thickness=BEAM.b),
        supports=[*_rollers(), Displacement("load", y=-1.0)],
        debonds=[Debond(bond, VCCT(GIc=G_IIC, **setting.rate_options()))],
        options=setting.options(),
    )

    def measure(history: History) -> Measured:
        rows = critical(history, "bond")
        first = rows[0]
        return Measured(
            load=-along(rows, "a[bond]", 40.0, "R[load.y]"),
            G=float(first["GII[bond]"]) * (force / float(first["R[load.y]"])) ** 2,
        )

    theory = Measured(
        load=as_number(BEAM.enf_load(40.0, G_IIC)), G=as_number(BEAM.enf_rate(36.0, force))
    )
    return Case(
        scene,
        setting.step(CrackLength(bond, 41.0)),
        measure,
        ClosedForm("corrected beam theory", theory),
    )


@study(
    sizes=(1.0, 0.5, 0.25, 0.125),
    methods=_METHODS,
    steppings=("path",),
    ranks=(1, 2),
    title="MMB of carbon fibre, lever 42 mm, plane stress, growth from 30 to 36.5 mm",
    unit="mm",
)
def mmb(setting: Setting) -> Case:
    """Load at a = 35, G and the share of mode II at a load of 100 at a = 35."""
    from fxcrack.demos.mmb import ARMS, BEAM, CRITERION, HALF_SPAN

    lever, force = 42.0, 100.0
    mesh = mmb_2d(
        half_span=HALF_SPAN, height=BEAM.h, dx=setting.size, ny=_elements(BEAM.h, setting.size),
        cell=setting.cell, order=setting.order,
    )  # fmt: skip
    bond = _bond(30.0, contact=True)
    scene = Scene(
        mesh,
        materials=ARMS,
        model=PlaneStress(thickness=BEAM.b),
        supports=_rollers(),
        loads=[
            PointForce("lever_end", (0.0, lever / HALF_SPAN)),
            PointForce("load", (0.0, -(lever + HALF_SPAN) / HALF_SPAN)),
        ],
        debonds=[Debond(bond, replace(CRITERION, **setting.rate_options()))],
        options=setting.options(),
    )

    def measure(history: History) -> Measured:
        rows = critical(history, "bond")
        load, one, two = (
            along(rows, "a[bond]", 35.0, c) for c in ("F[load]", "GI[bond]", "GII[bond]")
        )
        scale = (force / load) ** 2
        return Measured(load=load, G=scale * (one + two), others={"G_II/G": two / (one + two)})

    one, two = (as_number(g) for g in BEAM.mmb_rates(35.0, force, lever, HALF_SPAN))
    critical_rate = CRITERION.GIc + (CRITERION.GIIc - CRITERION.GIc) * (two / (one + two)) ** 1.62
    load = force * np.sqrt(critical_rate / (one + two))
    theory = Measured(load=load, G=one + two, others={"G_II/G": two / (one + two)})
    return Case(
        scene,
        setting.step(CrackLength(bond, 36.5)),
        measure,
        ClosedForm("ASTM D6671", theory),
    )


@study(
    sizes=(0.4, 0.2, 0.1, 0.05, 0.025, 0.0125),
    methods=_METHODS,
    steppings=("event", "increment"),
    tolerances=(0.2, 0.05, 0.01),
    ranks=(1, 2),
    title="penny-shaped crack of 2 m under pressure, axisymmetric",
    unit="m",
)
def penny(setting: Setting) -> Case:
    """Pressure at onset, G at a pressure of 1 MPa, opening of the middle."""
    from fxcrack.demos.penny import NU, OPENING, PRESSURE, RADIUS, RATE, E

    mesh = penny_mesh(
        a=RADIUS, radius=30.0 * RADIUS, half_height=30.0 * RADIUS, dr=setting.size,
        fine=max(0.5, 2.0 * setting.size), growth=1.0 + 3.0 * setting.size,
        cell=setting.cell, order=setting.order,
    )  # fmt: skip
    bond = _bond(RADIUS)

    def pressure(x: Array) -> Array:
        return np.where(x[0] < RADIUS, PRESSURE, 0.0)

    scene = Scene(
        mesh,
        materials=Isotropic(E, NU),
        model=Axisymmetric(),
        supports=[
            Displacement("axis_upper", x=0.0),
            Displacement("axis_lower", x=0.0),
            Displacement("axis_bottom", y=0.0),
        ],
        loads=[Pressure("upper_face", pressure), Pressure("lower_face", pressure)],
        debonds=[Debond(bond, VCCT(GIc=RATE, **setting.rate_options()))],
        monitors=[
            Monitor("centre_upper", (0.0, 1.0), name="upper"),
            Monitor("centre_lower", (0.0, 1.0), name="lower"),
        ],
        options=setting.options(),
    )

    def measure(history: History) -> Measured:
        row = critical(history, "bond")[0]
        factor = float(row["time"])
        return Measured(
            load=factor * PRESSURE,
            G=float(row["GI[bond]"]) / factor**2,
            others={"opening": (float(row["m[upper]"]) - float(row["m[lower]"])) / factor},
        )

    theory = Measured(load=PRESSURE, G=RATE, others={"opening": OPENING})
    return Case(
        scene,
        setting.step(Releases(1)),
        measure,
        ClosedForm("Sneddon 1946", theory, exact=True),
    )


@study(
    sizes=(0.5, 0.25, 0.125, 0.0625, 0.03125),
    cells=("quadrilateral",),
    methods=("closure", "vcct"),
    ranks=(1, 2),
    title="fatigue of the DCB, constant opening, growth by a Paris law",
    unit="mm",
)
def fatigue_dcb(setting: Setting) -> Case:
    """Cycles to a = 34, largest load and G of the cycle at a = 30, length after 75,000 cycles."""
    from fxcrack.demos.dcb import ARMS, BEAM, G_IC
    from fxcrack.demos.fatigue_dcb import (
        A0,
        PARIS,
        RATIO,
        STRAIN_BEAM,
        U_MAX,
        closed_form,
    )  # fmt: skip

    until, at = 34.0, 75_000.0
    mesh = dcb_2d(
        length=100.0, height=BEAM.h, dx=setting.size, ny=max(1, round(0.75 / setting.size)),
        fine=(A0 - 1.0, 36.0), coarse_dx=4.0 * setting.size, cell=setting.cell,
        order=setting.order,
    )  # fmt: skip
    bond = _bond(A0)
    scene = Scene(
        mesh,
        materials=ARMS,
        model=PlaneStrain(thickness=BEAM.b),
        supports=_pins(),
        debonds=[Debond(bond, Fatigue(GIc=G_IC, paris=PARIS, **setting.rate_options()))],
        options=setting.options(),
    )

    def measure(history: History) -> Measured:
        rows = [row for row in history if row["event"] in ("cycle", "release")]
        first = rows[0]
        return Measured(
            load=float(first["R[pin_top.y]"]),
            G=float(first["G_max[bond]"]),
            length=along(rows, "N", at, "a[bond]"),
            others={"cycles": along(rows, "a[bond]", until, "N")},
        )

    a = np.linspace(A0, 36.0, 2001)
    ae = A0 + BEAM.chi * BEAM.h
    rigidity = STRAIN_BEAM.E * STRAIN_BEAM.inertia
    theory = Measured(
        load=3.0 * rigidity * U_MAX / ae**3,
        G=9.0 * rigidity * U_MAX**2 / (BEAM.b * ae**4),
        length=float(np.interp(at, closed_form(a, STRAIN_BEAM, RATIO), a)),
        others={"cycles": as_number(closed_form(until, STRAIN_BEAM, RATIO))},
    )
    return Case(
        scene,
        Cycles(maximum=U_MAX, ratio=RATIO, until=CrackLength(bond, 35.5)),
        measure,
        ClosedForm("Paris integral over beam theory", theory),
    )


STUDIES: dict[str, Study] = {
    **{s.make.__name__: s for s in (dcb, enf, mmb, penny, fatigue_dcb)},
    **STRIPS,
}


def known(name: str) -> Study:
    """A study by its name.

    Raises:
        InputError: There is none of that name.
    """
    if name not in STUDIES:
        unknown_name("study", name, list(STUDIES))
    return STUDIES[name]
