"""The shadow run: a candidate predicts beside the bundle in force, on measurements that neither has seen.

Predictions are hindcasts: from each full hour of the window the simulator runs free over 1 h and 24 h, given
the weather that was measured and what the actuators and setpoints really did. So nothing but the simulator
itself is judged, and the bundle in force is judged on the very same hours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from igrow.core.arrays import Floats, Integers, Mask
from igrow.core.bundle import Bundle
from igrow.core.telemetry import Telemetry

HORIZONS = (1, 24)
"""Hours."""

JUDGED = {"air_temperature": 0.05, "air_humidity": 0.3, "air_co2": 3.0}
"""The quantities that are compared, each with the error below which differences say nothing (its own unit)."""


class Predictor(Protocol):
    """Runs a bundle's simulator over a log."""

    def predict(self, bundle: Bundle, log: Telemetry, origins: Integers, steps: int) -> Mapping[str, Floats]:
        """Return quantity -> free-run predictions (origins, steps).

        `log` lies on a regular grid. Entry [i, k] is for the row `origins[i] + k + 1`, starting from the climate
        measured at the row `origins[i]`; of later rows only weather, setpoints and actuators may be used. NaN
        where the log lacks what is needed.
        """


@dataclass(frozen=True)
class ErrorPair:
    """Mean absolute errors of two bundles over the same predictions."""

    quantity: str
    horizon: int
    """Hours."""
    candidate: float
    reference: float
    """NaN where there is no reference."""
    count: int
    """Predicted values that could be compared with a measurement."""

    @property
    def ratio(self) -> float:
        """Candidate over reference, both raised to the size that matters."""
        floor = JUDGED[self.quantity]
        return max(self.candidate, floor) / max(self.reference, floor)


@dataclass(frozen=True)
class Comparison:
    """Two bundles over one window."""

    pairs: tuple[ErrorPair, ...]

    @property
    def score(self) -> float:
        """Geometric mean of the ratios; below 1 the candidate is better. NaN where nothing could be compared."""
        ratios = [pair.ratio for pair in self.pairs if pair.count]
        return math.exp(sum(map(math.log, ratios)) / len(ratios)) if ratios else math.nan

    def not_worse(self, tolerance: float, worst: float) -> bool:
        """Tell whether the candidate may replace the reference.

        Its score is at most 1 + `tolerance`, and no single error exceeds the reference's by more than `worst`.
        A prediction that is not finite counts as worse.
        """
        ratios = [pair.ratio for pair in self.pairs if pair.count]
        return self.score <= 1.0 + tolerance and all(ratio <= 1.0 + worst for ratio in ratios)

    def words(self) -> str:
        """Return in a few words how the candidate's errors compare, over all and at their worst."""
        worst = max((pair for pair in self.pairs if pair.count), key=lambda pair: pair.ratio, default=None)
        if worst is None:
            return "nothing could be compared"
        return f"errors {self.score:.2f} times as large, {worst.quantity} at {worst.horizon} h {worst.ratio:.2f} times"

    def table(self) -> list[dict[str, object]]:
        """Return the rows for reports."""
        return [
            {
                "quantity": pair.quantity,
                "horizon": f"{pair.horizon}_h",
                "candidate": _finite(pair.candidate),
                "reference": _finite(pair.reference),
                "count": pair.count,
            }
            for pair in self.pairs
        ]


def compare(
    predictor: Predictor,
    candidate: Bundle,
    reference: Bundle | None,
    log: Telemetry,
    start: np.datetime64,
    end: np.datetime64,
) -> Comparison:
    """Compare two bundles on the predictions that begin and end in [start, end).

    `log` lies on a regular grid and may begin before `start`, as history for a simulator that needs one.
    """
    pairs = []
    for horizon in HORIZONS:
        origins, steps = _origins(log, start, end, horizon)
        if len(origins) == 0:
            continue
        rows = origins[:, None] + 1 + np.arange(steps)
        first = predictor.predict(candidate, log, origins, steps)
        second = {} if reference is None else predictor.predict(reference, log, origins, steps)
        for quantity in JUDGED:
            if quantity not in log or quantity not in first:
                continue
            measured = log[quantity][rows]
            baseline = second.get(quantity)
            usable = np.isfinite(measured)
            if baseline is not None:
                usable &= np.isfinite(baseline)
            else:
                usable &= np.isfinite(first[quantity])
            pairs.append(
                ErrorPair(
                    quantity,
                    horizon,
                    _mean_absolute(first[quantity], measured, usable),
                    math.nan if baseline is None else _mean_absolute(baseline, measured, usable),
                    int(usable.sum()),
                )
            )
    return Comparison(tuple(pairs))


def hindcast_errors(
    predictor: Predictor, bundle: Bundle, log: Telemetry, start: np.datetime64, end: np.datetime64
) -> dict[str, float]:
    """Return the mean absolute errors of one bundle over a window, by "<quantity> <horizon>_h"."""
    comparison = compare(predictor, bundle, None, log, start, end)
    return {f"{pair.quantity} {pair.horizon}_h": pair.candidate for pair in comparison.pairs if pair.count}


def _origins(log: Telemetry, start: np.datetime64, end: np.datetime64, horizon: int) -> tuple[Integers, int]:
    """Return the rows at full hours from which a horizon fits into the window, and the horizon in rows."""
    if len(log) < 2:
        return np.empty(0, dtype=np.int64), 0
    steps = round(3600 * horizon / log.step)
    seconds = log.time.astype(np.int64)
    last = np.int64(end.astype("datetime64[s]").astype(np.int64)) - 3600 * horizon
    first = np.int64(start.astype("datetime64[s]").astype(np.int64))
    fits = (seconds % 3600 == 0) & (seconds >= first) & (seconds < last)
    fits &= np.arange(len(log)) + steps < len(log)
    return np.flatnonzero(fits), steps


def _mean_absolute(predicted: Floats, measured: Floats, usable: Mask) -> float:
    """Return the mean absolute error; infinite where a prediction is not finite though it could be judged."""
    if not usable.any():
        return math.nan
    error = np.abs(predicted - measured)[usable]
    return float(error.mean()) if np.isfinite(error).all() else math.inf


def _finite(value: float) -> float | None:
    return round(value, 4) if math.isfinite(value) else None
