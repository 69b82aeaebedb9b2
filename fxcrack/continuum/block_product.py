"""Sparse products of matrices with small dense blocks, compiled for the processor at hand.

A stiffness couples all components of two nodes, so that its entries come in blocks of 2 x 2 or
3 x 3 with one column number each: 9 or 8.4 bytes an entry instead of 12. Products are bound by what
they read, and take that much less time. Of a symmetric matrix one triangle is enough, with half as
much to read. The kernels are a few lines of C, compiled once per kind of processor and kept beside
the kernels of forms (:mod:`fxcrack.continuum.kernels`).
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import io
import os
import tempfile
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

from fxcrack.base import compat  # isort: skip  # noqa: F401  (orders MPI before DOLFINx)
import cffi
import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from fxcrack.base import log
from fxcrack.base.arrays import Array
from fxcrack.base.sparse import Product
from fxcrack.continuum.kernels import FLAGS, jit_options

_DECLARATION = """
void {name}_{n}(int32_t rows, const int32_t *starts, const int32_t *columns, const double *blocks,
                const double *x, double *y);
"""


def _kernel(n: int) -> str:
    """C source of y += A x with blocks of n x n, sums over a row kept in registers."""
    sums = "".join(f"double s{i} = 0.0;" for i in range(n))
    values = "".join(f"const double x{j} = p[{j}];" for j in range(n))
    rows = "".join(
        f"s{i} += " + " + ".join(f"a[{n * i + j}] * x{j}" for j in range(n)) + ";" for i in range(n)
    )
    store = "".join(f"y[{n} * (int64_t)i + {i}] += s{i};" for i in range(n))
    return f"""
void add_{n}(int32_t rows, const int32_t *restrict starts, const int32_t *restrict columns,
             const double *restrict blocks, const double *restrict x, double *restrict y)
{{
  for (int32_t i = 0; i < rows; ++i)
  {{
    {sums}
    for (int32_t k = starts[i]; k < starts[i + 1]; ++k)
    {{
      const double *a = blocks + {n * n} * (int64_t)k;
      const double *p = x + {n} * (int64_t)columns[k];
      {values}
      {rows}
    }}
    {store}
  }}
}}
"""


_PAIRS = """
typedef double four __attribute__((vector_size(32)));
typedef double two __attribute__((vector_size(16)));
static inline four rows_of(const double *a)
{
  four out;
  memcpy(&out, a, sizeof out);
  return out;
}
static inline four twice(const double *p)
{
  two x;
  memcpy(&x, p, sizeof x);
  return (four){x[0], x[1], x[0], x[1]};
}
void add_2(int32_t rows, const int32_t *restrict starts, const int32_t *restrict columns,
           const double *restrict blocks, const double *restrict x, double *restrict y)
{
  for (int32_t i = 0; i < rows; ++i)
  {
    four s = {0.0, 0.0, 0.0, 0.0}, t = s;
    int32_t k = starts[i];
    const int32_t end = starts[i + 1];
    for (; k + 1 < end; k += 2)
    {
      s += rows_of(blocks + 4 * (int64_t)k) * twice(x + 2 * (int64_t)columns[k]);
      t += rows_of(blocks + 4 * (int64_t)k + 4) * twice(x + 2 * (int64_t)columns[k + 1]);
    }
    if (k < end)
      s += rows_of(blocks + 4 * (int64_t)k) * twice(x + 2 * (int64_t)columns[k]);
    s += t;
    y[2 * (int64_t)i] += s[0] + s[1];
    y[2 * (int64_t)i + 1] += s[2] + s[3];
  }
}
"""
"""The same for blocks of 2 x 2, a block in one register, which compilers do not find themselves."""


def _symmetric_kernel(n: int) -> str:
    """C source of y += A x for symmetric A of which the diagonal and what is right of it is stored.

    The first block of a row is the one on the diagonal; rows without blocks are zero.
    """
    own = "".join(f"const double z{j} = q[{j}];" for j in range(n))
    values = "".join(f"const double x{j} = p[{j}];" for j in range(n))

    def row(i: int, name: str) -> str:
        return " + ".join(f"a[{n * i + j}] * {name}{j}" for j in range(n))

    diagonal = "".join(f"double s{i} = {row(i, 'z')};" for i in range(n))
    rows = "".join(f"s{i} += {row(i, 'x')};" for i in range(n))
    columns = "".join(
        f"w[{j}] += " + " + ".join(f"a[{n * i + j}] * z{i}" for i in range(n)) + ";"
        for j in range(n)
    )
    store = "".join(f"y[{n} * (int64_t)i + {i}] += s{i};" for i in range(n))
    return f"""
void symmetric_{n}(int32_t rows, const int32_t *restrict starts, const int32_t *restrict columns,
                   const double *restrict blocks, const double *restrict x, double *restrict y)
{{
  for (int32_t i = 0; i < rows; ++i)
  {{
    int32_t k = starts[i];
    const int32_t end = starts[i + 1];
    if (k == end)
      continue;
    const double *a = blocks + {n * n} * (int64_t)k;
    const double *q = x + {n} * (int64_t)i;
    {own}
    {diagonal}
    for (++k; k < end; ++k)
    {{
      a += {n * n};
      const double *p = x + {n} * (int64_t)columns[k];
      double *w = y + {n} * (int64_t)columns[k];
      {values}
      {rows}
      {columns}
    }}
    {store}
  }}
}}
"""


_SYMMETRIC_PAIRS = """
void symmetric_2(int32_t rows, const int32_t *restrict starts, const int32_t *restrict columns,
                 const double *restrict blocks, const double *restrict x, double *restrict y)
{
  for (int32_t i = 0; i < rows; ++i)
  {
    int32_t k = starts[i];
    const int32_t end = starts[i + 1];
    if (k == end)
      continue;
    const double *q = x + 2 * (int64_t)i;
    const four own = {q[0], q[0], q[1], q[1]};
    four s = rows_of(blocks + 4 * (int64_t)k) * twice(q);
    for (++k; k < end; ++k)
    {
      const int64_t j = 2 * (int64_t)columns[k];
      const four a = rows_of(blocks + 4 * (int64_t)k), t = a * own;
      s += a * twice(x + j);
      two w;
      memcpy(&w, y + j, sizeof w);
      w += (two){t[0], t[1]} + (two){t[2], t[3]};
      memcpy(y + j, &w, sizeof w);
    }
    y[2 * (int64_t)i] += s[0] + s[1];
    y[2 * (int64_t)i + 1] += s[2] + s[3];
  }
}
"""
_SPREAD = """
void spread(int64_t n, const double *restrict factors, double *restrict y, double *restrict v)
{
  for (int64_t i = 0; i < n; ++i)
  {
    v[i] += factors[i] * y[i];
    y[i] = 0.0;
  }
}
"""
"""Adds y, component by component times factors, to v, and leaves y empty for the next product."""

SIZES = (2, 3)
"""Sizes of blocks for which there are kernels."""
_SOURCE = (
    "#include <stdint.h>\n#include <string.h>\n"
    + (_PAIRS + _kernel(3))
    + (_SYMMETRIC_PAIRS + _symmetric_kernel(3) + _SPREAD)
)
_DECLARED = (
    "".join(_DECLARATION.format(name=k, n=n) for k in ("add", "symmetric") for n in SIZES)
    + "void spread(int64_t n, const double *factors, double *y, double *v);"
)
_NAME = "fxcrack_blocks_" + hashlib.sha256((_SOURCE + " ".join(FLAGS)).encode()).hexdigest()[:12]
_loaded: dict[str, Any] = {}


def _load() -> Any:
    """The compiled kernels; compiles them where no run on this kind of processor has done so."""
    folder = Path(jit_options()["cache_dir"])
    # other versions of Python keep theirs in the same folder
    known = [p for suffix in EXTENSION_SUFFIXES if (p := folder / f"{_NAME}{suffix}").is_file()]
    if not known:
        folder.mkdir(parents=True, exist_ok=True)
        builder = cffi.FFI()
        builder.cdef(_DECLARED)
        builder.set_source(_NAME, _SOURCE, extra_compile_args=["-std=c17", *FLAGS])
        # complete before others see it, whoever else compiles the same
        with tempfile.TemporaryDirectory(dir=folder) as place:
            with contextlib.redirect_stdout(io.StringIO()):
                made = Path(builder.compile(tmpdir=place))
            os.replace(made, folder / made.name)
        known = [folder / made.name]
    found = importlib.util.spec_from_file_location(_NAME, known[0])
    if found is None or found.loader is None:
        raise ImportError(f"{known[0]} cannot be loaded")
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def kernels() -> Any:
    """The compiled kernels, ``None`` where the compiler refuses them."""
    if "kernels" not in _loaded:
        try:
            _loaded["kernels"] = _load()
        except Exception as error:  # whatever a compiler may raise
            _loaded["kernels"] = None
            log.warn(
                "the compiler refuses kernels for block products (%s); products of explicit "
                "dynamics take those of scipy, which are slower by a third",
                str(error).splitlines()[0] if str(error) else type(error).__name__,
            )
    return _loaded["kernels"]


class BlockProduct:
    """A matrix of dense blocks, for products that add in place.

    Args:
        matrix: Shape (n, m), both multiples of the size of the blocks; in blocks of that size
            already, sorted by columns, or by rows.
        size: Of the blocks, 2 or 3.
        compiled: From :func:`kernels`.
        triangle: Whether the blocks are the diagonal and all right of it of a symmetric matrix,
            of which every row that has any begins on the diagonal.

    Attributes:
        shape: (n, m).
        data: Blocks, shape (n_blocks, size, size); may be scaled in place.
    """

    def __init__(
        self, matrix: sp.csr_matrix | sp.bsr_matrix, size: int, compiled: Any,
        *, triangle: bool = False,
    ) -> None:  # fmt: skip
        blocks = matrix.tobsr((size, size))
        blocks.sort_indices()
        self.shape: tuple[int, int] = (int(matrix.shape[0]), int(matrix.shape[1]))
        self.data = np.ascontiguousarray(blocks.data, dtype=np.float64)
        self._starts = np.ascontiguousarray(blocks.indptr, dtype=np.int32)
        self._columns = np.ascontiguousarray(blocks.indices, dtype=np.int32)
        self._add = getattr(compiled.lib, f"{'symmetric' if triangle else 'add'}_{size}")
        self._rows = self.shape[0] // size
        view = compiled.ffi.from_buffer
        self._view = view
        self._fixed = (
            view("int32_t[]", self._starts), view("int32_t[]", self._columns),
            view("double[]", self.data),
        )  # fmt: skip

    def add(self, x: Array, y: Array) -> None:
        """Add A x to y.

        Args:
            x: Shape (m,), contiguous.
            y: Shape (n,), contiguous.
        """
        view = self._view
        if not self._rows:
            return
        self._add(self._rows, *self._fixed, view("double[]", x), view("double[]", y))

    def into(self, x: Array, y: Array) -> Array:
        """Write A x over y, and return y; shapes as for :meth:`add`."""
        y.fill(0.0)
        self.add(x, y)
        return y

    def __call__(self, x: Array) -> Array:
        """A x as a new array of shape (n,)."""
        out = np.zeros(self.shape[0])
        self.add(x, out)
        return out


def shared_kernels(comm: MPI.Comm) -> Any:
    """:func:`kernels` on all ranks, of which the first one compiles them; collective."""
    if comm.rank == 0:
        kernels()
    comm.barrier()
    return kernels()


def fast_product(matrix: sp.csr_matrix, size: int, comm: MPI.Comm) -> BlockProduct | Product:
    """The fastest product at hand for a matrix on nodes; collective.

    Args:
        matrix: Shape (n, m), rows and columns node by node.
        size: Unknowns of a node.
        comm: Communicator of the rows; its first rank compiles the kernels.
    """
    compiled = shared_kernels(comm)
    if compiled is None or size not in SIZES:
        return Product(matrix)
    return BlockProduct(matrix, size, compiled)


__all__ = ["SIZES", "BlockProduct", "fast_product", "kernels", "shared_kernels"]
