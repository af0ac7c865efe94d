"""What may be missing: every effect of the catalogue at every shape to be tried, and patterns of outside drivers.

A cause without a name may hang on exogenous drivers only: clock, calendar, weather and schedules. Feedback control
reveals disturbances, so that a learner who sees states or what the PLC controls by them (heat, vents, CO2) finds
structure in pure noise. No pattern reads either.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Any

import numpy as np
import yaml
from scipy.signal import lfilter

from igrow.core import sun
from igrow.core.air import LATENT_HEAT
from igrow.core.arrays import Floats
from igrow.core.effects import EFFECTS, Effect
from igrow.core.effects.definition import Parameter
from igrow.core.quantities import WEATHER
from igrow.core.simulator.hybrid.log_record import SWITCHES
from igrow.core.simulator.hybrid.record import Record
from igrow.trainer.diagnosis.design.sensitivity import (
    Linearisation,
    flux_sensitivities,
    is_measured,
    sensor_sensitivities,
    unit_fluxes,
)

_TABLE = yaml.safe_load(files("igrow.trainer.diagnosis").joinpath("design/candidates.yaml").read_text(encoding="utf-8"))
SHAPES: Mapping[str, Mapping[str, Sequence[float]]] = _TABLE["shapes"]
"""Values of nonlinear parameters tried first, by effect."""
CHANNELS: Mapping[str, Mapping[str, Any]] = _TABLE["channels"]
"""In what a pattern may act: `size` of one unit of it and `unit`, `name`, and `balances` that it moves."""
UNIT_FLUX: Mapping[str, float] = {name: one["size"] for name, one in CHANNELS.items()}
EVAPORATION, WEEKLY = "evaporation", "weekly"
WEEKDAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")
_VISIBLE = 1e-9
"""Sensitivity below which a log shows nothing of a candidate."""
_PATTERN_DIFFERENCE = 0.1
"""Finite difference of a pattern's amplitude, in its units."""
_PROCESS_DIFFERENCE = 0.05
"""The same of a process effect's, in typical amplitudes."""


@dataclass(frozen=True)
class Candidate:
    """One effect at one shape."""

    effect: str
    shape: tuple[tuple[str, float], ...]

    @property
    def definition(self) -> Effect:
        """The effect's definition."""
        return EFFECTS[self.effect]

    @property
    def values(self) -> dict[str, float]:
        """Nonlinear parameters by name."""
        return dict(self.shape)

    @property
    def ages(self) -> bool:
        """The effect grows with the time since it began."""
        return "elapsed_days" in self.definition.drivers

    @property
    def key(self) -> str:
        """Name of the column, ``effect:shape=value``."""
        return ":".join([self.effect, *(f"{name}={value:g}" for name, value in self.shape)])


@dataclass(frozen=True)
class Pattern:
    """A course in time that exogenous drivers alone determine, in one channel."""

    channel: str
    when: str
    """For people: at which hours, days or weather."""
    drivers: tuple[str, ...]

    @property
    def key(self) -> str:
        """Name of the column, ``channel:when``."""
        return f"{self.channel}:{self.when}"

    @property
    def is_weekly(self) -> bool:
        """It acts on one day of the week."""
        return any(day in self.when for day in WEEKDAYS)

    @property
    def kind(self) -> str:
        """Its channel; ``weekly`` where it acts on few days, and in which hardly matters to what chance brings."""
        return WEEKLY if self.is_weekly else self.channel


@dataclass(frozen=True)
class EffectColumns:
    """Sensitivities of the errors to the amplitudes of all testable effects."""

    candidates: tuple[Candidate, ...]
    columns: Floats
    """(c, 3, r, steps)."""
    ageing: Floats
    """The same with ``elapsed_days`` at one (0 for those that do not age): shifts their beginning."""
    untestable: tuple[str, ...]
    """Effects whose drivers the log lacks, or never moves."""


def nonlinear_grid(effect: Effect) -> list[dict[str, float]]:
    """Return the shapes at which an effect is tried."""
    known = SHAPES.get(effect.name, {})
    axes = [known.get(shape.name) or _default_axis(shape) for shape in effect.shapes]
    names = [shape.name for shape in effect.shapes]
    return [dict(zip(names, values, strict=True)) for values in itertools.product(*axes)]


def effect_columns(line: Linearisation) -> EffectColumns:
    """Return the sensitivities to all effects but those already active."""
    effects = [effect for effect in EFFECTS.values() if effect.name not in line.effects]
    testable = [effect for effect in effects if not _is_blind(line, effect) and is_measured(line.record, effect)]
    found = [Candidate(effect.name, tuple(shape.items())) for effect in testable for shape in nonlinear_grid(effect)]
    columns = _columns(line, found)
    ageing = np.zeros_like(columns)
    old = [index for index, candidate in enumerate(found) if candidate.ages]
    ageing[old] = _columns(_with_elapsed_one(line), [found[index] for index in old])
    sizes = np.array([abs(one.definition.amplitude.typical) for one in found])
    bounded = line.stays_bounded(columns, sizes) & line.stays_bounded(ageing, sizes)
    seen = [index for index, column in enumerate(columns) if bounded[index] and _is_visible(line, column)]
    names = {found[index].effect for index in seen}
    return EffectColumns(
        tuple(found[index] for index in seen),
        columns[seen],
        ageing[seen],
        tuple(effect.name for effect in effects if effect.name not in names),
    )


def patterns(record: Record, longitude: float) -> list[tuple[str, tuple[str, ...], Floats]]:
    """Return (when, drivers, course (n,)) of every pattern, without the channel."""
    hour = np.asarray(record.inputs["hour"])
    weekday = sun.weekday(sun.solar_day(record.time, longitude))
    working: Floats = (weekday < 5).astype(np.float64)
    table: list[tuple[str, tuple[str, ...], Floats]] = []

    def window(first: float, last: float) -> Floats:
        inside = (hour >= first) & (hour < last) if first < last else (hour >= first) | (hour < last)
        return inside.astype(np.float64)

    for first, last in [(h, h + 2) for h in range(0, 24, 2)] + [(5, 9), (7, 16), (11, 14), (11, 17), (19, 5), (19, 11)]:
        text = f"{first:02d} to {last:02d} h"
        table.append((text, ("hour",), window(first, last)))
        if (first, last) in {(5, 9), (7, 16), (11, 14)}:
            table.append((f"{text} on working days", ("hour", "weekday"), window(first, last) * working))
    table.append(("working days", ("weekday",), working))
    for index, name in enumerate(WEEKDAYS):
        for first, last in ((0, 6), (6, 10), (10, 14), (14, 19), (19, 24)):
            text = f"{first:02d} to {last:02d} h on {name}s"
            table.append((text, ("hour", "weekday"), window(first, last) * (weekday == index)))
    outdoor = np.asarray(record.inputs["outdoor_temperature"], dtype=np.float64)
    cold: Floats = np.maximum(8.0 - outdoor, 0.0) / 8.0
    table.append(("cold weather", ("outdoor_temperature",), cold))
    table.append(("outdoor temperature", ("outdoor_temperature",), (outdoor - 10.0) / 10.0))
    for first, last in ((5, 9), (9, 15), (19, 5), (19, 11)):
        text = f"cold weather, {first:02d} to {last:02d} h"
        table.append((text, ("outdoor_temperature", "hour"), cold * window(first, last)))
    for name, scale in (("wind_speed", 5.0), ("global_radiation", 300.0), ("rain", 1.0)):
        if name not in record.missing:
            table.append((name.replace("_", " "), (name,), np.asarray(record.inputs[name], dtype=np.float64) / scale))
    if "outdoor_humidity" not in record.missing:
        table.append(
            ("dry weather", ("outdoor_humidity",), (80.0 - np.asarray(record.inputs["outdoor_humidity"])) / 20.0)
        )
    if "rain" not in record.missing:
        fallen = np.cumsum(np.asarray(record.inputs["rain"])) * record.step / 72_000.0
        table.append(("until rain has fallen", ("rain",), np.exp(-fallen)))
    # Lamps and irrigation follow the clock and the light, not the climate that they are to be blamed for.
    for name, usual in (("lamp_power", 80.0), ("irrigation", 1.0)):
        driver, scale = (SWITCHES[name], 1.0) if name in record.missing else (name, usual)
        if np.any(record.inputs.get(driver, 0.0)):
            running: Floats = np.asarray(record.inputs[driver], dtype=np.float64) / scale
            text = driver.replace("_", " ")
            table.append((text if driver == SWITCHES[name] else f"{text} on", (driver,), running))
            keep = float(np.exp(-record.step / 3600.0))
            table.append((f"an hour after {text}", (driver,), lfilter([1.0 - keep], [1.0, -keep], running)))
    if "global_radiation" not in record.missing:
        # A crop that grows respires a share of what it has assimilated, by night too (McCree 1970, Prediction and
        # Measurement of Photosynthetic Productivity, Pudoc, 221-229).
        table.append(("light of the last days", ("global_radiation", "lamp_power"), light_of_the_last_days(record)))
    days = np.arange(len(record)) * record.step / 86_400.0
    table.append(("from day to day", ("time",), np.asarray(days / 30.0)))
    table.append(("all the time", (), np.ones(len(record))))
    return table


def light_of_the_last_days(record: Record) -> Floats:
    """Return the light at the leaves as a store of a day remembers it, (n,), in units of a dull day's mean, 15 W m-2.

    About three tenths of the global radiation reach them as light, and half of the lamps' power.
    """
    sun, lamps = record.inputs["global_radiation"], record.inputs.get("lamp_power", 0.0)
    light = 0.3 * np.asarray(sun, dtype=np.float64) + 0.5 * np.asarray(lamps, dtype=np.float64)
    keep = float(np.exp(-record.step / 86_400.0))
    # Before the log it was as on its first day.
    before = keep * float(np.mean(light[: round(86_400.0 / record.step)]))
    followed, _ = lfilter([1.0 - keep], [1.0, -keep], light / 15.0, zi=[before / 15.0])
    return np.asarray(followed, dtype=np.float64)


def pattern_fluxes(record: Record, longitude: float, amplitudes: Mapping[Pattern, float]) -> dict[str, Floats]:
    """Return the fluxes of patterns by channel, (n,); amplitudes are in units of `UNIT_FLUX`."""
    table = (*patterns(record, longitude), *weekly_patterns(record, longitude))
    courses = {when: course for when, _, course in table}
    fluxes: dict[str, Floats] = {}
    for pattern, amplitude in amplitudes.items():
        for channel, flux in _fluxes(pattern.channel, amplitude * courses[pattern.when]).items():
            fluxes[channel] = fluxes.get(channel, 0.0) + flux
    return fluxes


def _fluxes(channel: str, course: Floats) -> dict[str, Floats]:
    """Return what a pattern of a course, in units of its channel, brings into the balances."""
    flux = UNIT_FLUX[channel] * course
    return {"vapour": flux, "heat": -LATENT_HEAT * flux} if channel == EVAPORATION else {channel: flux}


def weekly_patterns(record: Record, longitude: float) -> list[tuple[str, tuple[str, ...], Floats]]:
    """Return (when, drivers, course (n,)) of four hours on one day of the week, from every other hour on."""
    hour, day = np.asarray(record.inputs["hour"]), sun.weekday(sun.solar_day(record.time, longitude))
    return [
        (
            f"{first:02d} to {first + 4:02d} h on {name}s",
            ("hour", "weekday"),
            ((hour >= first) & (hour < first + 4) & (day == index)).astype(np.float64),
        )
        for index, name in enumerate(WEEKDAYS)
        for first in range(0, 22, 2)
    ]


def pattern_columns(line: Linearisation, longitude: float) -> tuple[tuple[Pattern, ...], Floats]:
    """Return every pattern in every channel but evaporation, and their columns of the errors, (p, 3, r, steps)."""
    return _pattern_columns(line, patterns(line.record, longitude), [one for one in CHANNELS if one != EVAPORATION])


def finer_columns(line: Linearisation, longitude: float) -> tuple[tuple[Pattern, ...], Floats]:
    """Return the same of what a search leaves out: patterns of evaporation, and `weekly_patterns` in every channel."""
    lasting = [one for one in patterns(line.record, longitude) if not Pattern(EVAPORATION, *one[:2]).is_weekly]
    evaporating, one = _pattern_columns(line, lasting, [EVAPORATION])
    weekly, other = _pattern_columns(line, weekly_patterns(line.record, longitude), list(CHANNELS))
    return (*evaporating, *weekly), np.concatenate([one, other])


def _pattern_columns(
    line: Linearisation, table: Sequence[tuple[str, tuple[str, ...], Floats]], channels: Sequence[str]
) -> tuple[tuple[Pattern, ...], Floats]:
    found: list[Pattern] = []
    fluxes: list[tuple[Mapping[str, Floats], float]] = []
    for when, drivers, course in table:
        if not np.any(course):
            continue
        for channel in channels:
            found.append(Pattern(channel, when, drivers))
            fluxes.append((_fluxes(channel, course), _PATTERN_DIFFERENCE))
    columns = flux_sensitivities(line, fluxes)
    bounded = line.stays_bounded(columns, np.ones(len(columns)))
    kept = [index for index, column in enumerate(columns) if bounded[index] and _is_visible(line, column)]
    return tuple(found[index] for index in kept), columns[kept]


def _is_visible(line: Linearisation, column: Floats) -> bool:
    return bool(np.any(np.abs(column[line.runs.weight]) > _VISIBLE))


def hidden_by_missing_weather(line: Linearisation) -> tuple[str, ...]:
    """Return the effects that may be what another cause is named for, as the log lacks the weather that they follow.

    A leak that grows with the wind makes the air colder and drier. Where the log has no wind, a sensor that is off or a
    vent that does not close is the best that is left. They are those that every model has to some extent, as a
    parameter (`Effect.resembles`): any greenhouse may have come by more of it.
    """
    found = [
        Candidate(effect.name, tuple((shape.name, shape.typical) for shape in effect.shapes))
        for effect in EFFECTS.values()
        if effect.resembles and effect.drivers[0] in WEATHER and effect.drivers[0] in line.record.missing
    ]
    columns = _columns(line, found)
    return tuple(one.effect for one, column in zip(found, columns, strict=True) if _is_visible(line, column))


def _is_blind(line: Linearisation, effect: Effect) -> bool:
    """Tell whether the log lacks a driver for which nothing can stand in.

    An actuator that is not logged counts as equipment that is not there: its effects show nothing. The leaf area is
    estimated where it is not measured, which does for all effects but the one that is about it.
    """
    lacking = set(effect.drivers) & set(line.record.missing)
    return bool(lacking & set(WEATHER)) or (effect.drivers[0] == "leaf_area_index" and bool(lacking))


def _columns(line: Linearisation, candidates: Sequence[Candidate]) -> Floats:
    columns = np.zeros((len(candidates), *line.shown.shape))
    process = [index for index, one in enumerate(candidates) if one.definition.kind == "process"]
    fluxes = [
        (
            unit_fluxes(line, candidates[index].definition, candidates[index].values),
            _PROCESS_DIFFERENCE * abs(candidates[index].definition.amplitude.typical),
        )
        for index in process
    ]
    columns[process] = flux_sensitivities(line, fluxes)
    sensors = [index for index, one in enumerate(candidates) if one.definition.kind == "sensor"]
    faults = [(candidates[index].definition, candidates[index].values) for index in sensors]
    columns[sensors] = sensor_sensitivities(line, faults)
    return columns


def _with_elapsed_one(line: Linearisation) -> Linearisation:
    ones = np.ones(len(line.record))
    record = replace(line.record, inputs={**line.record.inputs, "elapsed_days": ones})
    return replace(line, record=record, drivers={**line.drivers, "elapsed_days": ones})


def _default_axis(shape: Parameter) -> tuple[float, ...]:
    return 0.5 * (shape.low + shape.typical), shape.typical, 0.5 * (shape.high + shape.typical)
