"""From a site to the simulator: parameters before any log was seen, and the record of its log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from igrow.core.air import thinness
from igrow.core.arrays import Floats, Times
from igrow.core.simulator.hybrid.log_record import make_record
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.hybrid.record import Record
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry

_REFERENCE = Site(name="reference", latitude=0.0, longitude=0.0).greenhouse
"""The greenhouse that the values of `PARAMETERS` were written down for."""

_CANOPIES = {"tomato": (0.4, 3.0, 35.0, 9.0), "cucumber": (0.3, 3.2, 20.0, 6.0)}
"""Leaf area of transplants and of a full canopy (m2 m-2), days from planting to half of the rise and its width in days.

Usual figures of Dutch practice; the transpiration and assimilation parameters of a site absorb their error.
"""

_EMPTY_DAYS = 30.0
"""Longest time that a greenhouse stands empty before a planting."""


def nominal(site: Site) -> dict[str, float]:
    """Return the physical parameters of a site by name, from its description alone, within their bounds.

    What the description leaves at its default keeps the value of `PARAMETERS`; what it changes scales it.
    """
    values = {name: parameter.value for name, parameter in PARAMETERS.items()}
    greenhouse = site.greenhouse

    def scale(name: str, given: float, reference: float) -> None:
        values[name] *= given / reference if reference > 0.0 else 1.0

    loss = greenhouse.cover_heat_transfer * greenhouse.cover_area_ratio
    scale("cover_heat_transfer", loss, _REFERENCE.cover_heat_transfer * _REFERENCE.cover_area_ratio)
    scale("transmissivity", greenhouse.cover_transmissivity, _REFERENCE.cover_transmissivity)
    scale("leakage_wind", greenhouse.leakage / greenhouse.mean_height, _REFERENCE.leakage / _REFERENCE.mean_height)
    for name in ("vent_wind", "vent_stack"):
        scale(name, greenhouse.vent_area_ratio, _REFERENCE.vent_area_ratio)
    scale("rail_pipe_heat_transfer", greenhouse.rail_pipe_heat_transfer, _REFERENCE.rail_pipe_heat_transfer)
    scale("grow_pipe_heat_transfer", greenhouse.grow_pipe_heat_transfer, _REFERENCE.grow_pipe_heat_transfer)
    for name, screen, reference in (
        ("energy_screen_saving", greenhouse.energy_screen, _REFERENCE.energy_screen),
        ("blackout_screen_saving", greenhouse.blackout_screen, _REFERENCE.blackout_screen),
    ):
        if screen is not None and reference is not None:
            scale(name, screen.saving, reference.saving)
    # Content and ppm are converted as at the sea: what changes thinner air by so many ppm is so much less.
    for name in ("dosing_share", "assimilation_maximum", "respiration"):
        values[name] *= thinness(site.elevation)
    return _within_bounds(values)


def as_described(parameters: Mapping[str, float], site: Site) -> dict[str, float]:
    """Return the parameters of a greenhouse with all defaults, scaled to what a site's description changes of them."""
    described = nominal(site)
    usual = {name: PARAMETERS[name].value for name in parameters}
    ratio = {name: described[name] / value if value else 1.0 for name, value in usual.items()}
    return _within_bounds({name: value * ratio[name] for name, value in parameters.items()})


def _within_bounds(values: Mapping[str, float]) -> dict[str, float]:
    return {name: float(np.clip(value, PARAMETERS[name].low, PARAMETERS[name].high)) for name, value in values.items()}


def leaf_area_curve(site: Site, time: Times) -> Floats:
    """Return an estimate of the leaf area index over time, (n,), from the species and the planting date.

    A logistic rise from transplants. Before the planting an older crop stands, with a full canopy, where the log began
    long before it, and else none.
    """
    planted, full, half, width = _canopy(site)
    days = (time - np.datetime64(site.crop.planting_date, "s")).astype(np.float64) / 86_400.0
    older = (days < 0.0) & np.any(days[:1] < -_EMPTY_DAYS)
    rise = 1.0 / (1.0 + np.exp(-(np.where(older, np.inf, days) - half) / width))
    return np.where((days < 0.0) & ~older, 0.0, planted + (full - planted) * rise)


def _canopy(site: Site) -> tuple[float, float, float, float]:
    return _CANOPIES.get(site.crop.species.lower(), _CANOPIES["tomato"])


def measures_leaf_area(telemetry: Telemetry) -> bool:
    """Tell whether a log has a leaf area."""
    return "leaf_area_index" in telemetry and bool(np.isfinite(telemetry["leaf_area_index"]).any())


def site_record(telemetry: Telemetry, site: Site, step: float) -> Record:
    """Return the record of a site's log on a grid of `step` seconds.

    Without a measured leaf area the crop's usual course stands in, and ``leaf_area_index`` is among the missing.

    Raises:
        TelemetryError: the log has no outdoor_temperature or no air_temperature.
    """
    estimated = not measures_leaf_area(telemetry)
    if estimated:
        telemetry = telemetry.with_columns({"leaf_area_index": leaf_area_curve(site, telemetry.time)})
    record = make_record(
        telemetry,
        step=step,
        latitude=site.latitude,
        longitude=site.longitude,
        mean_height=site.greenhouse.mean_height,
        lamp_efficacy=site.greenhouse.lamps.efficacy if site.greenhouse.lamps is not None else 0.0,
        leaf_area_index=_canopy(site)[1],
    )
    missing = (*record.missing, "leaf_area_index") if estimated else record.missing
    greenhouse = site.greenhouse
    # A greenhouse that cannot dose needs no column to say that it did not; the same of all equipment.
    equipped = {
        "rail_pipe_temperature": greenhouse.rail_pipe_heat_transfer > 0.0,
        "grow_pipe_temperature": greenhouse.grow_pipe_heat_transfer > 0.0,
        "vent_lee": greenhouse.vent_area_ratio > 0.0,
        "vent_wind": greenhouse.vent_area_ratio > 0.0,
        "co2_dosing": greenhouse.co2_dosing_capacity > 0.0,
        "lamp_power": greenhouse.lamps is not None,
        "energy_screen": greenhouse.energy_screen is not None,
        "blackout_screen": greenhouse.blackout_screen is not None,
    }
    return replace(record, missing=tuple(name for name in missing if equipped.get(name, True)))
