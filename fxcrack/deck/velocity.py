"""``*INITIAL CONDITIONS, TYPE=VELOCITY``: the velocity of the bodies at the beginning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fxcrack.continuum.loads import Field
from fxcrack.deck.cards import Card
from fxcrack.deck.flat import Flat
from fxcrack.deck.thermal import NodalField, check_unique


@dataclass(frozen=True)
class StartingVelocity:
    """Velocity at time 0.

    Attributes:
        card: The first card that says so.
        components: A number or a function of position per component, length/time.
    """

    card: Card
    components: tuple[Field, ...]


def starting_velocity(cards: Sequence[Card], flat: Flat) -> StartingVelocity | None:
    """The velocity that initial conditions give the bodies, None without.

    Raises:
        DeckError: A line cannot be read, or two nodes at one place have different velocities.
    """
    if not cards:
        return None
    gdim = flat.kind.gdim
    given = np.zeros((gdim, flat.n_given))
    for card in cards:
        for row in card.need_rows("node or set, component, velocity"):
            dof = row.whole(1)
            if not 1 <= dof <= gdim:
                row.fail(f"component {dof} of a velocity is not available; 1 to {gdim} are")
            nodes = flat.nodes(card, row.text(0), row.index)
            given[dof - 1, nodes] = row.number(2)
    used = flat.used
    x = flat.points[used][:, :gdim]
    components: list[Field] = []
    for values in given:
        found = flat.nodal(values)[used]
        if np.ptp(found) == 0.0:
            components.append(float(found[0]))
            continue
        check_unique(x, found, cards[0], "velocities")
        components.append(NodalField(x, found))
    return StartingVelocity(cards[0], tuple(components))


__all__ = ["StartingVelocity", "starting_velocity"]
