"""One language: what it makes of a text, a number, a date, a unit."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
from babel import Locale
from babel.dates import format_date, format_datetime, format_skeleton
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po
from babel.numbers import format_decimal
from babel.support import NullTranslations, Translations

from igrow.core.errors import IgrowError
from igrow.core.local_time import to_local, utc_datetime
from igrow.trainer.language.names import NAMES
from igrow.trainer.language.units import written

LANGUAGES = ("en", "nl", "de", "es", "zh")
"""Codes of the languages; texts are written in the first."""

_MOMENTS = {"zh": "y年M月d日 HH:mm"}
"""How a day and its time are written where the day does not come first."""


@dataclass(frozen=True)
class Language:
    """A language and the place whose clock people read."""

    code: str
    translations: NullTranslations = field(repr=False)
    time_zone: str = "UTC"

    @property
    def locale(self) -> Locale:
        """Babel's rules for numbers and dates."""
        return Locale.parse(self.code)

    def text(self, message: str, **values: object) -> str:
        """Return a text in this language, `values` put in for what stands in braces."""
        told: str = self.translations.gettext(message)
        return told.format(**values) if values else told

    def name(self, word: str) -> str:
        """Return what people call a quantity, parameter, balance or reason of the program."""
        known = NAMES.get(word)
        return word.replace("_", " ") if known is None else self.text(known)

    def number(self, value: float, digits: int = 2) -> str:
        """Return a number with so many significant digits."""
        if not np.isfinite(value):
            return "–"
        return str(format_decimal(float(f"{value:.{digits}g}"), format="#,##0.##########", locale=self.locale))

    def unit(self, unit: str) -> str:
        """Return a unit of the registry as people write it."""
        return written(unit)

    def amount(self, value: float, unit: str, digits: int = 2) -> str:
        """Return a number with its unit."""
        return f"{self.number(value, digits)} {self.unit(unit)}".strip()

    def day(self, time: np.datetime64) -> str:
        """Return the local day of an instant, with its year."""
        return str(format_date(self._local(time), "long", self.locale))

    def short_day(self, time: np.datetime64) -> str:
        """Return the local day of an instant as an axis shows it."""
        return str(format_skeleton("MMMd", self._local(time), locale=self.locale))

    def moment(self, time: np.datetime64) -> str:
        """Return the local day and time of an instant."""
        return str(format_datetime(self._local(time), _MOMENTS.get(self.code, "d MMM y HH:mm"), locale=self.locale))

    def listed(self, words: list[str]) -> str:
        """Return words one after the other."""
        return ("、" if self.code == "zh" else ", ").join(words)

    def _local(self, time: np.datetime64) -> Any:
        local = to_local(np.array([time], dtype="datetime64[s]"), self.time_zone)[0]
        return utc_datetime(local).replace(tzinfo=None)


def speak(code: str, time_zone: str = "UTC") -> Language:
    """Return a language; raises IgrowError with those that there are."""
    if code not in LANGUAGES:
        raise IgrowError(f"language {code!r} is not known: one of {', '.join(LANGUAGES)} is needed")
    return Language(code, _translations(code), time_zone)


@cache
def _translations(code: str) -> NullTranslations:
    if code == LANGUAGES[0]:
        return NullTranslations()
    compiled = io.BytesIO()
    with resources.files(__package__).joinpath(f"{code}.po").open("rb") as file:
        write_mo(compiled, read_po(file, code))
    compiled.seek(0)
    return Translations(compiled)


ENGLISH = speak("en")
