"""A normal distribution of named parameters: the prior of a fit, and the posterior that it gives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from igrow.core.arrays import Floats


@dataclass(frozen=True, repr=False)
class Gaussian:
    """What is known of p parameters; the posterior of one fit is the prior of the next."""

    names: tuple[str, ...]
    mean: Floats
    """In each parameter's unit, (p,)."""
    covariance: Floats
    """Positive definite, (p, p)."""

    def __repr__(self) -> str:
        return f"Gaussian({len(self.names)} parameters)"

    @classmethod
    def independent(cls, mean: Mapping[str, float], deviation: Mapping[str, float]) -> Gaussian:
        """Return parameters that do not hang together, with standard deviations by name."""
        names = tuple(mean)
        spread = np.array([deviation[name] for name in names])
        return cls(names, np.array([mean[name] for name in names], dtype=np.float64), np.diag(spread**2))

    @cached_property
    def standard_deviation(self) -> Floats:
        """Per parameter, (p,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    @cached_property
    def values(self) -> dict[str, float]:
        """The means by name: what the simulator takes."""
        return dict(zip(self.names, self.mean.tolist(), strict=True))

    @cached_property
    def deviations(self) -> dict[str, float]:
        """The standard deviations by name."""
        return dict(zip(self.names, self.standard_deviation.tolist(), strict=True))

    @cached_property
    def correlation(self) -> Floats:
        """How the parameters hang together, (p, p), ones on the diagonal."""
        scale = self.standard_deviation
        return np.asarray(self.covariance / np.outer(scale, scale))

    @cached_property
    def whitening(self) -> Floats:
        """The matrix W, (p, p), for which W (x - mean) is standard normal: W^T W is the inverse covariance."""
        scale = self.standard_deviation
        # Parameters differ by six orders of magnitude; their correlations do not.
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.correlation)) / scale)

    @cached_property
    def precision(self) -> Floats:
        """The inverse covariance, (p, p)."""
        return np.asarray(self.whitening.T @ self.whitening)

    def marginal(self, names: Sequence[str]) -> Gaussian:
        """Return what is known of some of the parameters, in the order of `names`."""
        rows = [self.names.index(name) for name in names]
        return Gaussian(tuple(names), self.mean[rows], self.covariance[np.ix_(rows, rows)])

    def beside(self, name: str, mean: float, deviation: float) -> Gaussian:
        """Return the distribution with a further parameter that hangs together with none."""
        covariance = np.zeros((len(self.names) + 1,) * 2)
        covariance[:-1, :-1], covariance[-1, -1] = self.covariance, deviation**2
        return Gaussian((*self.names, name), np.append(self.mean, mean), covariance)

    def moved(self, mean: Floats) -> Gaussian:
        """Return the same spread about another mean, (p,)."""
        return Gaussian(self.names, mean, self.covariance)

    def widened(self, deviation: Floats | float) -> Gaussian:
        """Return the distribution after an independent change of every parameter, of this standard deviation, (p,)."""
        change = np.broadcast_to(np.asarray(deviation, dtype=np.float64), self.mean.shape)
        return Gaussian(self.names, self.mean, self.covariance + np.diag(change**2))

    def widened_along(self, direction: Floats) -> Gaussian:
        """Return the distribution after one change of all parameters together, of standard deviations (p,)."""
        return Gaussian(self.names, self.mean, self.covariance + np.outer(direction, direction))

    def sample(self, generator: np.random.Generator, count: int, low: Floats, high: Floats) -> dict[str, Floats]:
        """Return `count` draws by name, (count, 1) each, held within bounds `low` and `high`, (p,)."""
        drawn = generator.multivariate_normal(self.mean, self.covariance, size=count, method="eigh")
        drawn = np.clip(drawn, low, high)
        return {name: drawn[:, k : k + 1] for k, name in enumerate(self.names)}
