"""One language: what it makes of a text, a number, a date, a unit, a line of the daemon."""

from __future__ import annotations

import gettext
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from functools import cache
from importlib import resources
from zoneinfo import ZoneInfo

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.language import sentences
from igrow.core.language.locales import Locale, locale_of
from igrow.core.language.names import NAMES
from igrow.core.language.units import US, US_WORDS, Shown, Units, written
from igrow.core.quantities import QUANTITIES

_UNITS = {unit for one in QUANTITIES.values() for unit in (one.unit, one.difference_unit)} - {"1"} | {"g m-3"}
PART = re.compile(
    r"(?<![\w./-])(?:(?P<name>[a-z0-9]+(?:_[a-z0-9]+)+)|(?P<number>[-−]?\d+(?:\.\d+)?(?:e[-+]\d+)?)(?: (?P<unit>"
    + "|".join(map(re.escape, sorted(_UNITS, key=len, reverse=True)))
    + r"))?)(?![\w/-]|[.:]\w)"
)
"""A name of the program, or a number with what unit it has, within a line."""
_US_WORD = re.compile("|".join(map(re.escape, US_WORDS)))
_TEMPERATURE = re.compile(r"(?<![\w.,/-])([-−]?\d+(?:[.,]\d+)?) (K|degC|°C)(?![\w/])")
LANGUAGES = ("en", "nl", "de", "es", "zh")
"""Codes of the languages; texts are written in the first."""


@dataclass(frozen=True)
class Language:
    """A language, the place whose clock people read, and the units that they use."""

    code: str
    translations: gettext.NullTranslations = field(repr=False)
    time_zone: str = "UTC"
    units: Units = "metric"

    @property
    def locale(self) -> Locale:
        """How numbers and dates are written."""
        return locale_of(self.code)

    def text(self, message: str, **values: object) -> str:
        """Return a text in this language, `values` put in for what stands in braces."""
        told = self.translations.gettext(message) if message else ""
        return told.format(**values) if values else told

    def told(self, line: str, value: Callable[[str], str] = str) -> str:
        """Return a line that was made of a known text and values, such as the daemon's, in this language.

        `value` says what becomes of a part that is no text of ours: a name, a number, words from elsewhere.
        """
        return sentences.told(line, self.translations.gettext, value)

    def values(self, part: str) -> str:
        """Return what of a line is no text of ours: names are told, numbers written as people here do, in their units.

        A number without a unit stays as large as it is: nothing says what it measures.
        """
        return self.name(part) if part in NAMES else PART.sub(self._value, part)

    def _value(self, found: re.Match[str]) -> str:
        if found["name"]:
            return self.name(found["name"])
        if found["unit"]:
            return self.amount(float(found["number"].replace("−", "-")), found["unit"], 4)
        return found["number"].replace(".", self.locale.decimal)

    def in_units(self, text: str) -> str:
        """Return a text of ours with its temperatures in the units that people use: 2 K lower, at 20 degC."""

        def shown(found: re.Match[str]) -> str:
            return self.amount(float(found[1].replace("−", "-").replace(",", ".")), found[2].replace("°C", "degC"), 3)

        return _TEMPERATURE.sub(shown, text) if self.units == "us" else text

    def sized(self, message: str, value: float, unit: str) -> str:
        """Return a text with a size of a unit of the registry in it, `{value}` and `{unit}`.

        Where people use another unit, what the text says of its parts ("for each kelvin") is told in theirs as well.
        """
        shown = self.shown(unit)
        told = self.text(message, value=self.number(shown.of(value)), unit=self.text(shown.unit))
        if self.units == "us" and unit in US and "{unit}" not in message:
            told = _US_WORD.sub(lambda found: US_WORDS[found[0]], told)
        return self.in_units(told)

    def name(self, word: str) -> str:
        """Return what people call a quantity, parameter, balance or reason of the program."""
        known = NAMES.get(word)
        return word.replace("_", " ").replace("co2", "CO2") if known is None else self.text(known)

    def number(self, value: float, digits: int = 2) -> str:
        """Return a number with so many significant digits."""
        if not np.isfinite(value):
            return "–"
        plain = f"{float(f'{value:.{digits}g}'):,.10f}"
        return self.locale.number(plain.rstrip("0").rstrip("."))

    def fixed(self, value: float, decimals: int) -> str:
        """Return a number with so many decimals; a negative zero is none."""
        return self.locale.number(f"{round(value, decimals) + 0.0:,.{decimals}f}") if np.isfinite(value) else "–"

    def shown(self, unit: str) -> Shown:
        """Return how a quantity in a unit of the registry is shown: its unit as people write it, and the way there."""
        known = US.get(unit) if self.units == "us" else None
        return known or Shown(written(unit))

    def unit(self, unit: str) -> str:
        """Return a unit of the registry as people write it."""
        return self.text(self.shown(unit).unit)

    def amount(self, value: float, unit: str, digits: int = 2) -> str:
        """Return a number with its unit."""
        shown = self.shown(unit)
        return f"{self.number(shown.of(value), digits)} {shown.unit}".strip()

    def day(self, time: np.datetime64) -> str:
        """Return the local day of an instant, with its year."""
        return self.locale.date(self._local(time), "day")

    def short_day(self, time: np.datetime64) -> str:
        """Return the local day of an instant as an axis shows it."""
        return self.locale.date(self._local(time), "short_day")

    def moment(self, time: np.datetime64) -> str:
        """Return the local day and time of an instant."""
        return self.locale.date(self._local(time), "moment")

    def listed(self, words: list[str]) -> str:
        """Return words one after the other."""
        return ("、" if self.code == "zh" else ", ").join(words)

    def _local(self, time: np.datetime64) -> datetime:
        seconds = int(time.astype("datetime64[s]").astype(np.int64))
        return datetime.fromtimestamp(seconds, ZoneInfo(self.time_zone))


def speak(code: str, time_zone: str = "UTC", units: Units = "metric") -> Language:
    """Return a language; raises IgrowError with those that there are."""
    if code not in LANGUAGES:
        raise IgrowError(f"language {code!r} is not known: one of {', '.join(LANGUAGES)} is needed")
    return Language(code, _translations(code), time_zone, units)


@cache
def _translations(code: str) -> gettext.NullTranslations:
    if code == LANGUAGES[0]:
        return gettext.NullTranslations()
    with resources.files(__package__).joinpath(f"{code}.mo").open("rb") as file:
        return gettext.GNUTranslations(file)


ENGLISH = speak("en")
