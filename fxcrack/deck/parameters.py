"""``*PARAMETER``: names for numbers and words, which stand as ``<name>`` anywhere in a deck.

All definitions are collected before the first is used, and those that need others wait for them:
a parameter may be used before the line that defines it. Expressions are arithmetic; nothing else of
a program is evaluated.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable, Sequence
from typing import Any, cast

from fxcrack.deck.cards import Card

Value = float | int | str

_USE = re.compile(r"<\s*([A-Za-z_]\w*)\s*>")
_DEEP = 200
"""Characters of an exponent's or a text's size beyond which an expression is refused."""

_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
}
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    **{
        name: getattr(math, name)
        for name in (
            *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh"),
            *("exp", "log", "log10", "sqrt", "pow", "fabs", "floor", "ceil", "radians", "degrees"),
        )
    },
    "abs": abs,
    "int": int,
    "float": float,
    "max": max,
    "min": min,
    "round": round,
    "str": str,
}


class _Unknown(Exception):
    """A name that has no value (yet)."""


class _Wrong(Exception):
    """An expression that cannot be evaluated, with the reason."""


def evaluate_parameters(cards: Sequence[Card]) -> dict[str, Value]:
    """Values of all parameters of some ``*PARAMETER`` cards, by name in capitals.

    Raises:
        DeckError: A line is no assignment, an expression cannot be evaluated, or names never get a
            value.
    """
    waiting: list[tuple[Card, int, str, str]] = []
    for card in cards:
        for i, line in enumerate(card.lines):
            text = line.split("#")[0].strip() if '"' not in line and "'" not in line else line
            if not text.strip():
                continue
            name, equals, expression = (part.strip() for part in text.partition("="))
            if not equals or not re.fullmatch(r"[A-Za-z_]\w*", name) or expression[:1] == "=":
                card.fail(f"'{text}' is no definition; write name = expression", i)
            waiting.append((card, i, name.upper(), expression))
    values: dict[str, Value] = {}
    while waiting:
        left = []
        for card, i, name, expression in waiting:
            try:
                values[name] = _evaluate(expression, values)
            except _Unknown:
                left.append((card, i, name, expression))
            except _Wrong as error:
                card.fail(f"{name} = {expression}: {error}", i)
        if len(left) == len(waiting):
            card, i, name, expression = left[0]
            try:
                _evaluate(expression, values)
            except _Unknown as error:
                card.fail(f"{name} = {expression}: {error} is not defined anywhere", i)
        waiting = left
    return values


def substitute(line: str, values: dict[str, Value], fail: Callable[[str], Any]) -> str:
    """A line with every ``<name>`` replaced by its value.

    Args:
        line: The line.
        values: Parameters by name in capitals.
        fail: Called with a message where a name is unknown.
    """

    def replace(match: re.Match[str]) -> str:
        name = match[1].upper()
        if name not in values:
            fail(f"<{match[1]}> is not a parameter of this deck; define it by *PARAMETER")
            return match[0]
        value = values[name]
        return value if isinstance(value, str) else repr(value)

    return _USE.sub(replace, line)


def uses_parameters(line: str) -> bool:
    """Whether a line names a parameter."""
    return _USE.search(line) is not None


def _evaluate(expression: str, values: dict[str, Value]) -> Value:
    try:
        tree = ast.parse(expression.strip(), mode="eval")
        found = _value(tree.body, values)
    except (SyntaxError, RecursionError, MemoryError) as error:
        raise _Wrong("this is no arithmetic expression") from error
    except (ArithmeticError, TypeError, ValueError) as error:
        raise _Wrong(str(error)) from error
    if isinstance(found, complex) or (isinstance(found, float) and not math.isfinite(found)):
        raise _Wrong(f"the value {found} is not a finite number")
    return cast(Value, found)


def _value(node: ast.AST, values: dict[str, Value]) -> Any:
    match node:
        case ast.Constant(value=int() | float() | str() as value) if not isinstance(value, bool):
            return value
        case ast.Name(id=name):
            if name.upper() in values:
                return values[name.upper()]
            if name == "pi":
                return math.pi
            raise _Unknown(name)
        case ast.UnaryOp(op=ast.USub() | ast.UAdd() as sign, operand=operand):
            inner = _value(operand, values)
            return -inner if isinstance(sign, ast.USub) else +inner
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _BINARY:
            a, b = _value(left, values), _value(right, values)
            if isinstance(op, ast.Pow) and (abs(a) > 1e9 or abs(b) > _DEEP):
                a, b = float(a), float(b)
            if isinstance(op, ast.Mult) and (isinstance(a, str) or isinstance(b, str)):
                raise _Wrong("a text cannot be multiplied")
            return _BINARY[type(op)](a, b)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            if name not in _FUNCTIONS:
                raise _Wrong(f"there is no function {name}; known: {', '.join(_FUNCTIONS)}")
            return _FUNCTIONS[name](*(_value(a, values) for a in arguments))
        case _:
            raise _Wrong("only numbers, texts, + - * / ** and functions are possible")
