"""The arguments of a scene as data, and the analysis that is composed of them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fxcrack.base import log
from fxcrack.base.checks import (
    check_amplitudes,
    check_instance,
    check_list,
    list_of,
    shown,
    text,
    warn_of_same_titles,
)
from fxcrack.base.errors import InputError
from fxcrack.condensation.options import CondensedOptions
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.couplings import Constraint, Coupling, Equation
from fxcrack.continuum.foundation import Foundation, Stabilise, check_stabilise
from fxcrack.continuum.generalised_plane_strain import GeneralisedPlaneStrain
from fxcrack.continuum.inertia import Inertia
from fxcrack.continuum.kinematics import (
    Axisymmetric,
    Model,
    PlaneStrain,
    PlaneStress,
    Shell,
    Solid,
)
from fxcrack.continuum.loads import (
    BodyForce,
    Displacement,
    Load,
    Moment,
    Monitor,
    PointForce,
    PointMoment,
    Pressure,
    Traction,
)
from fxcrack.continuum.materials import Material
from fxcrack.continuum.node_supports import Clamp, Rotation, Support, Symmetry
from fxcrack.continuum.section import Section
from fxcrack.continuum.shared_loads import shared_loads, shared_monitors
from fxcrack.continuum.shell_bodies import ShellBodies
from fxcrack.continuum.weak_form import WeakForm
from fxcrack.effects import crack_fluids, dead_loads, form_terms, is_finite, plan, temperature_of
from fxcrack.history import History
from fxcrack.interface.definition import Interface
from fxcrack.interface.locking import warn_of_locking
from fxcrack.interface.pairing import make_pair
from fxcrack.interface.supports import collect_supports
from fxcrack.mesh import Mesh
from fxcrack.solvers.base import Solver
from fxcrack.solvers.linear import LinearSolver
from fxcrack.solvers.newton import NewtonSolver
from fxcrack.solvers.options import NewtonOptions
from fxcrack.steps.analysis import Analysis, EnergyBalance
from fxcrack.steps.debond import Debond, check_friction


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneInput:
    """What a scene is made of, as data: a scene can be built from it again.

    Attributes as the arguments of :class:`Scene`.

    Raises:
        InputError: A part is of the wrong kind, or names are used twice.
    """

    mesh: Mesh
    materials: Material | Section | Mapping[str, Material] | Mapping[str, Section]
    model: Model | Shell
    supports: Sequence[Displacement | Support | Constraint] = ()
    loads: Sequence[Load] = ()
    debonds: Sequence[Debond] = ()
    bonds: Sequence[Interface] = ()
    monitors: Sequence[Monitor] = ()
    order: int | None = None
    options: CondensedOptions | None = None
    effects: Sequence[Any] = ()
    solver: str | None = None
    newton: NewtonOptions | None = None
    stabilise: Stabilise | None = None

    def __post_init__(self) -> None:
        """Check kinds and names."""
        check_instance("Scene", "mesh", self.mesh, Mesh, "read_mesh('mine.msh')")
        check_instance(
            "Scene",
            "model",
            self.model,
            (PlaneStrain, PlaneStress, GeneralisedPlaneStrain, Axisymmetric, Solid, Shell),
            "Solid()",
        )
        self._take_list("supports", (Displacement, Clamp, Symmetry, Rotation, Coupling, Equation))
        self._take_list("loads", (Traction, Pressure, BodyForce, PointForce, Moment, PointMoment))
        check_amplitudes([*self.supports, *self.loads])
        warn_of_same_titles("loads", self.loads)
        self._take_list("debonds", Debond)
        self._take_list("bonds", Interface)
        self._take_list("monitors", Monitor)
        warn_of_same_titles("monitors", self.monitors)
        if self.newton is not None:
            check_instance(
                "Scene", "newton", self.newton, NewtonOptions, "NewtonOptions(max_iterations=40)"
            )
        if self.options is not None:
            check_instance(
                "Scene", "options", self.options, CondensedOptions, "CondensedOptions(rows=2.0)"
            )
        if list_of(self.effects) is None:
            raise InputError(
                f"Scene: effects must be a list, not {type(self.effects).__name__}; write "
                "effects=[...]"
            )
        self._check_materials()
        text("Scene", "solver", self.solver, optional=True)
        if self.stabilise is not None:
            check_stabilise(self.stabilise)
        titles = [i.title for i in self.interfaces]
        for title in titles:
            if titles.count(title) > 1:
                raise InputError(
                    f"interface '{title}' appears twice; give one criterion per interface and "
                    "different names to different interfaces"
                )

    def _check_materials(self) -> None:
        """Check that each material is one, and each key of a dictionary a name."""
        listed: list[Any] = [self.materials]
        if isinstance(self.materials, Mapping):
            listed = list(self.materials.values())
            for name in self.materials:
                text("Scene: materials", "a cell group", name)
            if not self.materials:
                raise InputError("Scene: materials is empty; give one, e.g. Isotropic(70e3, 0.3)")
        for material in listed:
            if isinstance(material, type) or not hasattr(material, "stiffness"):
                raise InputError(
                    f"materials: {shown(material)} is not a material; give one, e.g. "
                    "Isotropic(E=70e3, nu=0.3), or one per cell group, {'name': Isotropic(...)}"
                )

    def _take_list(self, name: str, kinds: type | tuple[type, ...]) -> None:
        """Check a list of parts and keep a copy."""
        object.__setattr__(self, name, check_list("Scene", name, getattr(self, name), kinds))

    @property
    def interfaces(self) -> list[Interface]:
        """Those that may debond, then those that stay as they are."""
        return [d.interface for d in self.debonds] + list(self.bonds)


def solver_of_path(path: str, solver: str | None) -> str:
    """The solver that the former argument ``path`` asked for, with a warning."""
    warnings.warn(
        "Scene(path=...) is now called Scene(solver=...), with solver='linear' for "
        "path='condensed'; the former name will be removed",
        DeprecationWarning,
        stacklevel=3,
    )
    if solver is not None:
        raise InputError("Scene: path is the former name of solver; give solver alone")
    text("Scene", "path", path)
    return "linear" if path == "condensed" else path


def compose(given: SceneInput) -> Analysis:
    """The analysis of a scene; collective."""
    kind: Any = ShellBodies if isinstance(given.model, Shell) else Continuum
    continuum: Continuum = kind(
        given.mesh,
        given.materials,
        given.model,
        order=given.order,
        temperature=temperature_of(given.effects),
    )
    supports = collect_supports(continuum, list(given.supports))
    inertia = any(isinstance(e, Inertia) for e in given.effects)
    slides = is_finite(continuum, given.effects)
    pairs = [
        make_pair(
            continuum,
            one,
            others=[i for i in given.interfaces if i is not one],
            supported=supports.which,
            by_nodes=inertia or (one.contact and slides),
            cracks=any(d.interface is one for d in given.debonds),
        )
        for one in given.interfaces
    ]
    for debond in given.debonds:
        if debond.interface.bonded is None:  # a tie, which no criterion lets go, needs no tip
            log.warn(
                "interface '%s': no bonded set given; the whole pair is bonded and has no crack "
                "tip",
                debond.interface.title,
            )
    warn_of_locking(continuum, pairs[: len(given.debonds)])
    check_friction([d for d in given.debonds if d.criterion.softens], pairs)
    chosen = plan(continuum, given.effects, given.loads, given.interfaces, given.solver)
    loads = dead_loads(continuum, given.loads, chosen.solver, pairs, supports)
    loads = [*shared_loads(continuum), *loads]  # those of a temperature come last
    monitors: list[Any] = [*given.monitors, *shared_monitors(continuum)]
    parts = continuum, pairs, supports, loads, monitors
    foundation = None if given.stabilise is None else Foundation(continuum, given.stabilise)
    solver: Solver
    if chosen.solver == "linear":
        solver = LinearSolver(*parts, given.options or CondensedOptions(), foundation)
    else:
        terms = form_terms(continuum, given.effects, given.loads)
        terms += crack_fluids(continuum, given.effects, loads, pairs)
        solver = NewtonSolver(
            *parts,
            given.options or CondensedOptions(rows=0.0),
            bodies=WeakForm(continuum, terms + ([foundation] if foundation else [])),
            newton=given.newton or NewtonOptions(),
        )
    return Analysis(
        continuum,
        solver,
        list(given.debonds),
        chosen,
        list(given.effects),
        History(given.mesh.comm),
        EnergyBalance(),
        stabilise=given.stabilise,
    )


__all__ = ["SceneInput", "compose", "solver_of_path"]
