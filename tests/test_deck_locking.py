"""What is said of first-order elements that take the place of others which bend without locking."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from fxcrack.deck.deck import translated
from fxcrack.deck.thickness import Thickness, thickness_of
from tests.decks import PLATE, STEP, read, write
from tests.test_cli import run


def strip(kind, ny, nx, length=8.0, order=None):
    """Locking that is said of a strip of height 1 with nx by ny quadrilaterals or hexahedra."""
    xs, ys = np.linspace(0.0, length, nx + 1), np.linspace(0.0, 1.0, ny + 1)
    layers = 2 if kind.startswith("C3D") else 1
    x = [(a, b, 3.0 * k) for k in range(layers) for b in ys for a in xs]
    n = np.arange(1, len(x) + 1).reshape(layers, ny + 1, nx + 1)
    corners = [np.stack([m[:-1, :-1], m[:-1, 1:], m[1:, 1:], m[1:, :-1]], axis=-1) for m in n]
    cells = np.concatenate(corners, axis=-1).reshape(nx * ny, -1)
    text = "*NODE\n" + "".join(f"{i}, {a}, {b}, {c}\n" for i, (a, b, c) in enumerate(x, 1))
    text += f"*ELEMENT, TYPE={kind}, ELSET=PLATE\n"
    text += "".join(", ".join(map(str, (i, *row))) + "\n" for i, row in enumerate(cells, 1))
    return text + PLATE[PLATE.index("*SOLID SECTION") :]


@pytest.mark.parametrize("kind", ["CPE4R", "CPS4R", "CAX4R", "C3D8R", "CPE4I", "CPS4I", "C3D8I"])
def test_locking_of_the_elements_in_place_of_others_is_said_with_numbers(tmp_path, kind):
    text = strip(kind, 2, 16).replace("\n2.0\n", "\n" if kind[2] in "XD" else "\n2.0\n")
    path = write(tmp_path, text)
    (said,) = (line for line in translated(path, order=1).report.replaced if "lock" in line)
    # square elements, two over the thickness: (1/1.3 (1/0.7 + 1/2) - 1)/4
    assert f"in place of {kind} lock in bending" in said and "by about 12 %" in said
    assert "with 2 elements over the smallest dimension" in said and "1 times as long" in said
    assert "--order 2" in said
    raised = read(tmp_path, text)  # unasked, as they would be too stiff by 5 % or more
    (said,) = (line for line in raised.report.replaced if "lock" in line)
    assert "would be too stiff by about 12 %" in said and "--order 1" in said
    assert raised.raw.order == 2
    few = read(
        tmp_path, strip(kind, 4, 32).replace("\n2.0\n", "\n" if kind[2] in "XD" else "\n2.0\n")
    )
    assert few.raw.order == 1 and any("by about 3 %" in line for line in few.report.replaced)
    assert not [x for x in translated(path, order=2).report.replaced if "lock" in x]
    plain = read(tmp_path, strip(kind[:-1], 2, 16).replace("\n2.0\n", "\n")).report.replaced
    assert not [line for line in plain if "lock" in line]


def test_the_excess_of_bending_stiffness_is_that_of_the_elements():
    """Pure bending in plane stress, on one column of rectangles, against the closed form."""
    nu, e = 0.3, 1.0
    for ny, a in ((1, 1.0), (2, 1.0), (3, 0.5), (4, 2.0)):
        found = Thickness(ny, a)
        energy, h = 0.0, 1.0 / ny
        for i in range(ny):
            # u = x y, v = -x^2/2 at the nodes; bilinear between them, v free of x in each layer
            y0, width = (i + 0.5) * h - 0.5, a * h
            g = np.array([-1.0, 1.0]) / np.sqrt(3.0)
            for s in g:
                for t in g:
                    # thickness strain of the layer is free: it follows the mean of -nu y
                    exx, eyy, gxy = y0 + t * h / 2, -nu * y0, s * width / 2
                    c = e / (1 - nu**2)
                    sxx, syy = c * (exx + nu * eyy), c * (eyy + nu * exx)
                    energy += (sxx * exx + syy * eyy + e / 2 / (1 + nu) * gxy**2) * h / 4
        assert energy * 12.0 - 1.0 == pytest.approx(found.excess, rel=1e-12)


def test_rings_and_triangles_have_no_thickness_where_it_is_not_known():
    angle = np.arange(12) * np.pi / 6
    ring = np.concatenate([r * np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
                           for r in (1.0, 1.5, 2.0)])  # fmt: skip
    i = np.arange(12)
    cells = np.concatenate(
        [np.stack([k + i, k + 12 + i, k + 12 + (i + 1) % 12, k + (i + 1) % 12], 1) for k in (0, 12)]
    )
    assert thickness_of("quadrilateral", ring, cells).number == 2
    assert thickness_of("triangle", ring, cells[:, :3]) is None


@pytest.mark.slow
@pytest.mark.mpi
def test_terminal_check_and_both_reports_say_it(shared_path, capfd):
    text = PLATE.replace("CPE4", "CPE4R") + STEP
    path, out = write(shared_path, text), shared_path / "out"
    assert run("run", str(path), "--check") == 0
    listed = capfd.readouterr().out
    assert run("run", str(path), "--out", str(out), "--report") == 0
    if MPI.COMM_WORLD.rank == 0:
        terminal = "".join(capfd.readouterr())
        pages = [(out / name).read_text() for name in ("report.txt", "report.html")]
        for place in (listed, terminal, *pages):
            words = " ".join(place.split())
            assert "with 1 element over the smallest dimension" in words and "48 %" in words
            assert "--order 1" in words
    MPI.COMM_WORLD.Barrier()
