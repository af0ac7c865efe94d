"""What is known of a greenhouse from others of its owner: how they lie from their descriptions, what their models miss.

Each greenhouse of a fleet was fitted by itself. A random-effects model (DerSimonian and Laird 1986, Controlled Clinical
Trials 7:177-188, eq. 8 and 9) says by parameter where they lie together and how much they scatter, beyond what each
fit leaves unknown; the same by effect and pattern of the discrepancy that each calibration left. For a new greenhouse
that is a prior. Only means and standard deviations enter, no row of any log.

Everything is in units of the standard deviation before any log, so that greenhouses of other sizes compare.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import parse_object
from igrow.core.site import Site
from igrow.core.whole_files import write_whole
from igrow.trainer.fit.climate import site_prior
from igrow.trainer.fit.gaussian import Gaussian

LEAST_SITES = 3
"""Of fewer nobody knows how much they scatter."""
DESCRIPTION_COUNTS = 3.0
"""As so many greenhouses of scatter one the description itself counts when the scatter is estimated."""
LARGEST_SHARE = 0.98
"""Share of the description's variance that a fit may leave at most to count as having seen the parameter."""


@dataclass(frozen=True)
class Learned:
    """What one greenhouse's own log says of its parameters and of its discrepancy, beyond its description."""

    shift: Mapping[str, float]
    """From the description, in its standard deviations, by parameter; of an effect or a pattern from none of it."""
    variance: Mapping[str, float]
    """Of the shift."""


@dataclass(frozen=True)
class Population:
    """Where greenhouses of one owner lie, from the description and in its standard deviations.

    Keys are parameters, and effects and patterns as a `Discrepancy` has them.
    """

    mean: Mapping[str, float]
    deviation: Mapping[str, float]
    """Of a further greenhouse about the mean; at most one."""
    sites: int
    """How many it was learned from."""

    def prior(self, site: Site) -> Gaussian:
        """Return what is known of the parameters of a further greenhouse before its log."""
        described = site_prior(site)
        shift, deviation = self.scaled(described.names, described.standard_deviation)
        return Gaussian(described.names, described.mean + shift, np.diag(deviation**2))

    def scaled(self, keys: Sequence[str], before: Floats) -> tuple[Floats, Floats]:
        """Return mean and standard deviation of keys, (k,), from the standard deviation before anything was shared."""
        mean = np.array([self.mean.get(key, 0.0) for key in keys])
        return before * mean, before * np.array([self.deviation.get(key, 1.0) for key in keys])

    def write(self, path: Path) -> None:
        """Write it as JSON. Raises OSError."""
        write_whole(path, json.dumps(asdict(self), indent=1, sort_keys=True).encode())


def learned_of(prior: Gaussian, posterior: Gaussian) -> Learned:
    """Return what a log said of a greenhouse, given the prior and the posterior of a fit to it.

    A normal posterior is prior times likelihood; dividing the prior out again leaves the log's own word, amplitude by
    amplitude. What it hardly saw is left out.
    """
    described = prior.marginal(posterior.names)
    scale = described.standard_deviation
    left = np.minimum((posterior.standard_deviation / scale) ** 2, 1.0)
    moved = (posterior.mean - described.mean) / scale
    seen = left < LARGEST_SHARE
    told = np.where(seen, 1.0 - left, 1.0)
    names = [name for name, one in zip(posterior.names, seen, strict=True) if one]
    return Learned(
        dict(zip(names, (moved / told)[seen].tolist(), strict=True)),
        dict(zip(names, (left / told)[seen].tolist(), strict=True)),
    )


def learn_population(sites: Sequence[Learned]) -> Population:
    """Return where greenhouses lie together and how much they scatter.

    Raises:
        IgrowError: fewer than three have learned anything.
    """
    if len(sites) < LEAST_SITES:
        raise IgrowError(f"{len(sites)} sites have shared what they learned; {LEAST_SITES} are needed")
    mean, deviation = {}, {}
    for name in sorted({name for site in sites for name in site.shift}):
        shift = np.array([site.shift[name] for site in sites if name in site.shift])
        variance = np.array([site.variance[name] for site in sites if name in site.shift])
        mean[name], deviation[name] = _random_effects(shift, variance)
    return Population(mean, deviation, len(sites))


def _random_effects(shift: Floats, variance: Floats) -> tuple[float, float]:
    """Return mean and standard deviation of a further shift; the description is a first guess of both."""
    count, weight = len(shift), 1.0 / np.maximum(variance, 1e-9)
    centre = float(weight @ shift / weight.sum())
    freedom = float(weight.sum() - weight @ weight / weight.sum())
    between = 0.0
    if freedom > 0.0:
        between = max(0.0, (float(weight @ (shift - centre) ** 2) - (count - 1)) / freedom)
    between = (DESCRIPTION_COUNTS + (count - 1) * between) / (DESCRIPTION_COUNTS + count - 1)
    weight = 1.0 / (variance + between)
    precision = 1.0 + float(weight.sum())  # the description's own mean counts once
    return float(weight @ shift) / precision, float(np.sqrt(min(1.0, between + 1.0 / precision)))


def read_population(path: Path) -> Population:
    """Read what `Population.write` wrote.

    Raises:
        IgrowError: the file cannot be read, or is none; in one line.
    """
    document = _document(path)
    sites = document.get("sites")
    if not isinstance(sites, int):
        raise IgrowError(f"{path}: no file of `igrow-trainer fleet learn`")
    return Population(_numbers(document, "mean", path), _numbers(document, "deviation", path), sites)


def read_learned(path: Path) -> Learned:
    """Read what a site has learned.

    Raises:
        IgrowError: the file cannot be read, or is none; in one line.
    """
    document = _document(path)
    return Learned(_numbers(document, "shift", path), _numbers(document, "variance", path))


def _document(path: Path) -> dict[str, Any]:
    try:
        return parse_object(path.read_bytes(), str(path))
    except OSError as error:
        raise IgrowError(f"{path}: {error.strerror}; `igrow-trainer fleet learn` writes it") from None


def _numbers(document: Mapping[str, Any], key: str, path: Path) -> dict[str, float]:
    values = document.get(key)
    positive = key in ("deviation", "variance")
    if not isinstance(values, dict) or not all(
        isinstance(one, int | float) and np.isfinite(one) and (one > 0.0 or not positive) for one in values.values()
    ):
        raise IgrowError(f"{path}: no file of `igrow-trainer fleet learn` ({key})")
    return {str(name): float(one) for name, one in values.items()}
