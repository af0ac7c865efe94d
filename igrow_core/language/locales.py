"""How a language writes numbers and dates, by Unicode CLDR (`locales.json`, written by `make translations`)."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from importlib import resources
from typing import Any

_FIELD = re.compile(r"'([^']*)'|([dMyEHm])\2*")


@dataclass(frozen=True)
class Locale:
    """The signs, names and patterns of one language."""

    decimal: str
    group: str
    months: tuple[str, ...]
    """January first."""
    short_months: tuple[str, ...]
    weekdays: tuple[str, ...]
    """Monday first."""
    short_weekdays: tuple[str, ...]
    patterns: Mapping[str, str]
    """CLDR's, such as "d MMMM y", by what they are for."""

    def number(self, plain: str) -> str:
        """Return a number as Python writes it ("1,234.5") with the language's signs."""
        return plain.translate(str.maketrans(",.", self.group + self.decimal))

    def date(self, moment: datetime, pattern: str) -> str:
        """Return a local time by one of the patterns."""
        told = {
            "d": str(moment.day), "M": str(moment.month), "MMM": self.short_months[moment.month - 1],
            "MMMM": self.months[moment.month - 1], "y": str(moment.year), "E": self.short_weekdays[moment.weekday()],
            "EEEE": self.weekdays[moment.weekday()], "HH": f"{moment:%H}", "mm": f"{moment:%M}",
        }  # fmt: skip
        return _FIELD.sub(lambda found: found[1] if found[1] is not None else told[found[0]], self.patterns[pattern])


@cache
def locale_of(code: str) -> Locale:
    """Return how a language writes numbers and dates."""
    text = resources.files(__package__).joinpath("locales.json").read_text(encoding="utf-8")
    known: dict[str, Any] = json.loads(text)[code]
    names = {key: tuple(known[key]) for key in ("months", "short_months", "weekdays", "short_weekdays")}
    return Locale(decimal=known["decimal"], group=known["group"], patterns=known["patterns"], **names)
