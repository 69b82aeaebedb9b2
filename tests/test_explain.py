"""What a scene says of itself, and that an effect which is not named is not there."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from specimens import PINS, bond, grow_to

import fxcrack as fx
from fxcrack.history import Details
from fxcrack.meshes.dcb import dcb_2d


def scene(material: Any, **more: Any) -> fx.Scene:
    """A small double cantilever beam."""
    contact = {k: more.pop(k) for k in ("contact", "friction") if k in more}
    return fx.Scene(
        dcb_2d(dx=4.0, ny=1),
        materials=material,
        model=fx.PlaneStrain(),
        supports=PINS,
        debonds=[fx.Debond(bond(30.0, **contact), fx.VCCT(GIc=0.2))],
        **more,
    )


ELASTIC = fx.Isotropic(70e3, 0.3, expansion=1e-5)
EFFECTS: dict[str, tuple[Any, dict[str, Any], str]] = {
    "contact": (ELASTIC, {"contact": True}, "contact of open faces"),
    "friction": (ELASTIC, {"contact": True, "friction": 0.3}, "Coulomb friction"),
    "temperature": (ELASTIC, {"effects": [fx.Temperature(1.0)]}, "temperature"),
    "finite strain": (ELASTIC, {"effects": [fx.FiniteStrain()]}, "finite strain"),
    "neo-Hookean": (fx.NeoHookean(70e3, 0.3), {}, "neo-Hookean"),
    "plasticity": (fx.Plastic(70e3, 0.3, yield_stress=40.0, hardening=1e3), {}, "plasticity"),
}


def test_a_bare_scene_has_one_term_one_factorisation_and_nothing_else() -> None:
    bare = scene(ELASTIC)
    grow_to(bare, 34.0)
    found = bare.explain()
    assert found.solver == "linear" and found.effects == ()
    assert found.counts == {"form terms": 1, "factorisations": 1}
    assert set(found.unknowns) == {"displacements", "retained jumps"}
    assert found.costs == {} and found.phases["factor_with_schur"] > 0.0


@pytest.mark.quick("temperature", "contact", "finite strain", "friction", "plasticity")
@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_adds_what_it_needs(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    material, more, words = EFFECTS[name]
    with_it, bare = scene(material, **more), scene(ELASTIC)
    for each in (with_it, bare):
        grow_to(each, 34.0)
    found, plain = with_it.explain(), bare.explain()
    assert any(words in e for e in found.effects)
    assert words in capsys.readouterr().out
    assert found.unknowns["displacements"] == plain.unknowns["displacements"]
    assert found.counts["form terms"] == 1
    if name in ("finite strain", "neo-Hookean", "plasticity"):
        assert found.solver == "newton" and found.counts["factorisations"] > 1
        assert sum(found.costs.values()) > 0.0
    else:
        assert found.solver == "linear" and found.counts["factorisations"] == 1
    # jumps that may touch or rub are retained; other effects add none
    extra = found.unknowns["retained jumps"] - plain.unknowns["retained jumps"]
    assert (extra > 0) == (name in ("contact", "friction"))
    assert ("contact nodes" in found.unknowns) == (name in ("contact", "friction"))
    assert ("friction nodes" in found.unknowns) == (name == "friction")
    assert ("remembered values" in found.unknowns) == (name == "plasticity")


def test_two_terms_where_two_effects_meet() -> None:
    moving = fx.Isotropic(70e3, 0.3, density=2.7e-9)
    both = scene(moving, effects=[fx.FiniteStrain(), fx.Inertia()])
    both.run(fx.Dynamic(until=fx.Time(2e-4), dt=1e-4))
    found = both.explain()
    assert found.counts["form terms"] == 2
    assert set(found.costs) == {"finite strain", "inertia"}


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"effects": [fx.FiniteStrain()], "solver": "linear"}, "needs linear bodies"),
        ({"effects": [fx.FiniteStrain(), fx.FiniteStrain()]}, "given twice"),
        ({"effects": ["wind"]}, "is not an effect"),
        ({"solver": "fast"}, "choose 'linear', 'newton' or None"),
    ],
)
def test_effects_that_cannot_be_are_refused(more: dict[str, Any], message: str) -> None:
    with pytest.raises(fx.InputError, match=message):
        scene(ELASTIC, **more)


def test_the_former_name_of_the_solver_still_works() -> None:
    for path, solver in (("condensed", "linear"), ("newton", "newton")):
        with pytest.warns(DeprecationWarning, match=r"now called Scene\(solver"):
            found = scene(ELASTIC, path=path).explain()
        assert found.solver == solver
        with pytest.warns(DeprecationWarning, match=r"now called Explanation\.solver"):
            assert found.path == path
    with pytest.raises(fx.InputError, match="give solver alone"), pytest.warns(DeprecationWarning):
        scene(ELASTIC, path="newton", solver="newton")


def test_the_former_name_of_the_retained_jumps_still_works() -> None:
    with pytest.warns(DeprecationWarning, match="now called retained_mb"):
        options = fx.CondensedOptions(window_mb=3.0)
    assert options == fx.CondensedOptions("auto", 3.0)
    assert dataclasses.replace(options, rows=1.0) == fx.CondensedOptions(retained_mb=3.0, rows=1.0)
    with pytest.warns(DeprecationWarning, match="now called retained_mb"):
        assert options.window_mb == 3.0
    details = Details(retained=7)
    with pytest.warns(DeprecationWarning, match=r"now called details\['retained'\]"):
        assert details["window"] == 7
    with pytest.warns(DeprecationWarning, match=r"now called details\['retained'\]"):
        assert details.get("window") == 7
    assert details.get("retained") == 7
    assert details.get("dofs", 3) == 3
    with pytest.raises(KeyError, match="dofs"):
        details["dofs"]


def test_plasticity_and_finite_strain_exclude_each_other() -> None:
    plastic = fx.Plastic(70e3, 0.3, yield_stress=500.0, hardening=1e3)
    with pytest.raises(fx.InputError, match="small strain"):
        scene(plastic, effects=[fx.FiniteStrain()])
