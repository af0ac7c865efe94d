"""The report's plots, as SVG text to stand inside the page."""

from __future__ import annotations

import io
from collections.abc import Callable

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from igrow.core.quantities import QUANTITIES
from igrow.trainer.diagnosis.diagnose import Evidence
from igrow.trainer.diagnosis.gram import day_losses
from igrow.trainer.diagnosis.result import Finding

mpl.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "igrow", "font.size": 9, "axes.grid": True})
_COLOURS = {"deployed": "#888888", "recalibrated": "#3b7dd8", "corrected": "#1f9d55"}


def worst_day(evidence: Evidence, quantity: str) -> str:
    """Plot the unseen day with the largest error of the deployed model: measured, before, after."""
    record = evidence.record

    def draw(axes: Axes) -> None:
        before = evidence.runs["deployed"]
        error = np.sqrt(np.nanmean(before.errors[quantity] ** 2, axis=0))
        run = int(np.nanargmax(error))
        steps = before.shown[quantity].shape[0]
        hours = (1 + np.arange(steps)) * record.step / 3600.0
        truth = before.shown[quantity][:, run] - before.errors[quantity][:, run]
        axes.plot(hours, truth, color="black", linewidth=1.5, label="measured")
        for stage, runs in evidence.runs.items():
            axes.plot(hours, runs.shown[quantity][:, run], color=_COLOURS[stage], label=stage)
        axes.set_xlabel("hours ahead")
        axes.set_ylabel(f"{quantity.replace('_', ' ')}, {QUANTITIES[quantity].unit}")
        axes.legend(fontsize=8)

    return _svg(draw)


def gain_by_day(evidence: Evidence) -> str:
    """Plot how the evidence for the findings adds up from day to day: a bend is a beginning."""

    def draw(axes: Axes) -> None:
        none, named = (
            day_losses(fit.products, fit.solution.coefficients) for fit in (evidence.first.none, evidence.first.named)
        )
        axes.plot(np.arange(len(none)), np.cumsum(none - named), color=_COLOURS["corrected"])
        axes.set_xlabel("day of the log")
        axes.set_ylabel("evidence, log-likelihood summed")

    return _svg(draw)


def residual_against_driver(evidence: Evidence, finding: Finding) -> str | None:
    """Plot what is missing against the finding's first outside driver, in bins; None where it has none."""
    drivers = evidence.first.problem.line.drivers
    name = next((one for one in finding.drivers if one in drivers and np.ndim(drivers[one])), None)
    if name is None:
        return None
    rows = evidence.first.problem.line.runs.rows
    errors = evidence.first.problem.line.errors
    values = np.asarray(drivers[name])[rows]
    counted = evidence.first.problem.line.runs.weight

    def draw(axes: Axes) -> None:
        for index, (quantity, scale) in enumerate((("air_temperature", 1.0), ("air_humidity", 3.0), ("air_co2", 50.0))):
            if not counted[index].any():
                continue
            x, y = values[counted[index]], errors[index][counted[index]] / scale
            edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, 13)))
            if len(edges) < 3:
                continue
            middle = 0.5 * (edges[1:] + edges[:-1])
            place = np.clip(np.digitize(x, edges) - 1, 0, len(middle) - 1)
            means = [float(np.mean(y[place == k])) if np.any(place == k) else np.nan for k in range(len(middle))]
            axes.plot(middle, means, marker="o", markersize=3, label=f"{quantity.replace('_', ' ')} / {scale:g}")
        unit = QUANTITIES[name].unit if name in QUANTITIES else ""
        axes.set_xlabel(f"{name.replace('_', ' ')} {unit}")
        axes.set_ylabel("measured minus predicted, a day ahead")
        axes.legend(fontsize=8)

    return _svg(draw)


def coefficient_by_regime(finding: Finding) -> str | None:
    """Plot the coefficient refitted by regime; None where it was not."""
    if not finding.regimes:
        return None

    def draw(axes: Axes) -> None:
        names = list(finding.regimes)
        for index, name in enumerate(names):
            one = finding.regimes[name]
            axes.plot([one.low, one.high], [index, index], color=_COLOURS["recalibrated"], linewidth=3)
            axes.plot([one.value], [index], marker="o", color="black")
        axes.set_yticks(range(len(names)), names)
        axes.set_xlabel(f"coefficient, {next(iter(finding.regimes.values())).unit}")

    return _svg(draw)


def _svg(draw: Callable[[Axes], None]) -> str:
    figure = Figure(figsize=(5.6, 3.0), layout="constrained")
    draw(figure.add_subplot())
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


__all__ = ["coefficient_by_regime", "gain_by_day", "residual_against_driver", "worst_day"]
