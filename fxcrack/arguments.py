"""Checks of what kind of thing an argument is, with messages for the usual slips."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from fxcrack import log
from fxcrack.errors import InputError


def several(owner: str, name: str, value: Any, kinds: type | tuple[type, ...]) -> list[Any]:
    """The parts an argument lists.

    Args:
        owner: What is being made, for the message.
        name: The argument.
        value: What the user gave.
        kinds: What the parts may be.

    Raises:
        InputError: A single part without its list, or a part of another kind.
    """
    wanted = " or ".join(k.__name__ for k in (kinds if isinstance(kinds, tuple) else (kinds,)))
    if isinstance(value, kinds) or not isinstance(value, Iterable):
        raise InputError(
            f"{owner}: {name} must be a list of {wanted}, not {_kind(value)}; write {name}=[...]"
        )
    parts = list(value)
    for i, part in enumerate(parts):
        if not isinstance(part, kinds):
            raise InputError(f"{owner}: {name}[{i}] is {_kind(part)}; it must be a {wanted}")
    return parts


def one(owner: str, name: str, value: Any, kinds: type | tuple[type, ...], example: str) -> None:
    """Check that an argument is an instance of some classes.

    Raises:
        InputError: It is not, or a class was given where an instance of it belongs.
    """
    if isinstance(value, type):
        raise InputError(f"{owner}: {name} = {value.__name__} is a class; make one, e.g. {example}")
    if not isinstance(value, kinds):
        raise InputError(f"{owner}: {name} is {_kind(value)}; give e.g. {example}")


def warn_of_same_titles(kind: str, parts: Iterable[Any]) -> None:
    """Warn of parts that the history would call the same."""
    titles = [part.title for part in parts]
    for title in dict.fromkeys(t for t in titles if titles.count(t) > 1):
        log.warn(
            "%d %s are called '%s' and the history shows the last of them only; tell them apart by "
            "name=...",
            titles.count(title),
            kind,
            title,
        )


def check_amplitudes(parts: Iterable[Any]) -> None:
    """Check that the factors in time of supports and loads are amplitudes.

    Raises:
        InputError: One is something else, a number or a function perhaps.
    """
    for part in parts:
        if isinstance(part.amplitude, type) or not hasattr(part.amplitude, "breaks"):
            raise InputError(
                f"{type(part).__name__}('{part.title}'): amplitude is {_kind(part.amplitude)}; "
                "give Amplitude(times, values), or put a constant factor into the value"
            )


def _kind(value: Any) -> str:
    return f"the class {value.__name__}" if isinstance(value, type) else type(value).__name__
