"""What greenhouse computers call things: reads `vocabulary.yaml`, its table of names, units and words."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from typing import Any, cast

import yaml

from igrow.trainer.data.mapping import Amount

_FOLDED = str.maketrans({"æ": "ae", "ø": "o", "œ": "oe", "ł": "l", "ß": "ss", "−": "-", "–": "-", "’": "'"})
OPENINGS, CLOSURES = ("vent_lee", "vent_wind"), ("energy_screen", "blackout_screen")
_TENTHS = re.compile(r"(?:0,1|01|1/10|x0,1|x01)([^\d/].*)")
"""A unit of which each whole number is a tenth, compact: ``0,1 °C``."""
_BRACKETS = re.compile(r"[(\[{]([^()\[\]{}]*)[)\]}]")


@dataclass(frozen=True)
class Unit:
    """A unit that a column may be in, and the way to the registry's: a value becomes value * scale + offset."""

    name: str
    scale: float = 1.0
    offset: float = 0.0
    amount: Amount = "rate"


@dataclass(frozen=True)
class Rule:
    """How the name of a quantity's column is made up of words."""

    needed: tuple[tuple[str, ...], ...]
    """Sets of words, of which one must be there whole."""
    by_unit: tuple[tuple[str, ...], ...]
    """Sets of words that are enough where the column has a unit of the quantity."""
    excluded: frozenset[str]
    likelier: tuple[str, ...]
    dimension: str

    def fitting(self, words: frozenset[str], enough: Iterable[tuple[str, ...]]) -> list[tuple[str, ...]]:
        """Return the sets of words, of those that are enough, that a name has; a word of one excludes nothing."""
        return [one for one in enough if words.issuperset(one) and not words & self.excluded.difference(one)]


@cache
def _table() -> Mapping[str, Any]:
    text = resources.files("igrow.trainer.data").joinpath("vocabulary.yaml").read_text(encoding="utf-8")
    # Everything is text: YAML itself would read "on" and "no" as truth values.
    table: Mapping[str, Any] = yaml.load(text, Loader=yaml.BaseLoader)
    return table


def folded(text: str) -> str:
    """Return a text in small letters, without accents, superscripts and underscores."""
    plain = unicodedata.normalize("NFKD", text.translate(_FOLDED).casefold().translate(_FOLDED))
    return "".join(" " if letter == "_" else letter for letter in plain if not unicodedata.combining(letter))


@cache
def month_names() -> Mapping[str, str]:
    """Return the English abbreviation of each name of a month, in small letters and folded."""
    english = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
    return {name: english[int(number) - 1] for number, names in _table()["months"].items() for name in names}


@cache
def weekday_names() -> frozenset[str]:
    """Return the names of the days of the week and their abbreviations, folded."""
    return frozenset(_table()["weekdays"])


@cache
def halves_of_day() -> Mapping[str, str]:
    """Return ``am`` or ``pm`` for each word that stands for it."""
    return {word: half for half, words in _table()["halves"].items() for word in words}


@cache
def zone_hours() -> Mapping[str, float]:
    """Return the hours ahead of UTC of the abbreviations that are of one zone alone."""
    return {name: float(hours) for name, hours in _table()["zones"]["hours"].items()}


def zones_called(abbreviation: str) -> Sequence[str]:
    """Return zones that share an abbreviation, as IANA names; nothing for one that is of one alone or unknown."""
    zones: Sequence[str] = _table()["zones"]["several"].get(abbreviation, ())
    return zones


@cache
def switch_words() -> Mapping[str, float]:
    """Return 1 or 0 for each word that says on or off, folded."""
    return {folded(word): float(value) for value, words in _table()["switched"].items() for word in words}


@cache
def _words() -> Mapping[str, Sequence[tuple[str, bool]]]:
    """Return each word's spellings, folded, and whether one must stand alone."""
    return {word: _spelt(spellings) for word, spellings in _table()["words"].items()}


def _spelt(words: Iterable[str]) -> list[tuple[str, bool]]:
    """Return words folded, and whether one must stand alone: what has a sign of equality before it."""
    return [(folded(word.removeprefix("=")), word.startswith("=")) for word in words]


def _has_one_of(name: str, spelt: Iterable[tuple[str, bool]]) -> bool:
    """Tell whether a name has one of some words in it, or among its own where that must stand alone."""
    text = folded(name)
    alone = set(re.split(r"\W+", text))
    return any(word in alone if single else word in text for word, single in spelt)


@cache
def rules() -> Mapping[str, Rule]:
    """Return the rule of each quantity."""
    return {
        name: Rule(
            (tuple(rule["all"]), *map(tuple, rule.get("or", ()))),
            tuple(map(tuple, rule.get("by_unit", ()))),
            frozenset(rule["none"]),
            tuple(rule.get("more", ())),
            _table()["unit_of"].get(name, ""),
        )
        for name, rule in _table()["quantities"].items()
    }


@cache
def units() -> Mapping[str, Mapping[str, Unit]]:
    """Return dimension -> spelling (compact) -> unit."""
    found: dict[str, dict[str, Unit]] = {}
    for dimension, table in _table()["units"].items():
        for name, unit in table.items():
            one = Unit(
                name,
                float(unit.get("scale", 1)),
                float(unit.get("offset", 0)),
                cast("Amount", unit.get("amount", "rate")),
            )
            for spelling in (name, *unit["spelt"]):
                found.setdefault(dimension, {})[compact(spelling)] = one
    return found


@cache
def words_of(quantity: str) -> Mapping[str, float]:
    """Return the value of each word, folded, that a quantity's cells may hold in place of a number.

    A vent that is open is open to 100 %, a screen that is closed or on is closed to 100 %.
    """
    if quantity not in OPENINGS and quantity not in CLOSURES:
        return switch_words()
    ends = (100.0, 0.0) if quantity in OPENINGS else (0.0, 100.0)
    found = {word: 100.0 * value for word, value in switch_words().items()}
    for state, value in zip(("open", "closed"), ends, strict=True):
        found |= {folded(word): value for word in _table()["positions"][state]}
    return found


def exact_names() -> Mapping[str, str]:
    """Return names without any word in them -> quantity."""
    names: Mapping[str, str] = _table()["exact"]
    return names


def time_words(kind: str) -> Sequence[tuple[str, bool]]:
    """Return the spellings of a kind of time column (``date_and_time``, ``date``, ``time_of_day``)."""
    return _spelt(_table()["time"][kind])


def is_time(name: str, kind: str) -> bool:
    """Tell whether a column's name is a word for a kind of time column."""
    return _has_one_of(name, time_words(kind))


def is_total(text: str) -> bool:
    """Tell whether a text begins with a word for a sum, a mean or an extreme, such as ``Totaal 01-02-2020``."""
    word = re.match(r"[^\W\d_]+", text)
    return word is not None and folded(word[0]) in _table()["totals"]


def compact(text: str) -> str:
    """Return a unit's text without blanks, dots, carets and brackets."""
    return re.sub(r"[\s.^*·()\[\]{}]", "", folded(text))


@cache
def words_in(name: str) -> frozenset[str]:
    """Return the words that a column's name is made of."""
    split = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    texts = (folded(name), folded(split))
    alone = {token for text in texts for token in re.split(r"[^\w%]+|_", text)}
    return frozenset(
        word
        for word, spellings in _words().items()
        if any(text in alone if single else any(text in one for one in texts) for text, single in spellings)
    )


def unit_texts(name: str) -> list[str]:
    """Return the parts of a column's name that may be a unit, compact: in brackets, after a comma or a dash."""
    parts = _BRACKETS.findall(name)
    rest = _BRACKETS.sub(" | ", name)
    parts += re.split(r"[,;|]|\s-\s|\s/\s", rest)
    parts += rest.split()
    return [text for part in parts if (text := compact(part))]


@cache
def _symbols() -> frozenset[str]:
    return frozenset(compact(symbol) for symbol in _table()["symbols"])


@cache
def _foreign() -> Sequence[str]:
    return [folded(text) for text in _table()["foreign"]]


def unknown_unit(name: str) -> str:
    """Return the unit in a column's name that `units` lacks: ``g/kg`` in brackets, or ``Bft``; empty without one."""
    told = [text for part in _BRACKETS.findall(name) + _BRACKETS.sub(" ", name).split() for text in part.split()]
    foreign = next((text for text in told if folded(text).strip(".,;:") in _foreign()), "")
    if foreign:
        return foreign
    for text in _BRACKETS.findall(name):
        parts = compact(text).split("/")
        if len(parts) > 1 and all(part in _symbols() for part in parts) and not find_units([compact(text)]):
            return str(text)
    return ""


def without_unit(name: str) -> str:
    """Return a column's name without a unit in brackets: the minute of ``l/min`` is no lowest value."""
    for text in _BRACKETS.findall(name):
        if "/" in text and (find_units([compact(text)]) or unknown_unit(f"({text})")):
            name = name.replace(text, "")
    return name


def find_units(texts: Sequence[str]) -> dict[str, Unit]:
    """Return the unit of each dimension that one of some compact texts may be."""
    found: dict[str, Unit] = {}
    for text in texts:
        tenths = _TENTHS.fullmatch(text)
        for dimension, table in units().items():
            if text in table:
                found.setdefault(dimension, table[text])
            elif tenths is not None and tenths[1] in table:
                whole = table[tenths[1]]
                found.setdefault(dimension, replace(whole, name=f"0.1 {whole.name}", scale=0.1 * whole.scale))
    return found


@cache
def _compartment_pattern() -> re.Pattern[str]:
    alone = "|".join(re.escape(folded(word.removeprefix("="))) for word in _table()["compartments"])
    return re.compile(rf"(?:^|[^a-z])({alone})[\s.:#-]*(\d+[a-z]?)(?![\d])")


def compartment(name: str) -> str:
    """Return the compartment that a column's name tells, such as ``afd 4``; empty where it tells none."""
    found = _compartment_pattern().search(folded(name))
    return f"{found[1]} {found[2]}" if found else ""


def is_value(name: str) -> bool:
    """Tell whether a column's name is a word for what was read."""
    return not set(re.split(r"\W+", folded(name))).isdisjoint(_table()["values"])


def is_compartment(name: str) -> bool:
    """Tell whether a column's name is a word for a compartment."""
    return _has_one_of(name, _spelt(_table()["compartments"]))
