"""Unstructured grids as VTK XML files for ParaView: .vtu, .pvtu for pieces, .pvd for series.

Arrays are stored at full precision, compressed, base64. No function communicates.
"""

from __future__ import annotations

import base64
import html
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fxcrack.base.arrays import Array, Ints

Data = dict[str, npt.NDArray[Any]]

FACETS: dict[tuple[str, int], tuple[int, tuple[int, ...]]] = {
    ("interval", 1): (3, (0, 1)),
    ("interval", 2): (21, (0, 1, 2)),
    ("triangle", 1): (5, (0, 1, 2)),
    ("triangle", 2): (22, (0, 1, 2, 5, 3, 4)),
    ("quadrilateral", 1): (9, (0, 1, 3, 2)),
    ("quadrilateral", 2): (28, (0, 1, 3, 2, 4, 6, 7, 5, 8)),
}
"""VTK cell type and the position of its nodes in basix order, for (cell, order)."""

_TYPES = {"f": "Float", "i": "Int", "u": "UInt"}


@dataclass(frozen=True)
class Grid:
    """Cells of one kind with data, one piece of a file.

    Attributes:
        points: Positions, shape (n_points, 3), length.
        cells: Points of each cell in VTK order, shape (n_cells, nodes_per_cell).
        kind: VTK cell type.
        point_data: Arrays of shape (n_points,) or (n_points, n_components).
        cell_data: Arrays of shape (n_cells,) or (n_cells, n_components).
        components: Names of the components of an array, by the array's name.
    """

    points: Array
    cells: Ints
    kind: int
    point_data: Data
    cell_data: Data = field(default_factory=dict)
    components: dict[str, Sequence[str]] = field(default_factory=dict)


def _encode(values: npt.NDArray[Any]) -> str:
    """One compressed block: its sizes, then its bytes."""
    raw = np.ascontiguousarray(values).tobytes()
    if not raw:
        return base64.b64encode(np.zeros(3, np.uint64).tobytes()).decode()
    packed = zlib.compress(raw, 6)
    head = np.array([1, len(raw), len(raw), len(packed)], dtype=np.uint64)
    return base64.b64encode(head.tobytes()).decode() + base64.b64encode(packed).decode()


def _quoted(text: str) -> str:
    """A text as the value of an attribute (xml.sax.saxutils would load urllib)."""
    return f'"{html.escape(text)}"'


def _describe(name: str, values: npt.NDArray[Any], grid: Grid) -> str:
    """Attributes of a data array, the same in pieces and in their header."""
    kind = f"{_TYPES[values.dtype.kind]}{8 * values.dtype.itemsize}"
    text = f'type="{kind}" Name={_quoted(name)}'
    if values.ndim > 1:
        text += f' NumberOfComponents="{values.shape[1]}"'
    for i, component in enumerate(grid.components.get(name, ())):
        text += f" ComponentName{i}={_quoted(component)}"
    return text


def _file(kind: str, body: Iterable[str], version: str = "1.0") -> str:
    """A VTK file around its lines."""
    head = f'<VTKFile type="{kind}" version="{version}" byte_order="LittleEndian"'
    head += ' header_type="UInt64"'
    head += ' compressor="vtkZLibDataCompressor">'
    return "\n".join(['<?xml version="1.0"?>', head, *body, "</VTKFile>", ""])


def write_grid(path: Path, grid: Grid) -> None:
    """Write a .vtu file."""

    def arrays(data: Data) -> list[str]:
        return [
            f'<DataArray {_describe(name, v, grid)} format="binary">{_encode(v)}</DataArray>'
            for name, v in data.items()
        ]

    n_cells, width = grid.cells.shape
    topology: Data = {
        "connectivity": grid.cells.astype(np.int64).ravel(),
        "offsets": width * np.arange(1, n_cells + 1, dtype=np.int64),
        "types": np.full(n_cells, grid.kind, dtype=np.uint8),
    }
    lines = [
        "<UnstructuredGrid>",
        f'<Piece NumberOfPoints="{len(grid.points)}" NumberOfCells="{n_cells}">',
        *("<Points>", *arrays({"Points": grid.points}), "</Points>"),
        *("<Cells>", *arrays(topology), "</Cells>"),
        *("<PointData>", *arrays(grid.point_data), "</PointData>"),
        *("<CellData>", *arrays(grid.cell_data), "</CellData>"),
        "</Piece>",
        "</UnstructuredGrid>",
    ]
    # from version 2.1 on, VTK numbers the nodes of second-order hexahedra as DOLFINx does
    path.write_text(_file("UnstructuredGrid", lines, "2.2"), encoding="utf-8")


def write_header(path: Path, grid: Grid, pieces: Sequence[str]) -> None:
    """Write a .pvtu file: which pieces make up the whole, and the arrays they have."""

    def arrays(data: Data) -> list[str]:
        return [f"<PDataArray {_describe(name, v, grid)}/>" for name, v in data.items()]

    lines = [
        '<PUnstructuredGrid GhostLevel="0">',
        *("<PPoints>", *arrays({"Points": grid.points}), "</PPoints>"),
        *("<PPointData>", *arrays(grid.point_data), "</PPointData>"),
        *("<PCellData>", *arrays(grid.cell_data), "</PCellData>"),
        *(f"<Piece Source={_quoted(piece)}/>" for piece in pieces),
        "</PUnstructuredGrid>",
    ]
    path.write_text(_file("PUnstructuredGrid", lines), encoding="utf-8")


def write_series(path: Path, steps: Iterable[tuple[float, str]]) -> None:
    """Write a .pvd file: times and the files that hold them."""
    lines = [
        f'<DataSet timestep="{time!r}" part="0" file={_quoted(name)}/>' for time, name in steps
    ]
    text = _file("Collection", ["<Collection>", *lines, "</Collection>"])
    path.write_text(text, encoding="utf-8")
