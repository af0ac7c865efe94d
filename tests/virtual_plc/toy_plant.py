"""A plant of one equation: the air follows the heating setpoint."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np


class ToyPlant:
    def __init__(self) -> None:
        self.time = np.datetime64("2020-01-01T00:00:00")
        self.air_temperature = 15.0
        self.air_humidity = 80.0
        self.history: list[Mapping[str, float]] = []

    def step(self, seconds: float, setpoints: Mapping[str, float]) -> None:
        self.time = self.time + np.timedelta64(round(seconds * 1000), "ms")
        self.air_temperature += 0.1 * (setpoints["heating_setpoint"] - self.air_temperature)
        self.history.append(dict(setpoints))

    def measurements(self) -> Mapping[str, float]:
        return {
            "air_temperature": self.air_temperature,
            "air_humidity": self.air_humidity,
            "vent_lee": 33.3,
            "rail_pipe_temperature": 1e6,
        }
