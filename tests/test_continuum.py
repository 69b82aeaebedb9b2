"""Materials, kinematic models, loads: against Hooke's law by hand and exact solutions."""

from __future__ import annotations

from fxcrack.base import compat  # noqa: F401  isort: skip  (orders MPI before DOLFINx)
import dolfinx.fem
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from specimens import gathered, gathered_vector

import fxcrack as fx
from fxcrack.base.errors import InputError
from fxcrack.condensation.bordered_matrix import load_and_monitor_vectors
from fxcrack.continuum.amplitudes import constant
from fxcrack.continuum.continuum import Continuum
from fxcrack.continuum.load_vectors import load_vector
from fxcrack.continuum.loads import Load
from fxcrack.continuum.materials import strain_rotation
from fxcrack.continuum.stress import cell_stress, von_mises
from fxcrack.mesh import Mesh
from fxcrack.meshes.dcb import dcb_2d, dcb_3d
from fxcrack.meshes.penny import penny

Array = npt.NDArray[np.float64]

ROUND_OFF = 1e-12

CARBON = dict(E=(139.4e3, 10.16e3, 9.0e3), nu=(0.30, 0.25, 0.436), G=(4.6e3, 5.0e3, 3.54e3))


def rotation(a: float, b: float, c: float) -> Array:
    """Rows are the axes of a frame turned about z, x and z again."""

    def about(axis: int, angle: float) -> Array:
        i, j = [k for k in range(3) if k != axis]
        out = np.eye(3)
        out[i, i] = out[j, j] = np.cos(angle)
        out[i, j], out[j, i] = np.sin(angle), -np.sin(angle)
        return out

    return about(2, c) @ about(0, b) @ about(2, a)


# -- materials -------------------------------------------------------------------------------------


def test_isotropic_constants() -> None:
    c = fx.Isotropic(E=200.0, nu=0.25).stiffness()
    # lambda = mu = 80
    assert c[:3, :3] == pytest.approx(80.0 * (np.ones((3, 3)) + 2.0 * np.eye(3)), rel=ROUND_OFF)
    assert np.diag(c)[3:] == pytest.approx([80.0] * 3, rel=ROUND_OFF)
    stress = c @ np.linalg.solve(c, [1.0, 0, 0, 0, 0, 0])
    assert np.linalg.solve(c, [1.0, 0, 0, 0, 0, 0]) == pytest.approx(
        [1 / 200, -0.25 / 200, -0.25 / 200, 0, 0, 0], abs=ROUND_OFF
    )
    assert stress[0] == pytest.approx(1.0)


@settings(max_examples=30)
@given(*[st.floats(-3.0, 3.0)] * 3, st.floats(-0.9, 0.45))
def test_orthotropic_with_equal_constants_is_isotropic_in_any_frame(
    a: float, b: float, c: float, nu: float
) -> None:
    axes = rotation(a, b, c)
    same = fx.Orthotropic(
        E=(70.0,) * 3, nu=(nu,) * 3, G=(70.0 / (2.0 + 2.0 * nu),) * 3, frame=(axes[0], axes[1])
    )
    expected = fx.Isotropic(70.0, nu).stiffness()
    assert same.stiffness() == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())


def test_orthotropic_constants() -> None:
    """The compliance read back: moduli, the three ratios and their symmetric partners."""
    s = np.linalg.inv(fx.Orthotropic(**CARBON).stiffness())
    e, nu, g = (np.array(CARBON[k]) for k in ("E", "nu", "G"))
    assert 1.0 / np.diag(s)[:3] == pytest.approx(e, rel=1e-10)
    assert 1.0 / np.diag(s)[3:] == pytest.approx(g[::-1], rel=1e-10)  # 23, 13, 12
    for (i, j), ratio in zip(((0, 1), (0, 2), (1, 2)), nu, strict=True):
        assert -s[j, i] * e[i] == pytest.approx(ratio, rel=1e-10)
        assert -s[i, j] * e[j] == pytest.approx(ratio * e[j] / e[i], rel=1e-10)


@settings(max_examples=30)
@given(*[st.floats(-3.0, 3.0)] * 3)
def test_rotation_keeps_energy(a: float, b: float, c: float) -> None:
    """Strain energy of a strain turned with the material; engineering shears on both sides."""
    axes = rotation(a, b, c)
    turned = fx.Orthotropic(**CARBON, frame=(axes[0], axes[1])).stiffness()
    plain = fx.Orthotropic(**CARBON).stiffness()
    rng = np.random.default_rng(0)
    tensor = rng.standard_normal((3, 3))
    tensor += tensor.T
    local = axes @ tensor @ axes.T

    def voigt(t: Array) -> Array:
        return np.array([t[0, 0], t[1, 1], t[2, 2], 2 * t[1, 2], 2 * t[0, 2], 2 * t[0, 1]])

    assert strain_rotation(axes) @ voigt(tensor) == pytest.approx(voigt(local), abs=ROUND_OFF)
    energy = voigt(local) @ plain @ voigt(local)
    assert voigt(tensor) @ turned @ voigt(tensor) == pytest.approx(energy, rel=1e-10)
    # the second vector only has to lie in the plane of axes 1 and 2
    other = fx.Orthotropic(**CARBON, frame=(2.0 * axes[0], 0.3 * axes[0] + 5.0 * axes[1]))
    assert other.stiffness() == pytest.approx(turned, abs=1e-10 * 139.4e3)


def test_quarter_turn() -> None:
    """Fibres along y."""
    turned = fx.Orthotropic(**CARBON, frame=((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))).stiffness()
    plain = fx.Orthotropic(**CARBON).stiffness()
    swap = [1, 0, 2, 4, 3, 5]
    assert turned == pytest.approx(plain[np.ix_(swap, swap)], abs=1e-10 * 139.4e3)


def test_plane_models() -> None:
    e, nu = 210.0, 0.3
    c = fx.Isotropic(e, nu).stiffness()
    stress = fx.PlaneStress().reduce(c)
    assert stress == pytest.approx(
        e / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]]), abs=1e-11 * e
    )
    strain = fx.PlaneStrain().reduce(c)
    assert strain == pytest.approx(
        e / ((1 + nu) * (1 - 2 * nu))
        * np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, (1 - 2 * nu) / 2]]),
        abs=1e-11 * e,
    )  # fmt: skip
    # orthotropic: moduli in the plane, whatever happens across it
    s = np.linalg.inv(fx.PlaneStress().reduce(fx.Orthotropic(**CARBON).stiffness()))
    assert 1.0 / np.diag(s) == pytest.approx([139.4e3, 10.16e3, 4.6e3], rel=1e-10)
    ring = fx.Axisymmetric().reduce(c)
    assert ring[:3, :3] == pytest.approx(c[:3, :3]) and ring[3, 3] == c[5, 5]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fx.Isotropic(0.0, 0.3), "E = 0.0 must be positive"),
        (lambda: fx.Isotropic(np.nan, 0.3), "E = nan must be positive"),
        (lambda: fx.Isotropic(1.0, 0.5), "nu = 0.5 must lie between -1 and 0.5"),
        (lambda: fx.Orthotropic(**CARBON | {"G": (1.0, -1.0, 1.0)}), "must be positive"),
        (lambda: fx.Orthotropic(**CARBON | {"nu": (5.0, 0.3, 0.3)}), "is no stable material"),
        (
            lambda: fx.Orthotropic(**CARBON, frame=((1.0, 0.0, 0.0), (-2.0, 0.0, 0.0))),
            "are parallel",
        ),
        (lambda: fx.PlaneStrain(thickness=0.0), "PlaneStrain: thickness = 0.0 is not positive"),
    ],
)
def test_impossible_materials(make: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        make()


# -- amplitudes ------------------------------------------------------------------------------------


def test_amplitude() -> None:
    a = fx.Amplitude((0.0, 1.0, 3.0), (0.0, 2.0, 1.0))
    assert [a(t) for t in (-1.0, 0.5, 1.0, 2.0, 9.0)] == [0.0, 1.0, 2.0, 1.5, 1.0]
    assert a.breaks() == (0.0, 1.0, 3.0) and fx.Ramp().breaks() == ()
    assert fx.Ramp()(2.5) == 2.5 and constant(3.0)(7.0) == 3.0


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ((0.0, 1.0), (1.0,), "2 times but 1 values"),
        ((), (), "at least one"),
        ((0.0, 0.0), (0.0, 1.0), "must increase"),
        ((0.0, np.inf), (0.0, 1.0), "must be finite"),
    ],
)
def test_impossible_amplitudes(
    times: tuple[float, ...], values: tuple[float, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        fx.Amplitude(times, values)


# -- loads -----------------------------------------------------------------------------------------

MODELS = {"plane": fx.PlaneStrain(thickness=2.0), "ring": fx.Axisymmetric(), "solid": fx.Solid()}


def body(comm: MPI.Intracomm, name: str) -> Continuum:
    if name == "plane":
        mesh = dcb_2d(comm, length=4.0, dx=0.5, ny=2, cell="triangle")
    elif name == "ring":
        mesh = penny(comm, a=1.0, radius=4.0, half_height=3.0, dr=0.5, order=2)
    else:
        mesh = dcb_3d(comm, length=4.0, width=2.0, dx=1.0, dy=0.5, ny=1)
    return Continuum(mesh, fx.Isotropic(1e3, 0.3), MODELS[name])


def totals(continuum: Continuum, load: Load) -> Array:
    """Resultant force and, in the last place, the moment of the x, y components about z."""
    vector = load_vector(continuum, load)
    f = gathered_vector(vector).reshape(-1, continuum.gdim)
    vector.destroy()
    n = continuum.n_local // continuum.gdim
    x = np.concatenate(continuum.comm.allgather(continuum.positions()[:n]))
    return np.append(f.sum(axis=0), x[:, 0] @ f[:, 1] - x[:, 1] @ f[:, 0])


PI = np.pi
# areas: plane 4 x 2; ring 16 pi; solid 4 x 2.  Volumes of one half: 12, 48 pi, 12.
LOADS: list[tuple[str, Load, tuple[float, ...]]] = [
    ("plane", fx.Traction("top", (0.5, -1.0)), (4.0, -8.0, -16.0 - 4.0 * 1.5)),
    ("plane", fx.Pressure("upper_face", 2.0), (0.0, 16.0, 32.0)),
    # functions are interpolated, so a linear one is integrated exactly: 2 int x dx, 2 int x^2 dx
    ("plane", fx.Traction("bottom", (0.0, lambda x: x[0])), (0.0, 16.0, 128.0 / 3.0)),
    ("plane", fx.BodyForce((1.0, 3.0), where="upper"), (12.0, 36.0, 72.0 - 9.0)),
    ("plane", fx.BodyForce((0.0, 1.0)), (0.0, 24.0, 48.0)),
    ("plane", fx.PointForce("pin_top", (3.0, 1.0)), (3.0, 1.0, -4.5)),
    ("ring", fx.Pressure("top", 1.0), (0.0, -16.0 * PI)),
    # a step at r = 1, a node: exact
    ("ring", fx.Pressure("lower_face", lambda x: 1.0 * (x[0] < 1.0)), (0.0, -PI)),
    ("ring", fx.Traction("outer", (0.0, 1.0)), (0.0, 48.0 * PI)),
    ("ring", fx.BodyForce((0.0, 2.0), where="lower"), (0.0, 96.0 * PI)),
    ("solid", fx.Traction("top", (1.0, 2.0, 3.0)), (8.0, 16.0, 24.0)),
    ("solid", fx.Pressure("side_w", 1.0), (0.0, 0.0, -12.0)),
    ("solid", fx.BodyForce((0.0, 0.0, 1.0)), (0.0, 0.0, 24.0)),
    ("solid", fx.PointForce("pin_top", (0.0, 5.0, 0.0)), (0.0, 5.0, 0.0)),
]


@pytest.mark.quick("plane")
@pytest.mark.mpi
@pytest.mark.parametrize("name", MODELS)
def test_resultants(comm: MPI.Intracomm, name: str) -> None:
    continuum = body(comm, name)
    for where, load, expected in LOADS:
        if where == name:
            found = totals(continuum, load)[: len(expected)]
            # a sum of a hundred nodal forces
            assert found == pytest.approx(expected, abs=1e-11 * 100.0), load


@pytest.mark.quick("solid")
@pytest.mark.mpi
@pytest.mark.parametrize("name", MODELS)
def test_stiffness(comm: MPI.Intracomm, name: str) -> None:
    """Symmetric, blind to rigid motions, and right for a uniform strain."""
    continuum = body(comm, name)
    matrix = continuum.stiffness()
    k = gathered(matrix)
    matrix.destroy()
    assert abs(k - k.T).max() < 1e-12 * abs(k).max()
    n = continuum.n_local // continuum.gdim
    x = np.concatenate(comm.allgather(continuum.positions()[:n]))[:, : continuum.gdim]
    for axis in range(continuum.gdim):
        if (name, axis) == ("ring", 0):
            continue  # a ring that grows is strained
        motion = np.zeros_like(x)
        motion[:, axis] = 1.0
        assert np.abs(k @ motion.ravel()).max() < 1e-10 * abs(k).max()
    stretched = np.zeros_like(x)
    stretched[:, 0] = 1e-3 * x[:, 0]
    # both halves: volume 24, 96 pi and 24; in a ring radius and hoop alike
    c = continuum.model.reduce(fx.Isotropic(1e3, 0.3).stiffness())
    strain = {"plane": [1, 0, 0], "ring": [1, 0, 1, 0], "solid": [1, 0, 0, 0, 0, 0]}[name]
    volume = 96.0 * PI if name == "ring" else 24.0
    energy = 0.5 * volume * 1e-6 * np.array(strain) @ c @ strain
    assert 0.5 * stretched.ravel() @ k @ stretched.ravel() == pytest.approx(energy, rel=1e-11)


@pytest.mark.mpi
def test_stress_of_a_uniform_strain(comm: MPI.Intracomm) -> None:
    """Two materials; cell averages; von Mises of uniaxial strain by hand."""
    mesh = dcb_2d(comm, length=4.0, dx=0.5, ny=2)
    parts = {"upper": fx.Isotropic(1e3, 0.3), "lower": fx.Isotropic(500.0, 0.2)}
    continuum = Continuum(mesh, parts, fx.PlaneStrain())
    u = dolfinx.fem.Function(continuum.space)
    u.interpolate(lambda x: np.stack([1e-3 * x[0], 0.0 * x[0]]))
    stress = cell_stress(continuum, u).x.array.reshape(-1, 4)
    mises = von_mises(continuum, cell_stress(continuum, u)).x.array
    for name, material in parts.items():
        cells = mesh.group(name).entities
        s = 1e-3 * material.stiffness()[[0, 1, 2, 5], 0]  # xx, yy, zz, xy
        assert stress[cells] == pytest.approx(np.tile(s, (len(cells), 1)), abs=1e-12)
        # two equal transverse stresses
        assert mises[cells] == pytest.approx(np.full(len(cells), s[0] - s[1]), rel=1e-10)


@pytest.mark.mpi
def test_what_does_not_fit(comm: MPI.Intracomm) -> None:
    plane, solid = body(comm, "plane"), body(comm, "solid")
    steel = fx.Isotropic(1e3, 0.3)

    def refused(message: str, make: object) -> None:
        with pytest.raises(InputError, match=message) as found:
            make()
        assert len(set(comm.allgather(str(found.value)))) == 1

    mesh: Mesh = plane.mesh
    refused("Solid needs a mesh of dimension 3", lambda: Continuum(mesh, steel, fx.Solid()))
    refused(
        "order = 3: only displacements of order 1 and 2",
        lambda: Continuum(mesh, steel, fx.PlaneStrain(), order=3),
    )
    refused(
        "materials cover .* not at all .* name every cell group exactly once",
        lambda: Continuum(mesh, {"upper": steel}, fx.PlaneStrain()),
    )
    refused("has no group 'middle'", lambda: load_vector(plane, fx.Traction("middle", (0.0, 1.0))))
    refused(
        "load 'top': 3 components given, 2 needed",
        lambda: load_vector(plane, fx.Traction("top", (0.0, 1.0, 0.0))),
    )
    refused(
        "load 'pin_top': 2 components given, 3 needed",
        lambda: load_vector(solid, fx.PointForce("pin_top", (0.0, 1.0))),
    )
    refused(
        r"Monitor\('u_top'\): direction has 2 components, 3 are needed",
        lambda: load_and_monitor_vectors(solid, [], [fx.Monitor("top", (0.0, 1.0))]),
    )
    refused("dimension 1 is needed here", lambda: load_vector(plane, fx.Pressure("pin_top", 1.0)))
