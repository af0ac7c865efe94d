"""The balances advanced over a step, by their exponentials.

Each balance C dx/dt = F(x) becomes x + F/G (1 - exp(-G dt / C)), where G is the sum of the conductances that pull x
back; heat and vapour, which pull at each other through the crop, are advanced by the exponential of both together. It
is exact for linear balances with constant inputs, stable for any step (Hochbruck and Ostermann (2010), Acta Numerica
19, exponential Rosenbrock-Euler).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from igrow.core.arrays import Array
from igrow.core.effects.definition import Drivers, Values
from igrow.core.simulator.hybrid.balances import STATES, Balances, balances
from igrow.core.simulator.hybrid.canopy import PASCAL_PER_CONTENT


def relax(
    xp: Any, state: Values, drivers: Drivers, parameters: Values, added: Mapping[str, Array], seconds: float
) -> dict[str, Array]:
    """Return `STATES` by name `seconds` later, by the exponentials of the balances."""
    parts = balances(xp, state, drivers, parameters, added)
    return moved(xp, state, parts.of, heat_and_vapour(xp, drivers, parts, seconds), seconds)


def moved(
    xp: Any,
    state: Values,
    parts: Mapping[str, tuple[Array, Array, Array]],
    answers: tuple[tuple[Array, Array], tuple[Array, Array]],
    seconds: Array,
) -> dict[str, Array]:
    """Return `STATES` by name `seconds` later, by fluxes (`balances`) and their answers (`heat_and_vapour`)."""
    pair = ("air_temperature", "vapour_concentration")
    heat, vapour = (parts[name][0] for name in pair)
    following = {name: state[name] + row[0] * heat + row[1] * vapour for name, row in zip(pair, answers, strict=True)}
    for name in STATES[2:]:
        flux, pull, capacity = parts[name]
        following[name] = state[name] + flux / pull * (1.0 - xp.exp(-seconds * pull / capacity))
    return following


def heat_and_vapour(
    xp: Any, drivers: Drivers, parts: Balances, seconds: Array
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return by how much a flux of heat and one of vapour change temperature, and vapour, over a step: two rows of two.

    The exponential of both balances together: warmer air is moistened by the crop and by a cover that bears more, and
    moister air is cooled less. `parts` is what `balances` returns for these drivers.
    """
    (_, heat_pull, heat_capacity), (_, vapour_pull, vapour_capacity) = (
        parts.of[name] for name in ("air_temperature", "vapour_concentration")
    )
    warmed = drivers["transpiration_response"] * PASCAL_PER_CONTENT
    heat_rate, vapour_rate = seconds / heat_capacity, seconds / vapour_capacity
    own = (-heat_rate * heat_pull, -vapour_rate * vapour_pull)
    cross = (heat_rate * warmed, vapour_rate * parts.moistened)
    # Both eigenvalues are real, since neither pushes the other away; they are kept apart, and below nought.
    middle, half = 0.5 * (own[0] + own[1]), 0.5 * (own[0] - own[1])
    apart = xp.sqrt(half * half + cross[0] * cross[1] + 1e-6)
    slow, fast = xp.minimum(middle + apart, 0.0 * middle - 1e-4), middle - apart - 1e-3
    first, second = (xp.exp(slow) - 1.0) / slow, (xp.exp(fast) - 1.0) / fast
    linear = (first - second) / (slow - fast)
    constant = first - slow * linear
    return (
        (heat_rate * (constant + linear * own[0]), vapour_rate * linear * cross[0]),
        (heat_rate * linear * cross[1], vapour_rate * (constant + linear * own[1])),
    )
