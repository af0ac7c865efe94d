"""A bundle's simulator over a log: what it would have predicted, given the weather and what the actuators did."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from igrow.core import gaps
from igrow.core.arrays import Floats, Integers, Times
from igrow.core.bundle import Bundle, BundleError, open_session
from igrow.core.simulator.hybrid.log_record import make_record
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.core.simulator.hybrid.record import Record
from igrow.core.telemetry import Telemetry

SETTLING = 86_400.0
"""Seconds before the origin in which floor and memories follow the measured climate; it begins at their mean."""
_STAND_INS = {"air_temperature": 20.0, "air_humidity": 75.0, "air_co2": 500.0}
"""What a climate counts as that the log does not measure."""
_TOGETHER = 64
"""Origins in one run of the graph; bounds the memory that a long window takes."""


@dataclass(frozen=True)
class SimulatorSettings:
    """What a bundle's manifest tells its runtime beside the graphs."""

    latitude: float
    longitude: float
    mean_height: float
    lamp_efficacy: float
    leaf_area_index: float
    reference_time: np.datetime64
    """Day zero of the graphs' input `day`."""
    parameters: Mapping[str, float]
    """Values of the graphs' input `parameters` by name, mean of the posterior."""

    @staticmethod
    def of(bundle: Bundle) -> SimulatorSettings:
        """Read them from a bundle.

        Raises:
            BundleError: one is missing or not of its type.
        """
        given = bundle.manifest.simulator
        try:
            return SimulatorSettings(
                latitude=float(given["latitude"]),
                longitude=float(given["longitude"]),
                mean_height=float(given["mean_height"]),
                lamp_efficacy=float(given["lamp_efficacy"]),
                leaf_area_index=float(given["leaf_area_index"]),
                reference_time=np.datetime64(str(given["reference_time"]).removesuffix("Z"), "s"),
                parameters={str(name): float(value) for name, value in dict(given["parameters"]).items()},
            )
        except (KeyError, TypeError, ValueError) as error:
            raise BundleError(f"{bundle.folder}: manifest.json: simulator: {error} is missing or not usable") from None

    def record(self, log: Telemetry, step: float) -> Record:
        """Return the record of a log on a grid of `step` seconds."""
        return make_record(
            log,
            step=step,
            latitude=self.latitude,
            longitude=self.longitude,
            mean_height=self.mean_height,
            lamp_efficacy=self.lamp_efficacy,
            leaf_area_index=self.leaf_area_index,
        )

    def day(self, time: Times) -> Floats:
        """Return days since the reference time."""
        return (time - self.reference_time).astype("timedelta64[s]").astype(np.float64) / 86_400.0


class Hindcast:
    """Runs hindcast.onnx of a bundle."""

    def __init__(self, bundle: Bundle) -> None:
        """Open the graph; raises BundleError where the bundle has none or it is damaged."""
        self.settings = SimulatorSettings.of(bundle)
        self._session = open_session(bundle.graph("hindcast"))
        tensors = {tensor.name: tensor.quantities for tensor in bundle.manifest.graphs["hindcast"].inputs}
        self._inputs = tensors["inputs"]
        self._beginning = tensors["climate"]
        self._parameters = np.array(
            [[self.settings.parameters[name]] for name in tensors["parameters"]], dtype=np.float32
        )

    def run(self, record: Record, origins: Integers, steps: int) -> dict[str, Floats]:
        """Return quantity -> free-run predictions (origins, steps); NaN where the record lacks what is needed.

        Entry [i, k] is for the row `origins[i] + k + 1`, started from the climate measured at row `origins[i]`.
        """
        result = {name: np.full((len(origins), steps), np.nan) for name in PREDICTED}
        if len(record) == 0:
            return result
        filled = {name: _held(record.measured[name], _STAND_INS[name]) for name in PREDICTED}
        usable = np.concatenate([[0], np.cumsum(~record.usable)])
        good = np.array(
            [
                origin + steps < len(record)
                and usable[origin + steps] == usable[origin]
                and np.isfinite(record.measured["air_temperature"][origin])
                for origin in origins
            ],
            dtype=bool,
        )
        for first in range(0, len(origins), _TOGETHER):
            chosen = np.flatnonzero(good[first : first + _TOGETHER]) + first
            if len(chosen):
                shown = self._run(record, filled, origins[chosen], steps)
                for column, name in enumerate(PREDICTED):
                    if np.isfinite(record.measured[name]).any():
                        result[name][chosen] = shown[:, column].T
        return result

    def _run(self, record: Record, filled: Mapping[str, Floats], origins: Integers, steps: int) -> Any:
        settling = min(round(SETTLING / record.step), int(origins.max()))
        rows = np.clip(origins[None, :] + np.arange(-settling, steps)[:, None], 0, None)
        inputs = np.stack([record.inputs[name][rows] for name in self._inputs], axis=1)
        shown = np.stack([filled[name] for name in PREDICTED])
        mean = filled["air_temperature"][rows[: settling + 1]].mean(axis=0)
        beginning = {name: filled[name][rows[0]] for name in PREDICTED} | {"mean_air_temperature": mean}
        feed = {
            "climate": np.stack([beginning[name] for name in self._beginning]),
            "inputs": inputs,
            "measured": np.swapaxes(shown[:, np.minimum(rows + 1, len(record) - 1)], 0, 1),
            "follow": (np.arange(-settling, steps) < 0)[:, None],
            # Ages differ by at most the window's length between columns; the last column's are taken for all.
            "day": self.settings.day(record.time[rows[:, -1]])[:, None],
            "seconds": np.array([record.step]),
            "parameters": self._parameters,
        }
        (predicted,) = self._session.run(
            ["predicted"], {name: np.ascontiguousarray(array, dtype=np.float32) for name, array in feed.items()}
        )
        return predicted[settling:].astype(np.float64)


class HindcastPredictor:
    """Free-run predictions of any bundle over a log; keeps the two bundles last used open."""

    def __init__(self) -> None:
        self._open: dict[str, Hindcast] = {}

    def predict(self, bundle: Bundle, log: Telemetry, origins: Integers, steps: int) -> dict[str, Floats]:
        """Return quantity -> free-run predictions (origins, steps); see `Hindcast.run`.

        `log` lies on a regular grid of its own step. Raises BundleError for a bundle without a usable hindcast.
        """
        if bundle.identity not in self._open:
            if len(self._open) >= 2:
                self._open.pop(next(iter(self._open)))
            self._open[bundle.identity] = Hindcast(bundle)
        hindcast = self._open[bundle.identity]
        return hindcast.run(hindcast.settings.record(log, log.step), origins, steps)


def _held(values: Floats, stand_in: float) -> Floats:
    """Fill gaps by the last value, leading ones by the first; without any value, `stand_in`."""
    return gaps.held(values) if np.isfinite(values).any() else np.full(len(values), stand_in)
