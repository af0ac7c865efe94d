"""Rates of what a log tells only as switched on or off: at most what the site's equipment can do."""

from __future__ import annotations

from dataclasses import replace

from igrow.core.site import Site
from igrow.trainer.data.mapping import ColumnMapping


def by_capacity(quantity: str, rule: ColumnMapping, highest: float, site: Site | None) -> ColumnMapping | None:
    """Return a switch (0 to 1, or to 100) as a rate of what the site can do, or None where that is not known."""
    if site is None or not 0.0 < highest <= 100.0 or (highest > 1.0 and highest < 90.0):
        return None
    share = 1.0 if highest <= 1.0 else 0.01
    if quantity == "co2_dosing" and site.greenhouse.co2_dosing_capacity > 0.0:
        return replace(rule, scale=share * site.greenhouse.co2_dosing_capacity)
    if quantity == "lamp_power" and site.greenhouse.lamps is not None:
        return replace(rule, scale=share * site.greenhouse.lamps.power)
    return None


def add_lamp_power(rules: dict[str, ColumnMapping], units: dict[str, str], site: Site | None) -> str:
    """Give the lamps' power where the log tells only that they burn; returns a note, or nothing."""
    if "lamp_on" not in rules or "lamp_power" in rules or site is None or site.greenhouse.lamps is None:
        return ""
    rule = rules["lamp_on"]
    power = site.greenhouse.lamps.power
    rules["lamp_power"] = replace(rule, scale=rule.scale * power)
    units["lamp_power"] = units["lamp_on"]
    return f"lamp_power is {power:g} W m-2, as the site says, where {rule.column!r} says that lamps burn"
