"""A bounded learned residual model of the balances on exogenous drivers only: weather, clock and sun.

Actuators and states are left out on purpose: the PLC's control reveals the disturbance, so that a learner given
its signals finds structure in noise. Ridge regression of the missing fluxes on a few features, hourly means,
its strength chosen on the selection weeks, the result bounded to what was seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from igrow.core.arrays import Floats, Mask
from igrow.core.simulator.hybrid.record import Record

FEATURES = (
    "global_radiation",
    "radiation_squared",
    "radiation_east",
    "radiation_south",
    "radiation_low_sun",
    "outdoor_temperature",
    "sky_depression",
    "wind_speed",
    "rain",
    "outdoor_humidity",
    "hour_sine",
    "hour_cosine",
    "half_day_sine",
    "half_day_cosine",
)
"""What the residual model is a linear function of."""


@dataclass(frozen=True)
class ResidualModel:
    """Fluxes by channel as bounded linear functions of `FEATURES`."""

    centre: Floats
    """(f,)."""
    scale: Floats
    """(f,)."""
    weights: Mapping[str, Floats]
    """By channel, (f + 1,), the constant last; heat W m-2, vapour and CO2 kg m-2 s-1."""
    bounds: Mapping[str, tuple[float, float]]
    """Least and most of each flux."""

    def fluxes(self, record: Record) -> dict[str, Floats]:
        """Return the fluxes along a record by channel, (n,)."""
        table = (features(record) - self.centre) / self.scale
        # Beyond what was seen a linear function knows nothing.
        table = np.clip(table, -3.0, 3.0)
        return {
            channel: np.clip(table @ weight[:-1] + weight[-1], *self.bounds[channel])
            for channel, weight in self.weights.items()
        }


def features(record: Record) -> Floats:
    """Return `FEATURES` along a record, (n, f)."""
    inputs = record.inputs
    sun, azimuth, elevation = (
        inputs["global_radiation"],
        np.radians(inputs["sun_azimuth"]),
        np.radians(np.maximum(inputs["sun_elevation"], 0.0)),
    )
    clock = inputs["hour"] * (np.pi / 12.0)
    columns = {
        "global_radiation": sun,
        "radiation_squared": sun**2 / 1000.0,
        "radiation_east": sun * np.sin(azimuth),
        "radiation_south": -sun * np.cos(azimuth),
        "radiation_low_sun": sun * np.exp(-elevation / 0.3),
        "outdoor_temperature": inputs["outdoor_temperature"],
        "sky_depression": inputs["outdoor_temperature"] - inputs["sky_temperature"],
        "wind_speed": inputs["wind_speed"],
        "rain": inputs["rain"],
        "outdoor_humidity": inputs["outdoor_humidity"],
        "hour_sine": np.sin(clock),
        "hour_cosine": np.cos(clock),
        "half_day_sine": np.sin(2.0 * clock),
        "half_day_cosine": np.cos(2.0 * clock),
    }
    return np.stack([columns[name] for name in FEATURES], axis=1)


def fit_residual_model(
    parts: Sequence[tuple[Record, Mask | None, Mapping[str, Floats]]], penalty: float
) -> ResidualModel:
    """Fit the residual model to missing fluxes.

    Args:
        parts: records, the rows that may be used (None: all), and their missing fluxes by channel, (n,).
        penalty: of the ridge, as a share of the number of hours; 0.01 to 1 makes sense.
    """
    tables, targets = [], []
    channels = list(parts[0][2])
    for record, rows, missing in parts:
        width = max(1, round(3600.0 / record.step))
        stack = np.column_stack([features(record), *(missing[channel] for channel in channels)])
        stack[~record.usable] = np.nan
        if rows is not None:
            stack[~rows] = np.nan
        whole = len(stack) // width * width
        hourly = stack[:whole].reshape(-1, width, stack.shape[1])
        known = np.isfinite(hourly).all(axis=2).sum(axis=1) > width // 2
        means = np.nanmean(hourly[known], axis=1)
        tables.append(means[:, : len(FEATURES)])
        targets.append(means[:, len(FEATURES) :])
    table, target = np.concatenate(tables), np.concatenate(targets)
    centre, scale = table.mean(axis=0), np.maximum(table.std(axis=0), 1e-6)
    matrix = (table - centre) / scale
    normal = matrix.T @ matrix + penalty * len(matrix) * np.eye(len(FEATURES))
    weights, bounds = {}, {}
    for position, channel in enumerate(channels):
        values = target[:, position]
        low, high = np.quantile(values, [0.02, 0.98])
        slope = np.linalg.solve(normal, matrix.T @ (np.clip(values, low, high) - values.mean()))
        weights[channel] = np.append(slope, values.mean())
        bounds[channel] = (float(low), float(high))
    return ResidualModel(centre, scale, weights, bounds)
