"""One self-contained HTML page: nothing is fetched from anywhere."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jinja2 import Environment, PackageLoader, select_autoescape

from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.quantities import QUANTITIES
from igrow.trainer.diagnosis.result import STAGES, Diagnosis, Finding, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOVED = 0.05
"""Relative change from which on a recalibrated parameter is shown."""
_VERDICTS = {
    "nothing": "Nothing is missing that is large enough to matter: the model fits this greenhouse.",
    "named": "The model lacked something, and it has a name.",
    "ambiguous": "The model lacks something; more than one cause would explain it.",
    "unexplained": "Something real goes on that no known cause explains.",
    "data_fault": "The log cannot be diagnosed as it stands: the data are at fault, not the greenhouse.",
}
_HORIZONS = {"1_step": "1 step", "24_h": "24 h", "7_d": "7 days"}


def write_diagnosis(folder: Path, result: Diagnosis) -> None:
    """Write ``diagnosis.json`` and ``report.html`` into a folder, which is made where it is not there.

    Raises:
        IgrowError: the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(result.to_json(), indent=2, allow_nan=False) + "\n"
        (folder / "diagnosis.json").write_text(text, encoding="utf-8")
        (folder / "report.html").write_text(render_report(result), encoding="utf-8")
    except OSError as error:
        raise IgrowError(f"{folder}: cannot be written: {error.strerror}") from None


def render_report(result: Diagnosis) -> str:
    """Return the page's HTML."""
    environment = Environment(loader=PackageLoader("igrow.trainer.report"), autoescape=select_autoescape())
    before, after = result.model.posterior.values, result.corrected.posterior.values
    moved = [
        (name, value, after[name])
        for name, value in before.items()
        if name in after and abs(after[name] - value) > MOVED * abs(value)
    ]
    return environment.get_template("page.html").render(
        diagnosis=result,
        verdict=_VERDICTS[result.verdict],
        gains=_gains(result),
        effects=EFFECTS,
        quantities=QUANTITIES,
        horizons=list(_HORIZONS.items()),
        stages=STAGES,
        pictures=list(_pictures(result)),
        moved=moved,
        day=lambda time: np.datetime_as_string(time, unit="m").replace("T", " "),
    )


def _pictures(result: Diagnosis) -> Iterator[tuple[str, str]]:
    """Yield title and SVG of every figure that the result has."""
    wanted: list[tuple[str, Callable[[], Figure]]] = [
        (f"The worst unseen day, {quantity.replace('_', ' ')}", partial(result.plot_errors, quantity))
        for quantity in result.errors
    ]
    if any(one.effect in EFFECTS for one in result.findings):
        wanted.append(("When the evidence came", result.plot_evidence))
    for finding in result.findings:
        cause = finding.effect.replace("_", " ")
        wanted.append((f"What is missing, against what drives {cause}", partial(_against_driver, result, finding)))
        wanted.append((f"The coefficient of {cause} by regime", partial(result.plot_regimes, finding)))
    for title, draw in wanted:
        try:
            yield title, _svg(draw())
        except IgrowError:
            continue  # The log has nothing to show there.


def _against_driver(result: Diagnosis, finding: Finding) -> Figure:
    """Return the figure against the first of a finding's drivers that varies."""
    for driver in finding.drivers:
        try:
            return result.plot_residual(driver)
        except IgrowError:
            continue
    raise IgrowError(f"nothing that drives {finding.effect} varies in this log")


def _gains(result: Diagnosis) -> list[str]:
    """Return the sentences on the error a day ahead, for the grower."""
    sentences = []
    for quantity, horizons in result.errors.items():
        day = horizons.get("24_h", {})
        if {"deployed", "corrected"} <= day.keys():
            unit = QUANTITIES[quantity].unit.replace("degC", "K")
            name = quantity.removeprefix("air_").replace("co2", "CO2")
            before, after = (f"{plain(day[stage])} {unit}" for stage in ("deployed", "corrected"))
            sentences.append(f"Predicted {name} was off by {before} a day ahead; now {after}.")
    return sentences


def _svg(figure: Figure) -> str:
    from matplotlib import rc_context  # noqa: PLC0415  (slow to import)

    buffer = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "igrow"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]
