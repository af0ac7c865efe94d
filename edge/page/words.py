"""How names, numbers and times are said on the page: in the grower's language and units, in the time of the site."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import datetime, timedelta, tzinfo
from zoneinfo import ZoneInfo

from igrow.core.effects import EFFECTS
from igrow.core.language import LANGUAGES, N_, Language, speak
from igrow.core.language.units import Shown
from igrow.core.quantities import QUANTITIES
from igrow.core.site import Site

DIGITS = {"degC": 1, "%": 0, "ppm": 0, "W m-2": 0, "m s-1": 1, "1": 0, "deg": 0, "kg m-2 h-1": 4, "umol m-2 s-1": 0}
DECIDERS = {
    "override": N_("You"),
    "separating_test": N_("A separating test"),
    "plan": N_("The plan"),
    "last_plan": N_("The last plan"),
    "recipe": N_("Your recipe"),
    "hands_off": N_("The PLC"),
    "interlock": N_("An interlock"),
    "hand": N_("A hand at the PLC"),
    "": N_("Nobody"),
}
LASTING = (
    (172_800.0, 86_400.0, N_("{count} days")),
    (5400.0, 3600.0, N_("{count} h")),
    (90.0, 60.0, N_("{count} min")),
)
_UTC = re.compile(r"\d{2} [A-Z][a-z]{2} \d{2}:\d{2} UTC|\d{4}-\d{2}-\d{2} \d{2}:\d{2} UTC")


@dataclass(frozen=True)
class Words:
    """One language, with the clock and the units of a site."""

    language: Language
    zone: tzinfo

    @classmethod
    def of(cls, site: Site, code: str = LANGUAGES[0]) -> Words:
        """Return a language as a site speaks it."""
        return cls(speak(code, site.time_zone, site.units), ZoneInfo(site.time_zone))

    def text(self, message: str, **values: object) -> str:
        """Return a text of the page, `values` put in for what stands in braces."""
        return self.language.text(message, **values).replace("CO2", "CO₂")

    def spoken(self, name: str) -> str:
        """Return a name as it is said within a sentence, such as "CO₂ setpoint"."""
        return self.language.name(name).replace("co2", "CO2").replace("CO2", "CO₂")

    def title(self, name: str) -> str:
        """Return the name of a point for people, such as "Air temperature"."""
        return _upper(self.spoken(name))

    def effect(self, name: str) -> str:
        """Return what an effect is called."""
        return self.text(EFFECTS[name].title) if name in EFFECTS else self.spoken(name)

    def how(self, name: str) -> Shown:
        """Return how a quantity is shown: fractions in per cent."""
        known = QUANTITIES.get(name)
        if known is None:
            return Shown("")
        return Shown("%", 100.0) if known.unit == "1" else self.language.shown(known.unit)

    def number(self, name: str, value: float | None) -> str:
        """Return a value as it is shown, without its unit; a dash for none."""
        if value is None or not math.isfinite(value):
            return "–"
        registry = QUANTITIES[name].unit if name in QUANTITIES else ""
        return self.language.fixed(self.how(name).of(value), DIGITS.get(registry, 1))

    def shown(self, name: str, value: float | None) -> str:
        """Return a value with its unit, such as "19.4 °C"."""
        text, unit = self.number(name, value), self.how(name).unit
        return text if text == "–" or not unit else f"{text} {unit}"

    def amount(self, value: float, unit: str) -> str:
        """Return a number of a file with its unit of the registry, as it stands there: "5 K", "28 °C"."""
        return self.language.amount(value, unit, 4)

    def euro(self, value: float, *, sign: bool = False) -> str:
        """Return an amount of money for the whole greenhouse."""
        if not math.isfinite(value):
            return "–"
        decimals = 0 if abs(value) >= 1000.0 else 2
        mark = "−" if round(value, decimals) < 0 else "+" if sign and round(value, decimals) > 0 else ""
        return mark + self.text("{amount} €", amount=self.language.fixed(abs(value), decimals))

    def date(self, time: float, pattern: str) -> str:
        """Return a time, seconds since 1970 UTC, as a calendar at the site shows it (`igrow.core.language.locales`)."""
        return self.language.locale.date(self.local(time), pattern)

    def local(self, time: float) -> datetime:
        """Return a time, seconds since 1970 UTC, by the clock of the site."""
        return datetime.fromtimestamp(time, self.zone)

    def when(self, time: float, now: float) -> str:
        """Return a time near `now` as people say it: "07:00", "tomorrow 07:00", "Fri 20 Mar 07:00"."""
        moment, today = self.local(time), self.local(now).date()
        clock = f"{moment:%H:%M}"
        if moment.date() == today:
            return clock
        if moment.date() == today + timedelta(days=1):
            return self.text("tomorrow {time}", time=clock)
        if moment.date() == today - timedelta(days=1):
            return self.text("yesterday {time}", time=clock)
        return f"{self.date(time, 'date')} {clock}"

    def lasting(self, seconds: float) -> str:
        """Return a length of time, roughly: "40 s", "12 min", "3 h", "2 days"."""
        for least, size, text in LASTING:
            if seconds >= least:
                return self.text(text, count=f"{seconds / size:.0f}")
        return f"{max(seconds, 0.0):.0f} s"

    def told(self, line: str, now: float) -> str:
        """Return a line of the daemon: its texts in this language, its names, numbers and times as people say them."""
        return self.language.told(line, lambda part: self._value(part, now)).replace("CO2", "CO₂")

    def sentence(self, line: str, now: float) -> str:
        """Return the same as a sentence: a capital letter, a full stop."""
        return self.whole(self.told(line.strip(), now))

    def whole(self, text: str) -> str:
        """Return a text as a sentence."""
        stop = "。" if self.language.code == "zh" else "."
        return text and _upper(text) + ("" if text.endswith((".", "!", "?", "。", "？")) else stop)

    def _value(self, part: str, now: float) -> str:
        """Return what is no text of ours: times, names, and numbers with their units are found in it."""
        between, times = _UTC.split(part), [self._time(found[0], now) for found in _UTC.finditer(part)]
        return "".join(
            text for pair in zip(map(self.language.values, between), [*times, ""], strict=True) for text in pair
        )

    def _time(self, text: str, now: float) -> str:
        time = _nearest(text, now)
        return text if time is None else self.when(time, now)


def _upper(text: str) -> str:
    return text[:1].upper() + text[1:]


def _nearest(text: str, now: float) -> float | None:
    """Return a time of the daemon, such as "16 Mar 00:00 UTC", in seconds since 1970; of the year nearest to now."""
    if text[4] == "-":
        years, form = [text], "%Y-%m-%d %H:%M UTC %z"
    else:
        # Such a line never speaks of another half year.
        year, form = datetime.fromtimestamp(now).year, "%Y %d %b %H:%M UTC %z"
        years = [f"{one} {text}" for one in (year - 1, year, year + 1)]
    try:
        times = [datetime.strptime(f"{one} +0000", form).timestamp() for one in years]
    except ValueError:
        return None
    return min(times, key=lambda time: abs(time - now))
