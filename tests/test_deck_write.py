"""Scenes written as decks: what is read again gives the same history."""

from __future__ import annotations

import numpy as np
import pytest

import fxcrack as fx
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from tests.specimens import STEEL

INCREMENTS = fx.Static(
    until=fx.Time(2.0), stepping="increment", initial=0.2, minimum=1e-6, maximum=0.4,
    cutback=0.4, growth=2.0, max_cutbacks=9, max_increments=500, linear_scaling=0.9,
)  # fmt: skip
PINS = [fx.Displacement("pin_top", x=0.0, y=1.0), fx.Displacement("pin_bottom", x=0.0, y=-1.0)]


def scene(mesh, criterion=None, release=None, model=None, interface=None, **options):
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] >= 30.0 - 1e-9,
        name="bond", contact=True, **(interface or {}),
    )  # fmt: skip
    debond = fx.Debond(
        bond,
        criterion or fx.VCCT(0.2, 0.5, mix=fx.BK(1.7), tolerance=0.1),
        **({} if release is None else {"release": release}),
    )
    given = {"materials": STEEL, "supports": PINS, "debonds": [debond]}
    return fx.Scene(mesh, model=model or fx.PlaneStrain(20.0), **{**given, **options})


def round_trip(path, one, steps, *, rel=1e-12, other_names=()):
    """Compare the histories of a scene and of the deck it is written to."""
    fx.write_deck(one, steps, path)
    deck = fx.read_deck(path)
    for i, step in enumerate(steps):
        one.run(step)
        assert type(deck.steps[i].step) is type(step)
    found, wanted = deck.run(), one.history
    assert len(found) == len(wanted)
    for column in wanted.columns:
        mine = found[dict(other_names).get(column, column)]
        if column == "event":
            assert list(mine) == list(wanted[column])
            continue
        a, b = mine.astype(float), wanted[column].astype(float)
        # of quantities that are 0 but for round-off the largest load or energy is the measure
        kind = "R[" if column.startswith(("R[", "balance")) else column
        size = max(
            np.nanmax(np.abs(wanted[c].astype(float)), initial=0.0)
            for c in wanted.columns if c.startswith(kind)
        )  # fmt: skip
        assert a == pytest.approx(b, rel=rel, abs=rel * max(size, 1.0), nan_ok=True), column
    deck.scene.close()
    one.close()
    return deck


@pytest.mark.mpi
def test_growth_by_increments_is_the_same(shared_path):
    one = scene(dcb_2d(dx=2.5, ny=1))
    deck = round_trip(shared_path / "a.inp", one, [INCREMENTS])
    assert deck.steps[0].step.linear_scaling == 0.9
    assert deck.scene.history.rows[-1]["released[bond]"] > 0


CRITERIA = [
    (fx.VCCT(0.2), fx.RampRelease()),
    (fx.VCCT(0.2, 0.5, 0.5, mix=fx.Power(1.0, 1.0), unstable_tolerance=np.inf), None),
    (
        fx.VCCT(lambda x: 0.2 + 0.001 * x[0], 0.5, mix=fx.Reeder(2.0), unstable_tolerance=0.5),
        None,
    ),
    (
        fx.EnhancedVCCT(GIc=0.2, GIIc=0.5, GIc_p=0.15, GIIc_p=0.4, mix=fx.BK(1.5), tolerance=0.5),
        None,
    ),
    (
        fx.CriticalStress(30.0, 60.0, distance=1.0),
        fx.AmplitudeRelease((0.0, 0.05, 0.1), (1.0, 0.75, 0.0), 0.01),
    ),
    (fx.CrackOpening(((0.0, 10.0), (0.05, 0.06)), distance=2.5), None),
    (fx.CrackLengthVsTime((0.0, 2.0), (30.0, 40.0), reference="pin_top"), None),
]


@pytest.mark.parametrize("criterion, release", CRITERIA)
def test_every_criterion_is_the_same(tmp_path, criterion, release):
    one = scene(dcb_2d(dx=2.5, ny=1), criterion, release)
    step = fx.Static(
        until=fx.Time(1.0), stepping="increment", initial=0.1, minimum=1e-6, maximum=0.1
    )
    round_trip(tmp_path / "a.inp", one, [step])


@pytest.mark.parametrize(
    "mesh, model",
    [
        (lambda: dcb_2d(dx=5.0, ny=1, order=2), fx.PlaneStress(20.0)),
        (lambda: dcb_2d(dx=5.0, ny=1, cell="triangle", order=2), fx.PlaneStrain(20.0)),
        (lambda: dcb_3d(length=60.0, dx=5.0, dy=10.0, ny=1), fx.Solid()),
    ],
)
def test_second_order_and_solid_elements(tmp_path, mesh, model):
    step = fx.Static(
        until=fx.Time(0.5), stepping="increment", initial=0.1, minimum=1e-6, maximum=0.25
    )
    held = [fx.Displacement("far_upper", z=0.0), fx.Displacement("far_lower", z=0.0)]
    supports = PINS + (held if isinstance(model, fx.Solid) else [])
    one = scene(mesh(), release=fx.StepRelease(), model=model, supports=supports)
    round_trip(tmp_path / "a.inp", one, [step])


def test_a_default_that_a_deck_does_not_have_is_said(tmp_path, caplog):
    mesh = dcb_3d(length=60.0, dx=10.0, dy=20.0, ny=1)
    for release, said in ((fx.StepRelease(), 0), (None, 1)):
        one = scene(mesh, release=release, model=fx.Solid())
        fx.write_deck(one, [INCREMENTS], tmp_path / "a.inp")
        assert caplog.text.count("released progressively by default") == said
        assert fx.read_deck(tmp_path / "a.inp").scene.debonds[0].release == fx.StepRelease()
    turn = fx.Amplitude((0.0, 0.5, 1.0), (0.1, 1.0, 0.1))
    second_order = dcb_3d(length=60.0, dx=20.0, dy=20.0, ny=1, order=2)
    for grid, partial, said in ((mesh, False, 0), (second_order, None, 0), (mesh, None, 1)):
        paris = fx.Paris(10.0, -1.0, 1e-3, 2.0, 0.01, 0.95)
        one = scene(
            grid, fx.Fatigue(GIc=0.5, paris=paris, partial=partial), model=fx.Solid(),
            loads=[fx.PointForce("pin_top", (0.0, 20.0, 0.0), turn)],
            supports=[fx.Displacement("far_upper", x=0.0, y=0.0, z=0.0),
                      fx.Displacement("far_lower", x=0.0, y=0.0, z=0.0)],
        )  # fmt: skip
        fx.write_deck(one, [fx.Cycles(period=(0.0, 1.0), n_max=500.0)], tmp_path / "b.inp")
        assert caplog.text.count("grows in part by default") == said
        assert fx.read_deck(tmp_path / "b.inp").scene.debonds[0].criterion.partial is False
    with pytest.raises(fx.InputError, match="the release law Progressive"):
        one = scene(mesh, release=fx.ProgressiveRelease(), model=fx.Solid())
        fx.write_deck(one, [INCREMENTS], tmp_path / "a.inp")


def test_cycles_loads_and_materials(tmp_path):
    paris = fx.Paris(c1=10.0, c2=-1.0, c3=0.5, c4=2.0, r1=0.01, r2=0.9)
    turn = fx.Amplitude((0.0, 0.5, 1.0), (0.1, 1.0, 0.1))
    ply = fx.Orthotropic((139e3, 10e3, 10e3), (0.3, 0.3, 0.4), (5e3, 5e3, 3.5e3), density=1.6e-9)
    one = scene(
        dcb_2d(dx=2.5, ny=1),
        fx.Fatigue(GIc=0.5, GIIc=0.5, mix=fx.BK(2.0), paris=paris),
        materials={"upper": ply, "lower": fx.Isotropic(70e3, 0.3, expansion=1e-5)},
        supports=[fx.Displacement("far_upper", x=0.0, y=0.0),
                  fx.Displacement("far_lower", x=0.0, y=0.0)],
        loads=[fx.PointForce("pin_top", (0.5, 20.0), turn), fx.Pressure("top", 0.01, turn),
               fx.PointForce("pin_bottom", (0.0, -20.0), turn, name="low"),
               fx.Traction("bottom", (0.0, -0.01), turn),
               fx.BodyForce((0.0, 1e-4), "lower", turn, name="lower.BY")],
    )  # fmt: skip
    step = fx.Cycles(period=(0.0, 1.0), n_max=500.0)
    round_trip(tmp_path / "a.inp", one, [step])


def test_large_rotations_friction_and_ties(tmp_path):
    one = scene(
        dcb_2d(dx=5.0, ny=1),
        interface={"friction": 0.3, "gap": "keep"},
        effects=[],
    )
    step = fx.Static(
        until=fx.Time(0.5), stepping="increment", initial=0.25, minimum=1e-6, maximum=0.25
    )
    round_trip(tmp_path / "a.inp", one, [step])
    bond = fx.Interface(
        slave="upper_face", master="lower_face", bonded=lambda x: x[0] > -1, tolerance=0.7
    )
    tied = fx.Scene(
        dcb_2d(dx=5.0, ny=1), materials=STEEL, model=fx.PlaneStrain(20.0), supports=PINS,
        bonds=[bond], effects=[fx.FiniteStrain()],
    )  # fmt: skip
    # Newton's method ends at another residual after another numbering of the unknowns
    deck = round_trip(tmp_path / "b.inp", tied, [step], rel=1e-9)
    # without it nodes beyond a tenth of the elements would be free
    assert deck.scene.input.bonds[0].tolerance == pytest.approx(0.7, rel=1e-5)


@pytest.mark.parametrize(
    "change, words",
    [
        ({"step": fx.Static(until=fx.Time(1.0))}, "stepping='event'"),
        ({"step": fx.Static(until=fx.Releases(1), stepping="increment")}, "end at a Time alone"),
        ({"step": fx.Cycles(maximum=1.0, ratio=0.1)}, "without a period that begins at time 0"),
        ({"criterion": fx.VCCT(0.2, method="closure")}, "method='closure'"),
        ({"release": fx.ProgressiveRelease()}, "the release law ProgressiveRelease"),
        (
            {"criterion": fx.EnhancedVCCT(GIc=lambda x: 0.2 + 0.0 * x[0], GIc_p=0.1)},
            "toughness of EnhancedVCCT as a function",
        ),
        ({"supports": [fx.Coupling("end_upper", (0.0, 0.0), x=1.0, mean=True)]}, "mean motion"),
        (
            {"supports": [fx.Equation((("pin_top", "x", 1.0), ("pin_bottom", "x", 1.0)), 1.0)]},
            "equation 'pin_top' with a value",
        ),
        (
            {
                "criterion": fx.Fatigue(
                    GIc=2.0, paris=fx.Paris(10.0, -1.0, 1e-3, 2.0, 0.01, 0.95), partial=True
                ),
                "step": fx.Cycles(period=(0.0, 1.0), n_max=500.0),
            },
            "partial=True",
        ),
        ({"supports": [*PINS, fx.Displacement("far_upper", y=lambda x: x[0])]}, "of position"),
        ({"loads": [fx.Pressure("top", 1.0, follows=True)]}, "follows=True"),
        (
            {"loads": [fx.Pressure("bond", 1.0, name="fluid", follows_crack=True)]},
            "pressure 'fluid' with follows_crack",
        ),
        ({"loads": [fx.Pressure("top", lambda x: x[0])]}, "as a function of position"),
        ({"effects": [fx.Temperature(20.0)]}, "the effect Temperature"),
        ({"order": 2}, "a displacement of order 2 on elements of order 1"),
        ({"materials": fx.Plastic(7e4, 0.3, yield_stress=1e3, hardening=5.0)}, "after its last"),
    ],
)
def test_what_a_deck_has_no_word_for(tmp_path, change, words):
    step = change.pop("step", INCREMENTS)
    one = scene(dcb_2d(dx=5.0, ny=1), **change)
    with pytest.raises(fx.InputError, match=words):
        fx.write_deck(one, [step], tmp_path / "a.inp")
    assert not (tmp_path / "a.inp").exists()


def test_wrong_arguments(tmp_path):
    one = scene(dcb_2d(dx=10.0, ny=1))
    with pytest.raises(fx.InputError, match="write_deck: scene is"):
        fx.write_deck(None, [INCREMENTS], tmp_path / "a.inp")
    with pytest.raises(fx.InputError, match="write_deck: steps must be a list"):
        fx.write_deck(one, INCREMENTS, tmp_path / "a.inp")
    with pytest.raises(fx.InputError, match="with_usual_names: history is"):
        fx.with_usual_names(None)
    for path, order in ((None, None), (tmp_path / "no.inp", None), (tmp_path, 3)):
        with pytest.raises(fx.InputError):
            fx.read_deck(path, order=order)


@pytest.mark.mpi
@pytest.mark.three
def test_the_deck_does_not_depend_on_the_number_of_ranks(comm, shared_path):
    one = scene(dcb_2d(comm, dx=10.0, ny=1, order=2))
    fx.write_deck(one, [INCREMENTS], shared_path / "a.inp")
    one.close()
    if comm.rank == 0:
        text = (shared_path / "a.inp").read_text()
        # 10 elements an arm: 3 rows of nodes, of which the centre ones are left out
        assert text.count("TYPE=CPE8") == 1
        assert len(text.split("*ELEMENT")[0].split("\n")) == 4 + 2 * (2 * 21 + 11)
        assert '*SURFACE, TYPE=ELEMENT, NAME="bond"' in text
        first = text.split("*ELEMENT")[1].split("\n")[1].split(",")
        assert len(first) == 9 and first[0] == "1"


@pytest.mark.parametrize("pairing", ["node-to-surface", "surface-to-surface"])
def test_couplings_equations_and_pairing(tmp_path, pairing):
    """Load blocks with hinges, a symmetric motion of the far end, TYPE of the contact pair."""
    supports = [
        fx.Coupling("end_upper", (0.0, 0.75), x=0.0, name="block"),
        fx.Coupling("end_upper", (0.0, 0.75), y=1.0, name="block",
                    amplitude=fx.Amplitude((0.0, 2.0), (0.0, 2.0))),
        fx.Displacement("pin_bottom", x=0.0),
        fx.Equation((("pin_bottom", "y", 1.0), ("pin_top", "y", 1.0))),
    ]  # fmt: skip
    mesh = dcb_2d(dx=2.0, ny=1)
    one = scene(mesh, supports=supports, interface={"pairing": pairing})
    deck = round_trip(tmp_path / "out.inp", one, [INCREMENTS], rel=1e-9)
    assert any(isinstance(s, fx.Coupling) for s in deck.scene.input.supports)
    assert deck.scene.debonds[0].interface.pairing == pairing
