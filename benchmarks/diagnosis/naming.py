"""Which names of a diagnosis are right: the cause's own, its twin's in the model, one that no log tells apart from it.

An effect that is a parameter grown is the same finding as that parameter: more air leaks in the wind either way.
"""

from __future__ import annotations

from collections.abc import Collection

from igrow.core.effects import EFFECTS

CONFOUNDED = ({"co2_valve_leak", "soil_respiration"},)
"""Effects that no log tells apart."""


def is_same(name: str, cause: str) -> bool:
    """Tell whether a name that was told is right of a cause."""
    twin = cause in EFFECTS and name in EFFECTS[cause].resembles
    return name == cause or twin or any({name, cause} <= pair for pair in CONFOUNDED)


def is_named(cause: str, told: Collection[str]) -> bool:
    """Tell whether one of the names that were told is right of a cause."""
    return any(is_same(name, cause) for name in told)
