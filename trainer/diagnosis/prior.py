"""What is known of the parameters before the log: the deployed posterior, widened for another season and house."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from igrow.core.simulator.hybrid.parameters import PARAMETERS

Floats = NDArray[np.float64]

DRIFT = 0.08
"""Relative change of a parameter to expect between calibration and this log (season, crop, wear)."""
ELSEWHERE = 0.25
"""The same between the greenhouse of a calibration and another one."""


@dataclass(frozen=True)
class Prior:
    """Independent normal knowledge of each parameter."""

    mean: Mapping[str, float]
    standard_deviation: Mapping[str, float]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Parameters that may move."""
        return tuple(name for name in PARAMETERS if name in self.mean and self.standard_deviation.get(name, 0.0) > 0.0)

    @cached_property
    def spread(self) -> Floats:
        """Standard deviation of `names`."""
        return np.array([self.standard_deviation[name] for name in self.names])

    @cached_property
    def precision(self) -> Floats:
        """Inverse covariance of `names`."""
        return np.diag([self.standard_deviation[name] ** -2 for name in self.names])

    def clip(self, parameters: Mapping[str, float]) -> dict[str, float]:
        """Return parameters within their bounds; those that may not move keep the mean."""
        moved = dict(self.mean)
        for name, value in parameters.items():
            definition = PARAMETERS[name]
            moved[name] = min(max(value, definition.low), definition.high)
        return moved


def drift(name: str, value: float, share: float = DRIFT) -> float:
    """Return the change of a parameter to expect within a season (or at another relative `share`)."""
    return share * max(abs(value), 0.3 * abs(PARAMETERS[name].value))


def elsewhere(mean: Mapping[str, float], standard_deviation: Mapping[str, float]) -> dict[str, float]:
    """Return the standard deviations of what is known of a greenhouse from a calibration on another one."""
    return {
        name: float(np.hypot(deviation, drift(name, mean[name], ELSEWHERE)))
        for name, deviation in standard_deviation.items()
    }


def from_posterior(mean: Mapping[str, float], standard_deviation: Mapping[str, float]) -> Prior:
    """Return the prior that follows from a deployed posterior."""
    spread = {}
    for name in PARAMETERS:
        if name not in mean:
            continue
        spread[name] = float(np.hypot(standard_deviation.get(name, 0.0), drift(name, mean[name])))
    return Prior({name: mean.get(name, definition.value) for name, definition in PARAMETERS.items()}, spread)


def from_nominal(mean: Mapping[str, float]) -> Prior:
    """Return the prior of a model that has seen no log: the spreads of the definitions."""
    spread = {
        name: definition.spread * max(abs(mean.get(name, definition.value)), 0.3 * abs(definition.value))
        for name, definition in PARAMETERS.items()
    }
    return Prior({name: mean.get(name, definition.value) for name, definition in PARAMETERS.items()}, spread)
