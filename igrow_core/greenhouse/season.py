"""A stretch of time through the plant: the log of one greenhouse or of a batch, and what it used."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from igrow.core import gaps
from igrow.core.errors import IgrowError
from igrow.core.greenhouse.disturbances import Disturbances, combined
from igrow.core.greenhouse.hidden import HiddenEffect
from igrow.core.greenhouse.parameters import GreenhouseParameters, stack
from igrow.core.greenhouse.plant import TICK, Plant
from igrow.core.greenhouse.sensors import Sensors
from igrow.core.greenhouse.tomato import Crop
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.quantities import QUANTITIES, SETPOINTS
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry

Schedule = Callable[[np.datetime64], Mapping[str, Any]]
"""Setpoints at a time (UTC); values are floats or, for a batch, arrays (N,)."""

RESOURCES = ("heat", "electricity", "co2", "irrigation", "drain")


STEP = 300
"""Seconds between the rows of a log."""


@dataclass(frozen=True)
class Season:
    """What one greenhouse did.

    Rows of `measured` and `true` are `step` apart: states and weather at the row's time, actuators and setpoints as
    means over the step before it. They hold all quantities of the registry.
    """

    measured: Telemetry
    """As the sensors show it, with noise, resolution and sensor faults."""
    true: Telemetry
    resources: Mapping[str, NDArray[np.float64]] = field(repr=False)
    """Cumulative at each row: heat MJ m-2, electricity kWh m-2, co2 kg m-2, irrigation and drain L m-2."""
    crop: Crop = field(repr=False)
    """At the last row: where a later season of the same greenhouse begins; in a batch each value is an array (1,)."""

    def total(self, name: str) -> float:
        """Return the season's use of one resource."""
        return float(self.resources[name][-1])


def simulate(
    parameters: GreenhouseParameters,
    weather: Telemetry,
    setpoints: Telemetry | Schedule,
    start: np.datetime64,
    end: np.datetime64,
    *,
    seed: int,
    effects: Sequence[HiddenEffect] = (),
    disturbances: Disturbances | None = None,
    sensors: Sensors | None = None,
    tick: float = TICK,
    crop: str | Crop = "mature",
) -> Season:
    """Run one greenhouse from `start` to `end` (UTC) and return its log.

    Args:
        parameters: of the greenhouse.
        weather: any telemetry with outdoor_temperature, outdoor_humidity, global_radiation and wind_speed.
        setpoints: a table (each row holds until the next) or a function of time.
        start: first row.
        end: last row at the latest.
        seed: of disturbances and sensor noise.
        effects: what happens in the plant without the model knowing.
        disturbances: unmodelled fluxes; `disturbances.QUIET` for none.
        sensors: noise; `sensors.EXACT` for none.
        tick: longest step of the climate, s.
        crop: "mature", "young", or a state of the crop.

    Raises:
        IgrowError: where weather or setpoints do not cover the time.
    """
    plant = Plant(
        parameters, WeatherTable(weather), float(unix_seconds(start)), effects=effects, disturbances=disturbances,
        sensors=sensors, crop=crop, seed=seed, tick=tick,
    )  # fmt: skip
    return _run(plant, _schedule(setpoints), end)[0]


def simulate_many(
    parameters: GreenhouseParameters | Sequence[GreenhouseParameters],
    weather: Telemetry | Sequence[Telemetry],
    setpoints: Telemetry | Sequence[Telemetry] | Schedule,
    start: np.datetime64,
    end: np.datetime64,
    *,
    count: int,
    seed: int,
    effects: Sequence[HiddenEffect] | Sequence[Sequence[HiddenEffect]] = (),
    disturbances: Disturbances | Sequence[Disturbances] | None = None,
    sensors: Sensors | None = None,
    crop: str | Crop = "mature",
    reached: Callable[[np.datetime64], None] | None = None,
) -> list[Season]:
    """Run a batch of `count` greenhouses at once; arguments as in `simulate`.

    Parameters, weather, setpoint tables, lists of effects and disturbances may be one for all or a sequence of `count`.
    `reached` is told of the time of each row.

    A batch of one runs as `simulate` does, on floats: numpy costs more than such an array's arithmetic.
    """
    if count == 1:
        parameters, weather, setpoints, disturbances = (
            _only(one) for one in (parameters, weather, setpoints, disturbances)
        )
        effects = effects if all(isinstance(one, HiddenEffect) for one in effects) else _only(effects)
        crop = crop if isinstance(crop, str) else Crop(*(_alone(part) for part in crop))
    if not isinstance(parameters, GreenhouseParameters):
        if len(parameters) != count:
            raise IgrowError(f"a batch of {count} greenhouses needs {count} sets of parameters, not {len(parameters)}")
        parameters = stack(parameters)
    if disturbances is not None and not isinstance(disturbances, Disturbances):
        if len(disturbances) != count:
            raise IgrowError(f"a batch of {count} greenhouses needs {count} disturbances, not {len(disturbances)}")
        disturbances = combined(disturbances)
    plant = Plant(
        parameters, WeatherTable(weather), float(unix_seconds(start)), count=None if count == 1 else count,
        effects=effects, disturbances=disturbances, sensors=sensors, crop=crop, seed=seed,
    )  # fmt: skip
    seasons = _run(plant, _schedule(setpoints), end, reached)
    if count == 1:
        grown = Crop(*(np.asarray(part)[..., None] for part in seasons[0].crop))
        return [replace(seasons[0], crop=grown)]
    return seasons


def _alone(part: Any) -> Any:
    """Return a part of the crop of a batch of one as a single greenhouse has it: a float, or (STAGES,)."""
    values = np.ravel(part)
    return values if values.size > 1 else float(values[0])


def _only(given: Any) -> Any:
    """Return what the one greenhouse of a batch has, of something that is one for all or a sequence.

    Raises:
        IgrowError: it is a sequence of more or less than one.
    """
    if not isinstance(given, Sequence):
        return given
    if len(given) != 1:
        raise IgrowError(f"a batch of one greenhouse needs one of each, not {len(given)}")
    return given[0]


def _schedule(setpoints: Telemetry | Sequence[Telemetry] | Schedule) -> Schedule:
    if isinstance(setpoints, Telemetry):
        return _held(setpoints)
    if callable(setpoints):
        return setpoints
    tables = [_held(table) for table in setpoints]

    def together(time: np.datetime64) -> dict[str, Any]:
        rows = [table(time) for table in tables]
        return {name: np.array([row[name] for row in rows]) for name in rows[0]}

    return together


def _held(table: Telemetry) -> Schedule:
    """Return a schedule that holds each row of a table until the next."""
    names = [name for name in SETPOINTS if name in table]
    if not names:
        raise IgrowError(f"setpoints: the table has none of {', '.join(SETPOINTS)}")
    filled = {name: _filled(table[name]) for name in names}

    def at(time: np.datetime64) -> dict[str, float]:
        index = max(int(np.searchsorted(table.time, time, side="right")) - 1, 0)
        return {name: float(filled[name][index]) for name in names}

    return at


def _filled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values with each gap filled by the last value before it (the first one at the beginning)."""
    if not np.isfinite(values).any():
        raise IgrowError("setpoints: a column without any value; leave it out instead")
    return gaps.held(values)


def _run(
    plant: Plant,
    schedule: Schedule,
    end: np.datetime64,
    reached: Callable[[np.datetime64], None] | None = None,
) -> list[Season]:
    seconds = int(plant.state.seconds)
    rows = (int(unix_seconds(end)) - seconds) // STEP + 1
    times = np.datetime64(seconds, "s") + np.arange(rows) * np.timedelta64(STEP, "s")
    count = plant.count or 1
    logs: dict[str, dict[str, NDArray[np.float64]]] = {"true": {}, "measured": {}, "resources": {}}
    command: Mapping[str, Any] = schedule(times[0])
    for row in range(rows):
        if row:
            command = schedule(times[row - 1])
            plant.advance(STEP, command)
        truth = plant.truth(command)
        for kind, values in (
            ("true", truth),
            ("measured", plant.measured(truth)),
            ("resources", _resources(plant)),
        ):
            log = logs[kind]
            for name, value in values.items():
                if name not in log:
                    log[name] = np.full((rows, count), np.nan)
                log[name][row] = value
        plant.reset_means()
        if reached is not None:
            reached(times[row])
    return [
        Season(
            measured=_table(times, logs["measured"], column),
            true=_table(times, logs["true"], column),
            resources={name: values[:, column].copy() for name, values in logs["resources"].items()},
            crop=_one_crop(plant, column),
        )
        for column in range(count)
    ]


def _one_crop(plant: Plant, column: int) -> Crop:
    if plant.count is None:
        return plant.state.crop
    return Crop(*(np.asarray(part)[..., column : column + 1].copy() for part in plant.state.crop))


def _table(times: NDArray[Any], log: Mapping[str, NDArray[np.float64]], column: int) -> Telemetry:
    return Telemetry(times, {name: log[name][:, column] for name in QUANTITIES if name in log})


def _resources(plant: Plant) -> dict[str, Any]:
    totals = plant.state.totals
    return {
        "heat": totals.get("boiler_in", 0.0) / 1e6,
        "electricity": totals.get("electricity", 0.0) / 3.6e6,
        "co2": totals.get("co2_dosed", 0.0),
        "irrigation": totals.get("irrigation", 0.0),
        "drain": totals.get("drain", 0.0),
    }
