"""Accuracy against time: what a discretisation costs, what it gives, and which one to take.

    fxcrack accuracy dcb                     a study that comes with fxcrack
    fxcrack accuracy mine.py:beam            a scene function of your own

A scene function takes a :class:`Setting` and returns a :class:`Case`::

    @study(sizes=(1.0, 0.5, 0.25), title="my beam", unit="mm")
    def beam(setting: Setting) -> Case:
        mesh = make_mesh(setting.size, setting.cell, setting.order)
        scene = fx.Scene(mesh, ..., options=setting.options())
        return Case(scene, setting.step(fx.CrackLength(bond, 40.0)), measure)

:func:`choose` takes the cheapest setting for an accuracy from what a study has measured;
``Scene.run(..., accuracy=0.01)`` judges a run on a given mesh.
"""

from fxcrack.accuracy.knowledge import choose
from fxcrack.accuracy.study import (
    Case,
    ClosedForm,
    Measured,
    Setting,
    Study,
    along,
    critical,
    study,
)
from fxcrack.error_estimate import AccuracyError, Estimate

__all__ = [
    "AccuracyError",
    "Case",
    "ClosedForm",
    "Estimate",
    "Measured",
    "Setting",
    "Study",
    "along",
    "choose",
    "critical",
    "study",
]
