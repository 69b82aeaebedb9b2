"""A user's own criterion, mode-mix law and release law: each is one class or function."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fxcrack as fx
from fxcrack.base.roots import bracketed_root
from fxcrack.demos import own_criterion
from fxcrack.demos.own_criterion import GIC, GIIC, E, StressIntensity, ellipse

SMALL: dict[str, Any] = {"dx": 1.0, "length": 60.0}
SOLVERS = [None, "newton"]
# f = 1 is met to 1e-9 by either path, and loads go with its square root
SAME = 1e-8


def linear(g1, g2, g3, g1c, g2c, g3c):
    return g1 / g1c + g2 / g2c + g3 / g3c


def loads(rows: list[dict[str, Any]]) -> list[float]:
    return [row["R[pin_top.y]"] for row in rows]


def pair() -> fx.Interface:
    return fx.Interface("upper_face", "lower_face", name="bond")


# --- criterion ------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize("solver", SOLVERS)
def test_own_criterion_gives_the_loads_of_vcct(solver: str | None) -> None:
    _, own = own_criterion.run(StressIntensity(K_c=np.sqrt(E * GIC)), solver=solver, **SMALL)
    _, vcct = own_criterion.run(fx.VCCT(GIC), solver=solver, **SMALL)
    assert [row["f[bond]"] for row in own] == pytest.approx([1.0] * 6, abs=2e-9)
    assert loads(own) == pytest.approx(loads(vcct), rel=SAME)
    # what the function reports is in the history
    assert [row["G[bond]"] for row in own] == pytest.approx([GIC] * 6, rel=SAME)


@dataclass(frozen=True)
class Steep(StressIntensity):
    """f that is no power of the load."""

    def f(self, tips, force, opening):
        k, report = super().f(tips, force, opening)
        return 0.5 * k + 0.5 * k**9, report


@pytest.mark.parametrize("stepping", ["event", "path", "increment"])
def test_f_that_is_no_power_of_the_load_is_met_at_1(stepping: str) -> None:
    found = []
    for kind in (StressIntensity, Steep):
        bond = fx.Interface("upper_face", "lower_face", lambda x: x[0] >= 30.0 - 1e-6, name="bond")
        scene = fx.Scene(
            own_criterion.dcb_2d(**SMALL),
            materials=fx.Isotropic(E, 0.0),
            model=fx.PlaneStress(),
            supports=[
                fx.Displacement("far_upper", x=0.0, y=0.0),
                fx.Displacement("far_lower", x=0.0, y=0.0),
                fx.Displacement("pin_top", y=1.0),
            ],
            debonds=[fx.Debond(bond, kind(K_c=np.sqrt(E * GIC)))],
        )
        step = fx.Static(until=fx.Releases(4), stepping=stepping, initial=0.5, linear_scaling=0.9)
        history = scene.run(step, progress=False)
        grown = [
            a for a, b in zip(history, list(history)[1:], strict=False) if b["event"] == "release"
        ]
        low = 1.0 - (kind.tolerance if stepping == "increment" else 1e-9)
        assert grown and all(row["f[bond]"] >= low for row in grown)
        if stepping != "increment":
            assert [row["f[bond]"] for row in grown] == pytest.approx([1.0] * 4, abs=1e-12)
            found.append(loads(grown))
        scene.close()
    if found:
        assert found[0] == pytest.approx(found[1], rel=1e-12)


def test_defaults_stand_in_one_place_and_every_criterion_has_all_members() -> None:
    members = [name for name in vars(fx.Criterion) if not name.startswith("_")]
    assert len(members) > 12
    every = [
        fx.VCCT(1.0),
        fx.EnhancedVCCT(1.0, GIc_p=0.5),
        fx.Fatigue(GIc=1.0, paris=fx.Paris(0.0, -1.0, 1.0, 1.0)),
        fx.CriticalStress(1.0, distance=0.1),
        fx.CrackOpening(1.0, distance=0.1),
        fx.CrackLengthVsTime((0.0,), (1.0,), reference="a"),
        StressIntensity(1.0),
    ]
    for criterion in every:
        for name in members:
            assert getattr(criterion, name, criterion) is not criterion
    for name in members:
        assert inspect.getdoc(getattr(fx.Criterion, name)) or name == "tolerance", name


class Lacking:
    """Looks like a criterion and is not."""

    tolerance = 0.1

    def evaluator(self, probe: Any, temperature: Any, *, softens: bool = False) -> Any:
        raise AssertionError


class Nonsense(StressIntensity):
    degree: ClassVar[Any] = "two"


def test_what_is_no_criterion_is_refused() -> None:
    with pytest.raises(
        fx.InputError, match=r"'bond': Lacking is not a criterion \(it lacks .* and"
    ):
        fx.Debond(pair(), Lacking())  # type: ignore[arg-type]
    with pytest.raises(fx.InputError, match=r"not a criterion \(it is a class; make one, VCCT"):
        fx.Debond(pair(), fx.VCCT)  # type: ignore[arg-type]
    with pytest.raises(fx.InputError, match=r"'bond': Nonsense: degree = 'two' is not a number"):
        fx.Debond(pair(), Nonsense(1.0))
    with pytest.raises(fx.InputError, match="Lacking is not a criterion"):
        fx.Debond(pair(), fx.VCCT(1.0), watch=[Lacking()])  # type: ignore[list-item]
    with pytest.raises(fx.InputError, match="ProgressiveRelease is not possible with StressInt"):
        fx.Debond(pair(), StressIntensity(1.0), fx.ProgressiveRelease())

    class Unfinished(fx.Criterion):
        pass

    with pytest.raises(TypeError, match=r"abstract method '?evaluator"):
        Unfinished()  # type: ignore[abstract]


@dataclass(frozen=True)
class Wrong(StressIntensity):
    value: Any = None

    def f(self, tips, force, opening):
        return self.value


@pytest.mark.parametrize(
    ("value", "words"),
    [(1.0, r"'bond': f of the criterion has shape \(\)"), (np.array([np.nan]), "f .* is NaN")],
)
def test_wrong_values_of_f_are_refused(value: Any, words: str) -> None:
    with pytest.raises(fx.InputError, match=words):
        own_criterion.run(Wrong(1.0, value), **SMALL)


# --- mode-mix law ---------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize("solver", SOLVERS)
def test_own_mode_mix_law_is_met_where_beam_theory_says(solver: str | None) -> None:
    _, rows = own_criterion.run(fx.VCCT(GIC, GIIC, mix=ellipse), solver=solver, **SMALL)
    assert [row["f[bond]"] for row in rows] == pytest.approx([1.0] * 6, abs=2e-9)
    for row in rows:
        on_ellipse = np.hypot(row["GI[bond]"] / GIC, row["GII[bond]"] / GIIC)
        assert on_ellipse == pytest.approx(1.0, abs=2e-9)
    # 3.7 % below at this mesh, 2.2 % at half the size
    exact = 7.0 * GIC / np.hypot(4.0, 3.0 * GIC / GIIC)
    assert rows[0]["GI[bond]"] + rows[0]["GII[bond]"] == pytest.approx(exact, rel=0.04)


@pytest.mark.mpi
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("release", [fx.StepRelease(), fx.ProgressiveRelease()])
def test_a_function_is_as_good_as_a_law_of_the_package(solver: str | None, release: Any) -> None:
    options = {"solver": solver, "release": release, "count": 3, **SMALL}
    found = [
        own_criterion.run(fx.VCCT(GIC, GIIC, mix=mix), **options)
        for mix in (
            fx.Power(am=1.0, an=1.0),
            linear,
            lambda g1, g2, g3: linear(g1, g2, g3, GIC, GIIC, GIIC),
        )
    ]
    (history, rows), *others = found
    assert len(rows) == 3
    for other, onsets in others:
        assert loads(onsets) == pytest.approx(loads(rows), rel=SAME)
        for name in ("released_energy", "strain_energy"):
            assert [row[name] for row in onsets] == pytest.approx([r[name] for r in rows], rel=1e-6)
        assert np.abs(other["balance"]).max() <= 1e-6 * np.abs(other["external_work"]).max()
    assert history.reason == found[1][0].reason


@pytest.mark.parametrize(
    ("mix", "words"),
    [
        (lambda g1, g2: g1, r"must be a function of \(GI, GII, GIII\) or of"),
        (fx.BK, "is no mode-mix law"),
        (0.5, "is no mode-mix law"),
    ],
)
def test_what_is_no_mode_mix_law_is_refused(mix: Any, words: str) -> None:
    with pytest.raises(fx.InputError, match=words):
        fx.VCCT(1.0, 2.0, mix=mix)


@pytest.mark.parametrize(
    ("mix", "words"),
    [
        (lambda g1, g2, g3: 1.0, r"returned shape \(\) for rates of shape \(2,\)"),
        (lambda g1, g2, g3: g1 - 2.0 * g2, "returned f = -1 for GI = 1, GII = 1, GIII = 0"),
        (lambda g1, g2, g3: np.full_like(g1, np.nan), "returned f = nan"),
    ],
)
def test_wrong_values_of_a_mode_mix_law_are_refused(mix: Any, words: str) -> None:
    criterion = fx.VCCT(1.0, 2.0, mix=mix)
    with pytest.raises(fx.InputError, match=words):
        criterion.ratio([[1.0, 1.0, 0.0]] * 2, [1.0, 2.0, 2.0])


def test_a_law_that_never_reaches_1_is_refused() -> None:
    criterion = fx.VCCT(1.0, 2.0, mix=lambda g1, g2, g3: g1 / (1.0 + g1 + g2))
    with pytest.raises(fx.InputError, match="does not pass 1 when the rates grow"):
        criterion.critical([[1.0, 1.0, 0.0]], [1.0, 2.0, 2.0])


# --- release law ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Kinked(fx.ReleaseLaw):
    """Half of the force goes in the first tenth of the duration."""

    duration: float
    driver: ClassVar[Any] = "time"

    def remaining(self, progress: Any) -> Any:
        return np.interp(progress, np.array([0.0, 0.1, 1.0]) * self.duration, [1.0, 0.5, 0.0])

    def breaks(self) -> tuple[float, ...]:
        return (0.0, 0.1 * self.duration, self.duration)


def test_own_release_law_is_as_good_as_one_of_the_package() -> None:
    criterion = StressIntensity(K_c=np.sqrt(E * GIC))
    curve = fx.AmplitudeRelease((0.0, 0.2, 2.0), (1.0, 0.5, 0.0))
    (a, _), (b, _) = (
        own_criterion.run(criterion, release=law, count=2, **SMALL) for law in (Kinked(2.0), curve)
    )
    for name in ("time", "R[pin_top.y]", "released_energy"):
        assert np.array_equal(a[name], b[name])


def test_what_is_no_release_law_is_refused() -> None:
    class Half:
        driver = "time"

    with pytest.raises(fx.InputError, match=r"no release law \(it lacks breaks, remaining, spent"):
        fx.Debond(pair(), fx.VCCT(1.0), Half())  # type: ignore[arg-type]


# --- the search for f = 1 -------------------------------------------------------------------------


@given(st.floats(1e-9, 1.0), st.floats(0.05, 40.0))
def test_root_of_a_power_is_found_in_few_evaluations(root: float, power: float) -> None:
    asked = []

    def function(x: float) -> float:
        asked.append(x)
        return float(np.exp(min(power * np.log(x / root), 500.0))) - 1.0

    found = bracketed_root(function, 0.0, 1.0, -1.0, function(1.0), close=4e-15)
    assert found == pytest.approx(root, rel=1e-12)
    assert len(asked) <= 4 * (50 + 31)  # halvings to round-off of a root of 1e-9


def test_root_of_a_jump_is_its_upper_side() -> None:
    found = bracketed_root(lambda x: 1.0 if x >= 0.3 else -1e-9, 0.0, 1.0, -1e-9, 1.0, close=4e-15)
    assert 0.3 <= found <= 0.3 * (1.0 + 2e-15)


def test_rate_criteria_say_what_they_need() -> None:
    assert fx.VCCT(1.0).degree == 2.0 and not fx.VCCT(1.0).needs_exact_S
    assert fx.VCCT(1.0, method="closure").needs_exact_S
    assert fx.VCCT(1.0, 2.0, mix=fx.Power(am=2.0, an=2.0)).degree == 4.0
    assert fx.VCCT(1.0, 2.0, mix=fx.Power(am=1.0, an=2.0)).degree is None
    assert fx.VCCT(1.0, 2.0, mix=ellipse).degree is None
    assert fx.Fatigue(GIc=1.0, paris=fx.Paris(0.0, -1.0, 1.0, 3.0)).life_exponent(1.0) == 3.0
