"""Units that no column's name tells: those in its cells, and those of the columns beside it.

One computer writes one system of units. Where its temperatures are in degF, a temperature without a unit is too: by its
size alone nobody can tell 37 degF, a mild day in winter, from a hot one in degC.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

from igrow.core.quantities import QUANTITIES
from igrow.trainer.data import vocabulary
from igrow.trainer.data.importing import columns as names
from igrow.trainer.data.mapping import ColumnMapping
from igrow.trainer.data.plausibility.units import PIPES
from igrow.trainer.data.vocabulary import Unit

_AMERICAN = {"temperature": "degF", "speed": "mph"}
"""By dimension, what goes with degrees Fahrenheit."""
BY_SIZE = ("air_temperature", "heating_setpoint", *PIPES)
"""Temperatures of the greenhouse, whose own size tells degF: what is 20 there is never degF, whatever stands beside."""

LIKE_THE_AIR = ("outdoor_temperature", "sky_temperature", *PIPES, "wind_speed")
"""Quantities that are whole tenths where the air temperature is, and of which the size alone says nothing."""


def tenths_like_the_air(
    rules: Mapping[str, ColumnMapping], units: Mapping[str, str], whole: Collection[str]
) -> tuple[dict[str, ColumnMapping], list[str]]:
    """Take pipes, wind and the temperatures of the weather for tenths as well, where those of the greenhouse are.

    Args:
        rules: of the quantities, by name.
        units: quantity -> its unit; empty where nothing tells it.
        whole: quantities whose readings are all whole numbers.

    Returns:
        The rules, changed, and what was changed in sentences.
    """
    changed, notes = dict(rules), list[str]()
    for name in LIKE_THE_AIR:
        if name in rules and name in whole and not units.get(name) and rules[name].scale == 1.0:
            changed[name] = replace(rules[name], scale=0.1)
            notes.append(
                f"{rules[name].column!r} has no unit: taken for tenths of {QUANTITIES[name].unit}, as those of the "
                f"greenhouse are (--unit {name}={QUANTITIES[name].unit!r} says otherwise)"
            )
    return changed, notes


def unit_of_cells(quantity: str, behind: str) -> Unit | None:
    """Return the unit of a quantity that stands behind its numbers, or None where none that it may have does."""
    return vocabulary.find_units([vocabulary.compact(behind)]).get(names.dimension(quantity)) if behind else None


def like_the_others(
    rules: Mapping[str, ColumnMapping], units: Mapping[str, str], certain: str | None = None
) -> tuple[dict[str, ColumnMapping], dict[str, str], list[str]]:
    """Give temperatures and wind without a unit the American one where the other temperatures have it.

    Args:
        rules: of the quantities, by name.
        units: quantity -> its unit; empty where nothing tells it.
        certain: a temperature of the greenhouse that is in degF by its size; None: what the units tell counts.

    Returns:
        The rules and units, changed, and what was changed in sentences.
    """
    told = {units[name]: name for name in rules if names.dimension(name) == "temperature" and units.get(name)}
    witness = certain or (told["degF"] if "degF" in told and "degC" not in told else None)
    changed, named, notes = dict(rules), dict(units), list[str]()
    for name, rule in rules.items():
        american = _AMERICAN.get(names.dimension(name))
        untouched = replace(rule, column="", add=()) == ColumnMapping("")
        if witness is None or american is None or units.get(name) or name in BY_SIZE or not untouched:
            continue
        unit = names.unit_called(name, american)
        changed[name] = replace(rule, scale=unit.scale, offset=unit.offset)
        named[name] = american
        other = "m s-1" if american == "mph" else "degC"
        notes.append(
            f"{rule.column!r} has no unit: taken for {american}, as {witness} is in degF "
            f"(--unit {name}={other!r} says otherwise)"
        )
    return changed, named, notes
