"""How names, numbers and times are said on the page: in the grower's units, in the time of the site."""

from __future__ import annotations

import math
import re
from datetime import datetime, timedelta, tzinfo

from igrow.core.quantities import QUANTITIES

UNITS = {
    "degC": "°C",
    "umol m-2 s-1": "µmol/m²s",
    "W m-2": "W/m²",
    "m s-1": "m/s",
    "kg m-2": "kg/m²",
    "kg m-2 h-1": "kg/m²h",
    "L m-2 h-1": "l/m²h",
    "m2 m-2": "m²/m²",
    "fruits m-2": "fruits/m²",
    "deg": "°",
    "1": "%",
}
"""By the registry's unit; fractions are said in per cent."""
DIGITS = {"degC": 1, "%": 0, "ppm": 0, "W m-2": 0, "m s-1": 1, "1": 0, "deg": 0, "kg m-2 h-1": 4, "umol m-2 s-1": 0}
TITLES = {
    "lamp_on": "Lamps",
    "irrigation_on": "Irrigation",
    "par": "Light at the crop",
    "global_radiation": "Sun outside",
    "lamp_power": "Power of the lamps",
}
DECIDERS = {
    "override": "You",
    "plan": "The plan",
    "last_plan": "The last plan",
    "recipe": "Your recipe",
    "hands_off": "The PLC",
    "interlock": "An interlock",
    "hand": "A hand at the PLC",
    "": "Nobody",
}
_NAME = re.compile(r"\b[a-z0-9]+(?:_[a-z0-9]+)+\b")
_UTC = re.compile(r"\b(\d{2} [A-Z][a-z]{2} \d{2}:\d{2}) UTC\b")


def title(name: str) -> str:
    """Return the name of a point for people, such as "CO₂ setpoint"."""
    text = TITLES.get(name) or spoken(name)
    return text[:1].upper() + text[1:]


def spoken(name: str) -> str:
    """Return a name as it is said within a sentence, such as "air CO₂"."""
    return name.replace("_", " ").replace("co2", "CO₂")


def registry_unit(name: str) -> str:
    """Return the unit of the registry; nothing for what is no quantity."""
    return QUANTITIES[name].unit if name in QUANTITIES else ""


def unit(name: str) -> str:
    """Return the unit in which a quantity is shown."""
    return UNITS.get(registry_unit(name), registry_unit(name))


def scale(name: str) -> float:
    """Return by what a value of the registry is multiplied to be shown."""
    return 100.0 if registry_unit(name) == "1" else 1.0


def number(name: str, value: float | None) -> str:
    """Return a value as it is shown, without its unit; a dash for none."""
    if value is None or not math.isfinite(value):
        return "–"
    # 0.0 added to a negative zero makes it plain.
    return f"{round(value * scale(name), DIGITS.get(registry_unit(name), 1)) + 0.0:.{digits(name)}f}"


def digits(name: str) -> int:
    """Return the decimals that a quantity is shown with."""
    return DIGITS.get(registry_unit(name), 1)


def shown(name: str, value: float | None) -> str:
    """Return a value with its unit, such as "19.4 °C"."""
    text = number(name, value)
    return text if text == "–" or not unit(name) else f"{text} {unit(name)}"


def euro(value: float, *, sign: bool = False) -> str:
    """Return an amount of money for the whole greenhouse."""
    if not math.isfinite(value):
        return "–"
    decimals = 0 if abs(value) >= 1000.0 else 2
    mark = "−" if round(value, decimals) < 0 else "+" if sign and round(value, decimals) > 0 else ""
    return f"{mark}{abs(value):,.{decimals}f} €"


def local(time: float, zone: tzinfo, form: str = "%a %d %b %H:%M") -> str:
    """Return a time, seconds since 1970 UTC, as a clock at the site shows it."""
    return f"{datetime.fromtimestamp(time, zone):{form}}"


def when(time: float, now: float, zone: tzinfo) -> str:
    """Return a time near `now` as people say it: "07:00", "tomorrow 07:00", "yesterday 22:15", "Fri 20 Mar 07:00"."""
    moment, today = datetime.fromtimestamp(time, zone), datetime.fromtimestamp(now, zone).date()
    days = {today: "", today + timedelta(days=1): "tomorrow ", today - timedelta(days=1): "yesterday "}
    prefix = days.get(moment.date())
    return f"{moment:%a %d %b %H:%M}" if prefix is None else f"{prefix}{moment:%H:%M}"


def lasting(seconds: float) -> str:
    """Return a length of time, roughly: "40 s", "12 min", "3 h", "2 days"."""
    for size, word in ((172_800.0, "days"), (5400.0, "h"), (90.0, "min")):
        if seconds >= size:
            return f"{seconds / {'days': 86_400.0, 'h': 3600.0, 'min': 60.0}[word]:.0f} {word}"
    return f"{max(seconds, 0.0):.0f} s"


def in_local_time(text: str, now: float, zone: tzinfo) -> str:
    """Return a line of the daemon with its times, such as "16 Mar 00:00 UTC", as a clock at the site shows them."""

    def said(found: re.Match[str]) -> str:
        year = datetime.fromtimestamp(now, zone).year
        try:
            # The year nearest to now: such a line never speaks of another half year.
            times = [
                datetime.strptime(f"{one} {found[1]} +0000", "%Y %d %b %H:%M %z").timestamp()
                for one in (year - 1, year, year + 1)
            ]
        except ValueError:
            return found[0]
        return when(min(times, key=lambda time: abs(time - now)), now, zone)

    return _UTC.sub(said, text)


def sentence(text: str) -> str:
    """Return a line of the daemon as a sentence: names as people say them, a capital letter, a full stop."""
    text = _NAME.sub(lambda found: spoken(found[0]), text.strip())
    return text and text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) else ".")
