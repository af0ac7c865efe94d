"""How fast this crop grows: conversion and maintenance, fitted to what growers count.

Net growth is conversion times assimilation less maintenance times exp(0.0693 (T - 20)) (`crop.net_growth_rate`). Of
the two, a single factor on growth can follow neither: where maintenance is underrated it undervalues marginal light,
which is what a planner buys. Both are linear, so that all that is counted tells of them by one Bayesian regression:

    y = X theta + e,    theta ~ N(prior),    e ~ N(0, sd^2)

(Gelman et al. 2013, Bayesian Data Analysis, 3rd ed., section 14.8). Errors are taken wider where the counts disagree
more than they should, and never narrower than told.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.simulator.crop import CropStages
from igrow.core.site import Crop

PRIOR = (0.30, 1.0)
"""Standard deviations of conversion and maintenance over their values before a crop was counted: the greenhouses of
the benchmarks, and a foreign model (0.88 of the growth, less 7 g m-2 d-1), lie within them."""
LEAST_MAINTENANCE = 1e-4
"""kg m-2 h-1 that the prior's spread is taken of where the maintenance is less."""
TOLD = 0.7
"""A parameter counts as told where its standard deviation fell below this share of the prior's."""


@dataclass(frozen=True)
class GrowthDays:
    """What drives growth, by whole days that follow one another."""

    assimilated: Floats
    """CO2 that the canopy took up, kg m-2, (D,); NaN where it is not known."""
    warmth: Floats
    """Sum over the day's hours of exp(0.0693 (T - 20)), h, (D,)."""


@dataclass(frozen=True)
class Count:
    """What was counted between the beginning of day `first` and that of day `last`."""

    first: int
    last: int
    amount: float
    """kg m-2: dry matter for `grown`, fresh fruit for the other two."""
    deviation: float
    """Standard deviation of the amount, kg m-2."""
    kind: str = "grown"
    """`grown`: net growth of the whole plant; `fruit`: fruit picked and what more of it hangs; `picked`: fruit picked,
    of which each part grew in the days before (spread evenly over `days_to_harvest`)."""


@dataclass(frozen=True)
class GrowthFit:
    """Conversion and maintenance of a crop, with what is known of them."""

    conversion: float
    """kg of dry matter per kg of CO2."""
    maintenance: float
    """kg m-2 h-1 of dry matter at 20 degC."""
    covariance: Floats
    """Of the two, (2, 2)."""
    counts: int
    """How many counts told of them."""
    told: tuple[str, ...]
    """Which of the two the counts told: their deviation fell well below that before."""
    misfit: float
    """Root mean square of the counts' residuals over their deviations; NaN without counts."""

    @property
    def sentence(self) -> str:
        """What a grower must know about it."""
        if not self.counts:
            return (
                "the log counts no growth (net_growth, fruit_fresh_weight or plant_load): what plans promise of growth "
                "is that of other greenhouses, and may be twice of what comes, or half"
            )
        if not self.told:
            return (
                f"{self.counts} counts of growth say next to nothing of this crop: growth is that of other greenhouses"
            )
        if len(self.told) == 1:
            return f"{self.counts} counts of growth tell the {self.told[0]} alone"
        return f"{self.counts} counts of growth tell conversion and maintenance"

    def draws(self, members: int) -> Floats:
        """Return as many pairs of conversion and maintenance, (M, 2): the mean first, the others about it.

        The same each time; none is negative.
        """
        mean = np.array([self.conversion, self.maintenance])
        rng = np.random.default_rng(1)
        around = rng.multivariate_normal(np.zeros(2), self.covariance, size=max(members - 1, 0), method="eigh")
        # Pairs of opposite sign leave the mean where it is.
        half = len(around) // 2
        around[half : 2 * half] = -around[:half]
        around[2 * half :] = 0.0
        return np.asarray(np.maximum(np.concatenate([mean[None], mean + around]), 0.0))


@dataclass(frozen=True)
class GrowthBalance:
    """Conversion and maintenance that a simulator computes with."""

    conversion: float
    maintenance: float
    covariance: Floats
    """Of the two, (2, 2)."""

    @classmethod
    def of(cls, manifest: Mapping[str, Any]) -> GrowthBalance | None:
        """Return that of a bundle by its manifest's `simulator`; None where growth is a network's affair."""
        conversion, maintenance = (float(manifest.get(name) or 0.0) for name in ("conversion", "maintenance"))
        if conversion <= 0.0:
            return None
        given = manifest.get("growth_covariance")
        spread = np.array(PRIOR) * [conversion, max(maintenance, LEAST_MAINTENANCE)]
        covariance = np.diag(spread**2) if given is None else np.asarray(given, dtype=np.float64)
        return cls(conversion, maintenance, covariance)

    def assimilated(self, net_growth: Floats, air_temperature: Floats) -> Floats:
        """Return the CO2 taken up in each hour, kg m-2, behind a net growth in kg m-2."""
        return (net_growth + self.maintenance * warmth(air_temperature)) / self.conversion


def warmth(air_temperature: Floats) -> Floats:
    """Return the hours at 20 degC that an hour at another temperature in degC counts for in maintenance."""
    return np.asarray(np.exp(0.0693147 * (air_temperature - 20.0)))


def prior_of(stages: CropStages) -> Floats:
    """Return the covariance of conversion and maintenance, (2, 2): what the stages carry, else `PRIOR`."""
    if stages.covariance is not None:
        return np.asarray(stages.covariance, dtype=np.float64)
    return np.diag((np.array(PRIOR) * [stages.conversion, max(stages.maintenance, LEAST_MAINTENANCE)]) ** 2)


def fit_growth(
    days: GrowthDays, counts: Sequence[Count], stages: CropStages, crop: Crop, prior: Floats | None = None
) -> tuple[CropStages, GrowthFit]:
    """Return stages with conversion and maintenance as counted, and how well they are known.

    Args:
        days: what drove growth.
        counts: what was counted over some of them.
        stages: with the values to begin from.
        crop: for the share of growth that goes to fruit, its dry matter and its days to harvest.
        prior: covariance of the two before, (2, 2); that of `prior_of` by default.
    """
    mean = np.array([stages.conversion, stages.maintenance])
    covariance = prior_of(stages) if prior is None else prior
    fit = regress(days, counts, crop, mean, covariance)
    return replace(stages, conversion=fit.conversion, maintenance=fit.maintenance, covariance=fit.covariance), fit


def regress(days: GrowthDays, counts: Sequence[Count], crop: Crop, mean: Floats, prior: Floats) -> GrowthFit:
    """Return the posterior of conversion and maintenance (2,) from a prior mean and covariance; see `fit_growth`."""
    rows = [(_row(days, count, crop), count) for count in counts]
    usable = [(row, count) for row, count in rows if np.isfinite(row).all() and np.isfinite(count.amount)]
    if not usable:
        return GrowthFit(float(mean[0]), float(mean[1]), prior, 0, (), float("nan"))
    design = np.array([row for row, _ in usable])
    amount = np.array([count.amount for _, count in usable])
    deviation = np.array([count.deviation for _, count in usable])
    scaled, target = design / deviation[:, None], amount / deviation
    found, covariance = _posterior(scaled, target, mean, prior)
    residual = target - scaled @ found
    # Two parameters are taken from the counts; with fewer there is no telling how far they disagree.
    free = len(usable) - 2
    wider = max(1.0, float(np.sqrt(residual @ residual / free))) if free > 0 else 1.0
    if wider > 1.0:
        found, covariance = _posterior(scaled / wider, target / wider, mean, prior)
    if found[1] < 0.0:
        # No crop grows by the night: the rest is the conversion's.
        gain = covariance[0, 1] / covariance[1, 1]
        found = np.array([found[0] - gain * found[1], 0.0])
    before, after = np.sqrt(np.diag(prior)), np.sqrt(np.diag(covariance))
    told = tuple(name for name, a, b in zip(("conversion", "maintenance"), after, before, strict=True) if a < TOLD * b)
    return GrowthFit(
        max(float(found[0]), 0.0),
        max(float(found[1]), 0.0),
        covariance,
        len(usable),
        told,
        float(np.sqrt(np.mean(residual**2))),
    )


def _posterior(design: Floats, target: Floats, mean: Floats, prior: Floats) -> tuple[Floats, Floats]:
    """Return mean (2,) and covariance (2, 2) of a linear model with errors of one; in units of the prior's spread."""
    scale = np.sqrt(np.diag(prior))
    unit = design * scale
    precision = np.linalg.inv(prior / np.outer(scale, scale)) + unit.T @ unit
    covariance = np.linalg.inv(precision)
    step = covariance @ (unit.T @ (target - design @ mean))
    return mean + scale * step, covariance * np.outer(scale, scale)


def _row(days: GrowthDays, count: Count, crop: Crop) -> Floats:
    """Return what one unit of conversion and of maintenance adds to a count, (2,); NaN where days are missing."""
    if not 0 <= count.first < count.last <= len(days.assimilated):
        return np.full(2, np.nan)
    drivers = np.column_stack([days.assimilated, -days.warmth])
    if count.kind == "picked":
        # Growth of a day is picked evenly over the days that a fruit needs.
        ahead = crop.days_to_harvest
        if count.first < round(ahead):
            return np.full(2, np.nan)
        age = np.arange(len(drivers))
        until_last = np.clip((count.last - age) / ahead, 0.0, 1.0)
        until_first = np.clip((count.first - age) / ahead, 0.0, 1.0)
        weight = until_last - until_first
        used = weight > 0.0
        row = weight[used] @ drivers[used]
    else:
        row = drivers[count.first : count.last].sum(axis=0)
    if count.kind == "grown":
        return np.asarray(row)
    return np.asarray(row * crop.fruit_share / crop.dry_matter_fraction)
