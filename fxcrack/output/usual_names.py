"""Columns of a history under the names that users of keyword programs know.

==================== ==========================================
u[set.x], R[set.x]   U1[set], RF1[set]; y and z 2 and 3
GI[..] GII[..]       ENRRT11[..], ENRRT12[..], ENRRT13[..]
f[..]                EFENRRTR[..]
strain_energy        ALLSE
external_work        ALLWK
viscous_energy       ALLVD
kinetic_energy       ALLKE
plastic_energy       ALLPD
friction_energy      ALLFD
balance              ETOTAL
==================== ==========================================

DBT[..] is added: the time of the latest release of an interface, NaN before the first. Bond by bond
DBT, DBSF, BDSTAT and the others stand in :func:`fxcrack.bond_table`.
"""

from __future__ import annotations

import re

from fxcrack.base.checks import check_instance
from fxcrack.base.errors import InputError
from fxcrack.history import Details, History, Row

_WHOLE = {
    "strain_energy": "ALLSE",
    "external_work": "ALLWK",
    "viscous_energy": "ALLVD",
    "kinetic_energy": "ALLKE",
    "plastic_energy": "ALLPD",
    "friction_energy": "ALLFD",
    "balance": "ETOTAL",
}
_BEFORE_BRACKET = {"GI": "ENRRT11", "GII": "ENRRT12", "GIII": "ENRRT13", "f": "EFENRRTR"}
_OF_SUPPORTS = {"u": "U", "R": "RF"}
_SUPPORT = re.compile(r"(u|R)\[(.*)\.([xyz])\]")
_BRACKET = re.compile(r"(\w+)\[(.*)\]")


def usual_name(column: str) -> str:
    """The usual name of a column, the column itself where there is none."""
    if column in _WHOLE:
        return _WHOLE[column]
    support = _SUPPORT.fullmatch(column)
    if support:
        return f"{_OF_SUPPORTS[support[1]]}{'xyz'.index(support[3]) + 1}[{support[2]}]"
    found = _BRACKET.fullmatch(column)
    if found and found[1] in _BEFORE_BRACKET:
        return f"{_BEFORE_BRACKET[found[1]]}[{found[2]}]"
    return column


def with_usual_names(history: History) -> History:
    """A copy of a history whose columns have the usual names.

    Raises:
        InputError: Two columns would have the same name.
    """
    check_instance("with_usual_names", "history", history, History, "scene.history")
    names = {column: usual_name(column) for column in history.columns}
    if len(set(names.values())) < len(names):
        raise InputError("two columns of the history would have the same usual name")
    out = History(history.comm)
    out.reason, out.details = history.reason, Details(history.details)
    failed: dict[str, float] = {}
    released: dict[str, float] = {}
    for row in history.rows:
        new: Row = {names[column]: value for column, value in row.items()}
        for column, value in row.items():
            if column.startswith("released[") and not isinstance(value, str):
                interface = column[len("released[") : -1]
                if value > released.get(interface, 0.0):
                    failed[interface] = float(row["time"])
                released[interface] = float(value)
                new[f"DBT[{interface}]"] = failed.get(interface, float("nan"))
        out.append(new)
    return out
