"""Form terms of a nonlinear continuum: one module per effect.

A term adds its part to the residual and the tangent of the bodies,

    r(u; v) = sum over terms r_i(u; v),     K = dr/du,

and to the books: stored energy, energy turned into something else. A term that a scene does not
ask for does not exist there: no form, no unknown, no memory.
"""

from fxcrack.terms.base import Term

__all__ = ["Term"]
