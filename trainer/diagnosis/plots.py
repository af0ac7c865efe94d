"""The figures of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.trainer.diagnosis.evidence import Evidence

COLOURS = {"deployed": "#888888", "recalibrated": "#3b7dd8", "corrected": "#1f9d55"}
_SCALES = {"air_temperature": 1.0, "air_humidity": 3.0, "air_co2": 50.0}
"""By which errors of different quantities are divided in one figure."""
_BINS = 12
"""Of a driver, each with as many samples."""


def needed(evidence: Evidence | None) -> Evidence:
    """Return the evidence; raises IgrowError where a log was no good."""
    if evidence is None:
        raise IgrowError("the log could not be diagnosed: there is nothing to plot")
    return evidence


def worst_day(evidence: Evidence, quantity: str) -> Figure:
    """Plot the unseen day with the largest error of the deployed model: measured, and what each stage predicts."""
    if "deployed" not in evidence.runs or quantity not in PREDICTED:
        raise IgrowError(f"there is no unseen day with {quantity} to plot")
    before = evidence.runs["deployed"]
    error = np.sqrt(np.nanmean(before.errors[quantity] ** 2, axis=0))
    if not np.isfinite(error).any():
        raise IgrowError(f"there is no unseen day with {quantity} to plot")
    run = int(np.nanargmax(error))
    hours = (1 + np.arange(len(before.shown[quantity]))) * evidence.log.record.step / 3600.0
    figure, axes = _axes()
    measured = before.shown[quantity][:, run] - before.errors[quantity][:, run]
    axes.plot(hours, measured, color="black", linewidth=1.5, label="measured")
    for stage, runs in evidence.runs.items():
        axes.plot(hours, runs.shown[quantity][:, run], color=COLOURS[stage], label=stage)
    axes.set_xlabel("hours ahead")
    axes.set_ylabel(f"{quantity.replace('_', ' ')}, {QUANTITIES[quantity].unit}")
    axes.legend(fontsize=8)
    return figure


def evidence_by_day(evidence: Evidence) -> Figure:
    """Plot how the evidence for the first cause adds up from day to day: a bend is a beginning."""
    figure, axes = _axes()
    gained = np.cumsum(evidence.first.null.day_losses - evidence.first.named.day_losses)
    axes.plot(np.arange(len(gained)), gained, color=COLOURS["corrected"])
    axes.set_xlabel("day of the log")
    axes.set_ylabel("evidence, log-likelihood summed")
    return figure


def residual_against_driver(evidence: Evidence, driver: str) -> Figure:
    """Plot what is missing against a driver, in bins of as many samples each."""
    line = evidence.first.design.line
    if np.ndim(line.drivers.get(driver, 0.0)) == 0:
        raise IgrowError(f"{driver} does not vary in this log: there is nothing to plot against")
    values = np.asarray(line.drivers[driver])[line.runs.samples]
    figure, axes = _axes()
    for balance, (quantity, scale) in enumerate(_SCALES.items()):
        counted = line.runs.weight[balance]
        x, y = values[counted], line.errors[balance][counted] / scale
        edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, _BINS + 1))) if len(x) else x
        if len(edges) < 3:
            continue
        middle = 0.5 * (edges[1:] + edges[:-1])
        place = np.clip(np.digitize(x, edges) - 1, 0, len(middle) - 1)
        means = [float(np.mean(y[place == k])) if np.any(place == k) else np.nan for k in range(len(middle))]
        axes.plot(middle, means, marker="o", markersize=3, label=f"{quantity.replace('_', ' ')} / {scale:g}")
    axes.set_xlabel(f"{driver.replace('_', ' ')} {QUANTITIES[driver].unit if driver in QUANTITIES else ''}")
    axes.set_ylabel("measured minus predicted, a day ahead")
    axes.legend(fontsize=8)
    return figure


def coefficient_by_regime(regimes: Mapping[str, tuple[float, float, float]]) -> Figure:
    """Plot a coefficient with its interval, (value, low, high), by regime."""
    if not regimes:
        raise IgrowError("this cause has no size by regime: there is nothing to plot")
    figure, axes = _axes()
    for index, (value, low, high) in enumerate(regimes.values()):
        axes.plot([low, high], [index, index], color=COLOURS["recalibrated"], linewidth=3)
        axes.plot([value], [index], marker="o", color="black")
    axes.set_yticks(range(len(regimes)), list(regimes))
    axes.set_xlabel("coefficient")
    return figure


def _axes() -> tuple[Figure, Axes]:
    figure = Figure(figsize=(5.6, 3.0), layout="constrained")
    axes = figure.add_subplot()
    axes.grid(True)
    axes.tick_params(labelsize=9)
    return figure, axes
