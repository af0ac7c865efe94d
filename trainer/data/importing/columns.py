"""Which column of an export is which quantity, by the words of its name and by its unit."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES
from igrow.core.yaml_scalars import nearest
from igrow.trainer.data import vocabulary
from igrow.trainer.data.vocabulary import Unit

OUTSIDE = ("outdoor_temperature", "outdoor_humidity", "outdoor_co2", "global_radiation", "sky_temperature")
WEATHER = (*OUTSIDE, "wind_speed", "wind_direction", "rain")
"""Quantities that all compartments share."""
_CERTAIN = 1000
_UNLIKELY = {"other", "extreme"}
"""Words of columns that are taken only where nothing else would do: forecasts, alarms, the highest of a day."""


@dataclass(frozen=True)
class Match:
    """A column that may be a quantity."""

    quantity: str
    column: str
    score: int
    unit: Unit | None
    """As the column's name or the line of units tells it; None: it does not."""
    compartment: str


@dataclass(frozen=True)
class Assignment:
    """What each quantity is read from."""

    chosen: Mapping[str, Match]
    rivals: Mapping[str, tuple[str, ...]]
    """Further columns that would do as well, by quantity."""


def find_matches(columns: Iterable[str], unit_line: Mapping[str, str]) -> list[Match]:
    """Return every quantity that each column may be.

    Args:
        columns: names.
        unit_line: column -> its unit, where units have a line of their own.
    """
    found = []
    for column in columns:
        written = [vocabulary.compact(unit_line[column])] if unit_line.get(column) else []
        units = vocabulary.find_units([*written, *vocabulary.unit_texts(column)])
        # A unit that is known, of a quantity that is not: grams per m3 are no per cent.
        foreign = bool(written) and not vocabulary.find_units(written)
        foreign = foreign or bool(vocabulary.unknown_unit(column))
        exact = _exact(column)
        words, compartment = vocabulary.words_in(vocabulary.without_unit(column)), vocabulary.compartment(column)
        if exact is not None:
            found.append(Match(exact, column, _CERTAIN, units.get(dimension(exact)), compartment))
            continue
        for quantity, rule in vocabulary.rules().items():
            enough = (*rule.needed, *(rule.by_unit if rule.dimension in units else ()))
            needed = max(map(len, rule.fitting(words, enough)), default=0)
            if not needed or foreign or (units and rule.dimension not in units):
                continue
            more = sum(word in words for word in rule.likelier)
            score = 10 * needed + 3 * more + 4 * bool(units) - 12 * bool(words & _UNLIKELY) - 2 * ("sum" in words)
            found.append(Match(quantity, column, score, units.get(rule.dimension), compartment))
    return found


def of_unknown_unit(columns: Iterable[str], unit_line: Mapping[str, str]) -> dict[str, str]:
    """Return column -> its unit, of those that their names make a quantity and their units none."""
    found = {}
    for column in columns:
        written = vocabulary.compact(unit_line.get(column, ""))
        own = unit_line[column] if written and not vocabulary.find_units([written]) else vocabulary.unknown_unit(column)
        words = vocabulary.words_in(vocabulary.without_unit(column))
        named = any(rule.fitting(words, (*rule.needed, *rule.by_unit)) for rule in vocabulary.rules().values())
        if own and named and _exact(column) is None:
            found[column] = own
    return found


def of_other_humidity(columns: Iterable[str]) -> list[str]:
    """Return the columns of air that tell its humidity as a deficit, a content, or a dew point."""
    other = {"outside", "setpoint", "ground", "plant", "sky", "co2"}
    return [name for name in columns if "absolute" in (words := vocabulary.words_in(name)) and not words & other]


def _exact(column: str) -> str | None:
    """Return the quantity that a name is without any word in it, or None."""
    plain = vocabulary.folded(column).replace(" ", "_").strip("_")
    return plain if plain in QUANTITIES else vocabulary.exact_names().get(vocabulary.compact(column))


def dimension(quantity: str) -> str:
    """Return the dimension of a quantity's units; empty where it has none to choose from."""
    rule = vocabulary.rules().get(quantity)
    return "" if rule is None else rule.dimension


def side_by_side(matches: Sequence[Match]) -> Sequence[Match]:
    """Return matches with the compartments that names tell which no word for one stands in, such as north and south.

    Where several columns would do for the air temperature, what their names do not have in common tells compartments if
    their humidity or CO2 has the same beside it.
    """
    airs = [one for one in matches if one.quantity == "air_temperature"]
    best = max((one.score for one in airs), default=0)
    airs = [one for one in airs if one.score == best]
    if len(airs) < 2 or compartments(matches):
        return matches
    words = {one.column: _words(one.column) for one in airs}
    common = set.intersection(*map(set, words.values()))
    labels = {" ".join(word for word in found if word not in common): None for found in words.values()}
    others = [one for one in matches if one.quantity in ("air_humidity", "air_co2")]
    if "" in labels or not any(sum(_called(one.column, label) for one in others) for label in list(labels)[1:]):
        return matches
    return [
        one if one.quantity in WEATHER else replace(one, compartment=label)
        for one in matches
        for label in [next((label for label in labels if _called(one.column, label)), "")]
    ]


def _words(name: str) -> list[str]:
    return re.findall(r"\w+", vocabulary.folded(name))


def _called(column: str, label: str) -> bool:
    return set(label.split()) <= set(_words(column))


def compartments(matches: Sequence[Match]) -> list[str]:
    """Return the compartments that have an air temperature of their own, in the order of the columns."""
    return list(
        dict.fromkeys(one.compartment for one in matches if one.quantity == "air_temperature" and one.compartment)
    )


def assign(matches: Sequence[Match], compartment: str, given: Mapping[str, str]) -> Assignment:
    """Return the likeliest column of each quantity; no column stands for two, but for lamps.

    Args:
        matches: from `find_matches`.
        compartment: the one to read; empty where there is one alone.
        given: quantity -> column, as the user says.
    """
    fitting = [
        one for one in matches if one.quantity in WEATHER or not compartment or one.compartment in ("", compartment)
    ]
    chosen: dict[str, Match] = {}
    rivals: dict[str, tuple[str, ...]] = {}
    for quantity, column in given.items():
        known = next((one for one in matches if one.quantity == quantity and one.column == column), None)
        unit = vocabulary.find_units(vocabulary.unit_texts(column)).get(dimension(quantity))
        chosen[quantity] = known or Match(quantity, column, _CERTAIN, unit, "")
    taken = set(given.values())
    # A compartment's own column comes before one that tells none.
    ranked = sorted(fitting, key=lambda one: (-one.score, one.compartment != compartment))
    for one in ranked:
        likelier = any(other.column == one.column and other.score > one.score for other in ranked)
        if one.quantity in given or one.column in taken or likelier:
            continue
        best = chosen.get(one.quantity)
        if best is None:
            chosen[one.quantity] = one
            taken.add(one.column)
        elif best.score == one.score and best.compartment == one.compartment:
            rivals[one.quantity] = (*rivals.get(one.quantity, ()), one.column)
    return Assignment(chosen, rivals)


def check_given(given: Mapping[str, str], labels: Sequence[str]) -> None:
    """Raise IgrowError where the user names a quantity or a column that there is not."""
    for quantity, column in given.items():
        if quantity not in QUANTITIES:
            raise IgrowError(f"--column {quantity}={column}: no such quantity: {nearest(quantity, QUANTITIES)}")
        if column not in labels:
            raise IgrowError(f"--column {quantity}={column}: no such column: {nearest(column, labels)}")


def unit_called(quantity: str, text: str) -> Unit:
    """Return the unit of a quantity that a user names; raises IgrowError with those that are known."""
    table = vocabulary.units().get(dimension(quantity), {})
    unit = table.get(vocabulary.compact(text))
    if unit is None:
        known = dict.fromkeys(one.name for one in table.values())
        raise IgrowError(
            f"{quantity} is never in {text!r}: {nearest(text, known) if known else 'it has no other unit'}"
        )
    return unit
