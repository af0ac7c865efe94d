"""The figures of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from igrow.core.arrays import Floats, Mask
from igrow.core.bundle import Estimate
from igrow.core.errors import IgrowError
from igrow.core.language import ENGLISH, Language
from igrow.core.quantities import QUANTITIES
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.trainer.diagnosis.answer.evidence import Evidence
from igrow.trainer.figure_style import COLOURS, STROKES, date_axis, few_ticks, legend, local, name_above, panels

_BINS = 12
"""Of a driver, each with as many samples."""
_PANEL = 1.15
"""Inches of each of several panels."""


def needed(evidence: Evidence | None) -> Evidence:
    """Return the evidence; raises IgrowError where a log was no good."""
    if evidence is None:
        raise IgrowError("the log could not be diagnosed: there is nothing to plot")
    return evidence


def worst_day(evidence: Evidence, quantity: str, language: Language = ENGLISH) -> Figure:
    """Plot the worst unseen day of the deployed model: measured, and what each stage predicts; raises IgrowError."""
    if "deployed" not in evidence.runs or quantity not in PREDICTED:
        raise IgrowError(f"there is no unseen day with {quantity} to plot")
    before = evidence.runs["deployed"]
    error = np.sqrt(np.nanmean(before.errors[quantity] ** 2, axis=0))
    if not np.isfinite(error).any():
        raise IgrowError(f"there is no unseen day with {quantity} to plot")
    run = int(np.nanargmax(error))
    hours = (1 + np.arange(len(before.shown[quantity]))) * evidence.log.record.step / 3600.0
    figure, (axes,) = panels()
    unit = QUANTITIES[quantity].unit
    shown = language.shown(unit)
    measured = before.shown[quantity][:, run] - before.errors[quantity][:, run]
    axes.plot(hours, shown.all(measured), color=COLOURS["measured"], label=language.name("measured"))
    for stage, runs in evidence.runs.items():
        axes.plot(
            hours,
            shown.all(runs.shown[quantity][:, run]),
            color=COLOURS[stage],
            linestyle=STROKES[stage],
            label=language.name(stage),
        )
    day = evidence.log.record.time[int(np.argmax(evidence.log.split.day == before.day[run]))]
    axes.set_xlabel(language.text("hours ahead, {day}", day=language.short_day(day)))
    axes.set_ylabel(f"{language.name(quantity)}, {language.unit(unit)}")
    legend(axes)
    return figure


def evidence_by_day(evidence: Evidence, language: Language = ENGLISH) -> Figure:
    """Plot how the evidence for the first cause adds up from day to day: a bend is a beginning."""
    figure, (axes,) = panels()
    gained = np.cumsum(evidence.first.null.day_losses - evidence.first.named.day_losses)
    start = evidence.log.record.time[0]
    days = start + (np.arange(len(gained)) * 86_400).astype("timedelta64[s]")
    axes.plot(local(days, language), gained, color=COLOURS["corrected"])
    axes.set_ylabel(language.text("evidence, log-likelihood summed"))
    date_axis(axes, language)
    return figure


def residual_by_date(evidence: Evidence, language: Language = ENGLISH) -> Figure:
    """Plot what is missing from day to day: measured minus predicted, the mean of each day."""
    line = evidence.first.design.line
    record = evidence.log.record
    when = local(record.time[line.runs.starts], language)
    shown = _shown(line.runs.weight)
    figure, places = panels(len(shown), 0.5 + _PANEL * len(shown))
    for axes, balance in zip(places, shown, strict=True):
        _draw_residual(axes, balance, when, _mean(line.errors[balance], line.runs.weight[balance]), language)
    date_axis(places[-1], language)
    places[-1].set_xlabel(language.text("measured minus predicted, mean of each day"))
    return figure


def residual_against_driver(evidence: Evidence, driver: str, language: Language = ENGLISH) -> Figure:
    """Plot what is missing against a driver, in bins of as many samples each; raises IgrowError."""
    line = evidence.first.design.line
    if np.ndim(line.drivers.get(driver, 0.0)) == 0:
        raise IgrowError(f"{driver} does not vary in this log: there is nothing to plot against")
    values = np.asarray(line.drivers[driver])[line.runs.samples]
    shown = [k for k in _shown(line.runs.weight) if len(_edges(values[line.runs.weight[k]])) > 2]
    if not shown:
        raise IgrowError(f"{driver} does not vary in this log: there is nothing to plot against")
    across = language.shown(QUANTITIES[driver].unit if driver in QUANTITIES else "1")
    figure, places = panels(len(shown), 0.5 + _PANEL * len(shown))
    for axes, balance in zip(places, shown, strict=True):
        counted = line.runs.weight[balance]
        x, y = values[counted], line.errors[balance][counted]
        edges = _edges(x)
        middle = 0.5 * (edges[1:] + edges[:-1])
        place = np.clip(np.digitize(x, edges) - 1, 0, len(middle) - 1)
        means = np.array([np.mean(y[place == k]) if np.any(place == k) else np.nan for k in range(len(middle))])
        _draw_residual(axes, balance, across.all(middle), means, language)
    written = language.text(across.unit)
    places[-1].set_xlabel(f"{language.name(driver)}{f', {written}' if written else ''}")
    return figure


def coefficient_by_regime(regimes: Mapping[str, Estimate], language: Language = ENGLISH, unit: str = "") -> Figure:
    """Plot a coefficient with its interval by regime; raises IgrowError."""
    if not regimes:
        raise IgrowError("this cause has no size by regime: there is nothing to plot")
    figure, (axes,) = panels(1, 0.7 + 0.24 * len(regimes))
    shown = language.shown(unit)
    for index, one in enumerate(regimes.values()):
        axes.plot([shown.of(one.low), shown.of(one.high)], [index, index], color=COLOURS["recalibrated"], linewidth=3)
        axes.plot([shown.of(one.value)], [index], marker="o", color=COLOURS["ink"])
    axes.set_yticks(range(len(regimes)), [language.name(name) for name in regimes])
    axes.invert_yaxis()
    size, written = language.text("size"), language.unit(unit)
    axes.set_xlabel(f"{size}, {written}" if written else size)
    return figure


def _draw_residual(axes: Axes, balance: int, across: Any, missing: Floats, language: Language) -> None:
    """Draw what is missing in one balance, both (n,), about none."""
    quantity = PREDICTED[balance]
    unit = QUANTITIES[quantity].difference_unit
    axes.axhline(0.0, color=COLOURS["ink"], linewidth=0.8)
    axes.plot(across, language.shown(unit).all(missing), color=COLOURS[quantity], marker="o", markersize=2.5)
    name_above(axes, f"{language.name(quantity)}, {language.unit(unit)}")
    few_ticks(axes)


def _shown(weight: Mask) -> list[int]:
    """Return the balances of which anything counts."""
    return [balance for balance in range(len(PREDICTED)) if weight[balance].any()]


def _mean(values: Floats, counted: Mask) -> Floats:
    """Return the mean of each row over what counts, NaN without any."""
    number = counted.sum(axis=1)
    total = np.where(counted, values, 0.0).sum(axis=1)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)


def _edges(values: Floats) -> Floats:
    return np.unique(np.quantile(values, np.linspace(0.0, 1.0, _BINS + 1))) if len(values) else np.empty(0)
