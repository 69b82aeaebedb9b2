"""Small scenes, gathered matrices and comparisons that several test files use."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc

import fxcrack as fx
from fxcrack.demos import thermal_bilayer
from fxcrack.history import Row
from fxcrack.interface.surface import FacetSurface, facet_element
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.enf import enf_2d

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

STEEL = fx.Isotropic(70e3, 0.3)  # the bench problem's, whatever its name
PINS = (
    fx.Displacement("pin_top", x=0.0, y=1.0),
    fx.Displacement("pin_bottom", x=0.0, y=-1.0),
)
FORCES = (fx.PointForce("pin_top", (0.0, 1.0)), fx.PointForce("pin_bottom", (0.0, -1.0)))
HELD_FAR = (
    fx.Displacement("far_upper", x=0.0, y=0.0),
    fx.Displacement("far_lower", x=0.0, y=0.0),
)
PARIS = fx.Paris(c1=50.0, c2=-2.0, c3=0.5, c4=4.0, r1=0.2, r2=0.9)
GROWS = ("cycle", "release", "unstable")
HALF_OPENING = 1.0  # of each arm; G = 0.26 at a = 30
CLAMPED_3D = (
    fx.Displacement("far_upper", x=0.0, y=0.0, z=0.0),
    fx.Displacement("far_lower", x=0.0, y=0.0, z=0.0),
    fx.Displacement("end_upper", y=0.5),
    fx.Displacement("end_lower", y=-0.5),
)


def bond(a0: float, **options: Any) -> fx.Interface:
    """The interface of the specimens, open up to x = a0."""
    return fx.Interface(
        slave="upper_face",
        master="lower_face",
        bonded=lambda x: x[0] >= a0 - 1e-9,
        name="bond",
        **options,
    )


def specimen(
    mesh: fx.Mesh,
    *,
    a0: float = 30.0,
    criterion: Any = None,
    release: Any = None,
    temperature: Any = None,
    model: Any = None,
    materials: Any = STEEL,
    supports: Sequence[fx.Displacement] | None = None,
    contact: bool = False,
    interface: fx.Interface | None = None,
    **scene: Any,
) -> fx.Scene:
    """A scene with one debond, a double cantilever beam unless told otherwise."""
    if supports is None:
        supports = PINS if mesh.gdim == 2 else CLAMPED_3D
    if model is None:
        model = fx.PlaneStrain() if mesh.gdim == 2 else fx.Solid()
    debond = fx.Debond(
        interface or bond(a0, contact=contact),
        criterion or fx.VCCT(GIc=0.2),
        release or fx.StepRelease(),
        temperature=temperature,
    )
    return fx.Scene(
        mesh,
        materials=materials,
        model=model,
        supports=supports,
        debonds=[debond],
        **scene,
    )


def dcb(comm: MPI.Intracomm, *, dx: float = 0.5, ny: int = 4, **options: Any) -> fx.Scene:
    """The bench problem of docs/reference-values.md."""
    return specimen(dcb_2d(comm, dx=dx, ny=ny), **options)


def dcb3(
    comm: MPI.Intracomm, *, dx: float = 1.0, dy: float = 2.0, ny: int = 2, **options: Any
) -> fx.Scene:
    """The bench problem in 3-D."""
    return specimen(dcb_3d(comm, dx=dx, dy=dy, ny=ny), **options)


def interface_of(scene: fx.Scene) -> fx.Interface:
    """The interface of the only debond."""
    (debond,) = scene.debonds
    return debond.interface


def grow_to(scene: fx.Scene, length: float, **controls: Any) -> fx.History:
    """Run until the crack has a length."""
    return scene.run(fx.Static(until=fx.CrackLength(interface_of(scene), length), **controls))


def fatigue_law(**options: Any) -> fx.Fatigue:
    """A fatigue criterion under which the specimen below grows from a = 30 to about 40."""
    return fx.Fatigue(**({"GIc": 0.4, "paris": PARIS} | options))


def fatigue_specimen(
    comm: MPI.Intracomm = MPI.COMM_WORLD, criterion: Any = None, **options: Any
) -> fx.Scene:
    """The bench specimen, coarse, to be fatigued."""
    return dcb(comm, dx=1.0, ny=2, criterion=criterion or fatigue_law(), **options)


def fatigue_enf(
    comm: MPI.Intracomm = MPI.COMM_WORLD,
    *,
    a0: float,
    dx: float,
    GIc: float = 10.0,
    friction: float | None = None,
    **options: Any,
) -> fx.Scene:
    """End-notched flexure with contact, to be pressed to and fro."""
    debond = fx.Debond(bond(a0, contact=True, friction=friction), fatigue_law(GIc=GIc))
    return fx.Scene(
        enf_2d(comm, half_span=50.0, height=2.25, dx=dx, ny=2),
        materials=STEEL,
        model=fx.PlaneStress(thickness=25.0),
        supports=[
            fx.Displacement("support_left", y=0.0),
            fx.Displacement("support_right", x=0.0, y=0.0),
            fx.Displacement("load", y=-1.0),
        ],
        debonds=[debond],
        **options,
    )


def fatigue_bilayer(temperature: fx.Temperature, **options: Any) -> fx.Scene:
    """Two layers that part as they cool, four of their thicknesses apart already."""
    growth = fx.Paris(0.0, -1.0, 1e-2, 3.0, 0.0, 0.99)
    return fx.Scene(
        thermal_bilayer.layers(0.5),
        materials={"upper": thermal_bilayer.UPPER, "lower": thermal_bilayer.LOWER},
        model=fx.PlaneStrain(),
        supports=[
            fx.Displacement("middle_upper", x=0.0),
            fx.Displacement("middle_lower", x=0.0),
            fx.Displacement("foot", y=0.0),
        ],
        debonds=[fx.Debond(bond(4.0), fx.Fatigue(GIc=10.0, paris=growth, method="closure"))],
        effects=[temperature],
        **options,
    )


def until_length(scene: fx.Scene, length: float) -> fx.CrackLength:
    """End of a step at a length of the only crack."""
    return fx.CrackLength(interface_of(scene), length)


def growth_curve(history: fx.History, name: str = "bond") -> tuple[Array, Array]:
    """Crack lengths and the cycles at which they are reached."""
    rows = [r for r in history if r["event"] in GROWS]
    return column(rows, f"a[{name}]"), column(rows, "N")


def time_of(curve: fx.CrackLengthVsTime, length: float) -> float:
    """First time at which a curve reaches a length; infinite when it never does."""
    if length > curve.lengths[-1]:
        return np.inf
    i = int(np.searchsorted(curve.lengths, length, side="left"))
    near = slice(max(i - 1, 0), i + 1)
    return float(np.interp(length, curve.lengths[near], curve.times[near]))


def onsets(history: fx.History) -> list[Row]:
    """Rows at which the criterion was reached."""
    return [row for row in history if row["event"] in ("onset", "unstable")]


def column(rows: Sequence[Row], name: str) -> Array:
    """One column of some rows."""
    return np.array([row[name] for row in rows], dtype=float)


def largest_imbalance(history: fx.History) -> float:
    """Largest energy imbalance over the largest work done."""
    return float(np.abs(history["balance"]).max() / np.abs(history["external_work"]).max())


def assert_same(one: fx.History, other: fx.History, rtol: float, **atol: float) -> None:
    """Same events, same nodes; each column equal to rtol of its largest value."""
    assert one.reason == other.reason
    assert [r["event"] for r in one] == [r["event"] for r in other]
    assert set(one.columns) == set(other.columns)
    scale = {
        kind: max(
            np.nanmax(np.abs(one[c].astype(float)), initial=0.0)
            for c in one.columns
            if c != "event" and c.split("[")[0] == kind
        )
        for kind in {c.split("[")[0] for c in one.columns if c != "event"}
    }
    # reactions of components that carry nothing, modes that are absent: by the others' size
    rates = ("GI", "GII", "GIII")
    scale |= dict.fromkeys(rates, max(scale.get(mode, 0.0) for mode in rates))
    for energy in ("balance", "released_energy", "snap_energy"):
        scale[energy] = scale["external_work"]
    for name in one.columns:
        if name == "event":
            continue
        kind = name.split("[")[0]
        a, b = one[name].astype(float), other[name].astype(float)
        assert np.array_equal(np.isnan(a), np.isnan(b)), name
        if kind in ("node", "released"):
            assert np.array_equal(a, b, equal_nan=True), name
        else:
            off = np.nanmax(np.abs(a - b), initial=0.0)
            assert off <= atol.get(kind, rtol * scale[kind]), (name, off, scale[kind])


def gathered(matrix: PETSc.Mat) -> sp.csr_matrix:
    """A PETSc matrix whole on every rank."""
    indptr, indices, data = matrix.getValuesCSR()
    mine = sp.csr_matrix((data, indices, indptr), shape=(len(indptr) - 1, matrix.getSize()[1]))
    return sp.vstack(matrix.getComm().tompi4py().allgather(mine)).tocsr()


def gathered_vector(vector: PETSc.Vec) -> Array:
    """A PETSc vector whole on every rank."""
    return np.concatenate(vector.getComm().tompi4py().allgather(vector.array.copy()))


def made_of(facets: Sequence[Array], kind: str, order: int, inner: Array) -> FacetSurface:
    """A surface of facets given by the positions of their nodes, each of shape (k, 3)."""
    points = np.concatenate(facets)
    _, first, inverse = np.unique(points.round(9), axis=0, return_index=True, return_inverse=True)
    x = points[first]
    return FacetSurface(
        name="test",
        kind=kind,
        order=order,
        dofs=np.arange(len(x)),
        x=x,
        facets=inverse.reshape(len(facets), -1),
        inner=inner,
        breadth=np.ones(len(x)),
    )


def tensor_surface(kind: str, order: int, *axes: npt.ArrayLike, warp: Any = None) -> FacetSurface:
    """Facets over a grid in the plane y = 0 (x and z axes; x alone for "interval").

    Bodies lie below; ``warp`` maps node positions, shape (n, 3) to (n, 3).
    """
    nodes = np.asarray(facet_element(kind, order).points)
    grids = [np.asarray(a, dtype=float) for a in axes]
    facets = []
    if kind == "interval":
        for a, b in zip(grids[0][:-1], grids[0][1:], strict=True):
            facets.append(np.pad(a + nodes * (b - a), ((0, 0), (0, 2))))
    else:
        for a, b in zip(grids[0][:-1], grids[0][1:], strict=True):
            for c, d in zip(grids[1][:-1], grids[1][1:], strict=True):
                corner = np.array([[a, c], [b, c], [a, d], [b, d]])
                boxes = [corner] if kind == "quadrilateral" else [corner[:3], corner[[3, 2, 1]]]
                for box in boxes:
                    flat = box[0] + nodes @ np.array([box[1] - box[0], box[2] - box[0]])
                    facets.append(np.stack([flat[:, 0], np.zeros(len(flat)), flat[:, 1]], axis=1))
    if warp is not None:
        facets = [warp(f) for f in facets]
    inner = np.array([f.mean(axis=0) - [0.0, 1.0, 0.0] for f in facets])
    return made_of(facets, kind, order, inner)
