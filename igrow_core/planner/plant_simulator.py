"""The mechanistic greenhouse as a planner's simulator: slow, but with nothing left out.

It judges plans (what they do in a plant that no model was fitted to) and trains policies.
"""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from igrow.core.greenhouse import GreenhouseParameters
from igrow.core.greenhouse.disturbances import QUIET
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.sensors import EXACT
from igrow.core.greenhouse.state import PlantState
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.planner.objective import Outcome
from igrow.core.quantities import SETPOINTS
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry

Values = NDArray[np.float64]
_TOTALS = {"heat": ("boiler_in", 1e-6), "electricity": ("electricity", 1 / 3.6e6), "co2": ("co2_dosed", 1.0)}
_STATES = ("air_temperature", "air_humidity", "air_co2", "leaf_area_index")
_CUMULATIVE = ("net_growth", "fruit_fresh_weight")


class PlantSimulator:
    """Runs candidates from the present state of one true greenhouse, under its true weather.

    It keeps that greenhouse's state itself, so `simulate` ignores `initial`; the weather is the table's, so the
    planner's forecast only tells how many hours there are. `follow` carries the greenhouse along a plan.
    """

    def __init__(
        self, parameters: GreenhouseParameters, weather: Telemetry, start: np.datetime64, *, crop: str = "mature"
    ) -> None:
        self._parameters = parameters
        self._weather = WeatherTable(weather)
        self._crop = crop
        self._state = self._plant(1, float(unix_seconds(start))).state

    @property
    def time(self) -> np.datetime64:
        """UTC time of the greenhouse."""
        return np.datetime64(int(self._state.seconds), "s")

    def simulate(self, initial: dict[str, float], weather: Values, setpoints: Values, start: np.datetime64) -> Outcome:
        """Return what candidates do from the present state; see `objective.Simulator`."""
        plant = self._plant(len(setpoints), self._state.seconds)
        plant.restore(repeat(self._state, len(setpoints)))
        return run(plant, setpoints)

    def follow(self, setpoints: Values) -> Outcome:
        """Carry the greenhouse along setpoints (H, 4), and return what happened, arrays (1, 1, H)."""
        plant = self._plant(1, self._state.seconds)
        plant.restore(self._state)
        outcome = run(plant, setpoints[None])
        self._state = plant.saved()
        return outcome

    def measurements(self) -> dict[str, float]:
        """Return the present truth by quantity."""
        plant = self._plant(1, self._state.seconds)
        plant.restore(self._state)
        return {name: float(np.asarray(value).ravel()[0]) for name, value in plant.truth({}).items()}

    def _plant(self, count: int, seconds: float) -> Plant:
        return Plant(
            self._parameters,
            self._weather,
            seconds,
            count=count,
            disturbances=QUIET,
            sensors=EXACT,
            crop=self._crop,
        )


def run(plant: Plant, setpoints: Values) -> Outcome:
    """Carry a batch of B plants along setpoints (B, H, 4); arrays (1, B, H), climate as of each hour's end."""
    columns: dict[str, list[Any]] = {name: [] for name in (*_STATES, *_TOTALS, *_CUMULATIVE)}
    before = _books(plant)
    for hour in range(setpoints.shape[1]):
        command = {name: setpoints[:, hour, column] for column, name in enumerate(SETPOINTS)}
        # Actuators are read as means: those of the last hour, when the hours are over.
        plant.reset_means()
        plant.advance(3600.0, command)
        after = _books(plant)
        for name in _STATES:
            columns[name].append(after[name])
        for name in (*_TOTALS, *_CUMULATIVE):
            columns[name].append(after[name] - before[name])
        before = after
    arrays = {name: np.stack(values, axis=-1)[None] for name, values in columns.items()}
    return Outcome(**arrays, outside=np.zeros_like(arrays["heat"]))


def repeat(state: PlantState, count: int) -> PlantState:
    """Return the state of `count` equal plants from that of a batch of one."""
    repeated: PlantState = _repeat(state, count)
    return repeated


def _repeat(value: Any, count: int) -> Any:
    if isinstance(value, np.ndarray):
        return np.repeat(value, count, axis=-1) if value.shape and value.shape[-1] == 1 else value.copy()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: _repeat(getattr(value, field.name), count) for field in dataclasses.fields(value)}
        return type(value)(**fields)
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return type(value)(*(_repeat(item, count) for item in value))
    if isinstance(value, dict):
        return {key: _repeat(item, count) for key, item in value.items()}
    if isinstance(value, list):
        return [_repeat(item, count) for item in value]
    return copy.deepcopy(value)


def _books(plant: Plant) -> dict[str, Values]:
    truth = plant.truth({})
    like = np.zeros(plant.count or 1)
    books = {name: like + truth[name] for name in (*_STATES, *_CUMULATIVE)}
    for name, (total, scale) in _TOTALS.items():
        books[name] = like + plant.state.totals.get(total, 0.0) * scale
    return books
