"""Couplings and equations of a scene as cards of a deck."""

from __future__ import annotations

from collections.abc import Callable

from fxcrack.continuum.couplings import MOTIONS, Coupling, Equation
from fxcrack.deck.lines import number
from fxcrack.deck.write_steps import refuse


def coupling_lines(
    coupling: Coupling, node: int, *, new: bool, amplitude: Callable[[], str]
) -> tuple[list[str], list[str]]:
    """Cards of a coupling.

    Args:
        coupling: The coupling, whose nodes are a set of its title.
        node: Number of its reference node.
        new: Whether no coupling of the same group and point was written before.
        amplitude: Name of its amplitude, asked for where it moves.

    Returns:
        Model data, and the ``*BOUNDARY`` cards of the reference.

    Raises:
        InputError: A deck has no word for it.
    """
    title = coupling.title
    if coupling.mean:
        refuse(f"the coupling '{title}' of a mean motion")
    model = []
    if new:
        model = [
            "*NODE",
            f"{node}, " + ", ".join(number(c) for c in coupling.point),
            f'*SURFACE, TYPE=NODE, NAME="{title} nodes"',
            f'"{title}",',
            f'*COUPLING, CONSTRAINT NAME="{title}", REF NODE={node}, SURFACE="{title} nodes"',
            "*KINEMATIC",
            *(f"{'xyz'.index(axis) + 1}" for axis in sorted(coupling.components)),
            *(["4, 6"] if coupling.rotations else []),
        ]
    held, moved = [], []
    for motion, value in coupling.prescribed.items():
        component = MOTIONS.index(motion) + 1
        line = f"{node}, {component}, {component}"
        if value == 0.0:
            held.append(line)
        else:
            moved.append(f"{line}, {number(value)}")
    return model, [
        *(["*BOUNDARY", *held] if held else []),
        *([f'*BOUNDARY, AMPLITUDE="{amplitude()}"', *moved] if moved else []),
    ]


def equation_lines(equation: Equation) -> list[str]:
    """``*EQUATION`` of sets of the names of its groups.

    Raises:
        InputError: It has a side that is not zero.
    """
    if equation.value is not None:
        refuse(f"the equation '{equation.title}' with a value")
    return [
        "*EQUATION",
        f"{len(equation.terms)}",
        *(f'"{group}", {"xyz".index(axis) + 1}, {number(f)}' for group, axis, f in equation.terms),
    ]


__all__ = ["coupling_lines", "equation_lines"]
