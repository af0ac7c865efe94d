"""The plant behind the virtual PLC: one greenhouse that is stepped, read, saved and restored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from igrow.core.greenhouse.climate_computer import SAFE_SETPOINTS
from igrow.core.greenhouse.disturbances import Disturbances
from igrow.core.greenhouse.hidden import HiddenEffect
from igrow.core.greenhouse.parameters import GreenhouseParameters
from igrow.core.greenhouse.plant import Plant
from igrow.core.greenhouse.state import PlantState
from igrow.core.greenhouse.tomato import Crop
from igrow.core.greenhouse.weather_table import WeatherTable
from igrow.core.sun import unix_seconds
from igrow.core.telemetry import Telemetry


class VirtualGreenhouse:
    """One greenhouse with its own climate computer, run step by step.

    Args:
        parameters: of the greenhouse.
        weather: telemetry that covers the time it is to run.
        start: time of the first state, UTC.
        effects: hidden effects.
        seed: of disturbances and sensor noise.
        disturbances: unmodelled fluxes; the default ones if None.
        crop: "mature", "young", or a state of the crop.
    """

    def __init__(
        self,
        parameters: GreenhouseParameters,
        weather: Telemetry,
        start: np.datetime64,
        *,
        effects: Sequence[HiddenEffect] = (),
        seed: int = 0,
        disturbances: Disturbances | None = None,
        crop: str | Crop = "mature",
    ) -> None:
        self._plant = Plant(
            parameters, WeatherTable(weather), float(unix_seconds(start)), effects=effects, seed=seed,
            disturbances=disturbances, crop=crop,
        )  # fmt: skip
        self._setpoints: Mapping[str, float] = dict(SAFE_SETPOINTS)

    @property
    def time(self) -> np.datetime64:
        """The plant's time, UTC, whole seconds."""
        return np.datetime64(int(self._plant.state.seconds), "s")

    def step(self, seconds: float, setpoints: Mapping[str, float] | None = None) -> None:
        """Carry the plant over `seconds`; without setpoints its PLC holds the safe ones.

        Raises:
            IgrowError: where the weather ends.
        """
        self._setpoints = {**SAFE_SETPOINTS, **(setpoints or {})}
        self._plant.reset_means()
        self._plant.advance(seconds, self._setpoints)

    def measurements(self) -> dict[str, float]:
        """Return what the sensors show now, every quantity of the registry; actuators as means of the last step."""
        return {name: float(value) for name, value in self._plant.measured(self.truth()).items()}

    def truth(self) -> dict[str, float]:
        """Return the same without noise and faults, which no controller may see."""
        return {name: float(value) for name, value in self._plant.truth(self._setpoints).items()}

    def resources(self) -> dict[str, float]:
        """Return what was used since the start: heat MJ m-2, electricity kWh m-2, co2 kg m-2, irrigation L m-2."""
        totals = self._plant.state.totals
        return {
            "heat": float(totals.get("boiler_in", 0.0)) / 1e6,
            "electricity": float(totals.get("electricity", 0.0)) / 3.6e6,
            "co2": float(totals.get("co2_dosed", 0.0)),
            "irrigation": float(totals.get("irrigation", 0.0)),
        }

    @property
    def state(self) -> PlantState:
        """A copy of everything that changes, which can be pickled; set it to go on from there."""
        return self._plant.saved()

    @state.setter
    def state(self, saved: PlantState) -> None:
        self._plant.restore(saved)
