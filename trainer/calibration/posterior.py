"""What is known of the physical parameters: means, spreads and how they hang together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.simulator.hybrid.parameters import PARAMETERS

Floats = NDArray[np.float64]

SMALLEST_SPREAD = 0.02
"""Standard deviation of a prior, relative to the parameter's range, below which it would count as known."""


@dataclass(frozen=True)
class Posterior:
    """A normal distribution of p parameters; also the prior of the next calibration."""

    names: tuple[str, ...]
    mean: Floats
    """In each parameter's unit, (p,)."""
    covariance: Floats
    """(p, p)."""

    @property
    def standard_deviation(self) -> Floats:
        """Per parameter, (p,)."""
        deviation: Floats = np.sqrt(np.diag(self.covariance))
        return deviation

    @property
    def values(self) -> dict[str, float]:
        """The means by name: what the simulator takes."""
        return dict(zip(self.names, self.mean.tolist(), strict=True))

    def sample(self, generator: np.random.Generator, count: int) -> dict[str, Floats]:
        """Return `count` draws by name, (count, 1) each, within the parameters' bounds."""
        drawn = generator.multivariate_normal(self.mean, self.covariance, size=count, method="eigh")
        low = np.array([PARAMETERS[name].low for name in self.names])
        high = np.array([PARAMETERS[name].high for name in self.names])
        drawn = np.clip(drawn, low, high)
        return {name: drawn[:, k : k + 1] for k, name in enumerate(self.names)}

    def widened(self, factor: float) -> Posterior:
        """Return the same means with standard deviations `factor` times as large (for another season or house)."""
        return Posterior(self.names, self.mean, self.covariance * factor**2)


def prior(values: Mapping[str, float], spread: Mapping[str, float] | None = None) -> Posterior:
    """Return what is known of a site before its log: `values` with the relative spreads of `PARAMETERS`.

    Args:
        values: parameters by name (`igrow.core.simulator.hybrid.nominal`).
        spread: standard deviations that replace those of `PARAMETERS`, by name, in the parameter's unit.
    """
    names = tuple(values)
    deviation = np.array(
        [
            (spread or {}).get(
                name,
                max(
                    PARAMETERS[name].spread * abs(values[name]),
                    SMALLEST_SPREAD * PARAMETERS[name].spread * (PARAMETERS[name].high - PARAMETERS[name].low),
                ),
            )
            for name in names
        ]
    )
    return Posterior(names, np.array([values[name] for name in names]), np.diag(deviation**2))
