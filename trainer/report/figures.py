"""The figures of the report, each with its title, as SVG in the colours of the page."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterator
from functools import partial

from matplotlib.figure import Figure

from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.language import Language
from igrow.trainer.data.plot import plot_log
from igrow.trainer.diagnosis.answer import plots
from igrow.trainer.diagnosis.answer.result import Diagnosis, Finding
from igrow.trainer.figure_style import WIDTH, svg, with_signs_of

OVERVIEW = ("air_temperature", "air_humidity", "air_co2", "outdoor_temperature", "global_radiation")
"""What the overview of a log shows."""
Picture = dict[str, str]
"""One figure of the page: its title and its svg."""


def overview(result: Diagnosis, language: Language) -> list[Picture]:
    """Return the log at a glance, with what was set aside; empty where there is nothing to show."""
    log = result.log
    if log is None:
        return []
    draw = partial(plot_log, log.name, log.telemetry, log.screened, only=OVERVIEW, language=language, width=WIDTH)
    return list(_drawn([(language.text("The log; what was set aside is red"), draw)], language))


def evidence(result: Diagnosis, language: Language) -> list[Picture]:
    """Return every figure that a diagnosis has."""
    seen = result.evidence
    if seen is None:
        return []
    wanted: list[tuple[str, Callable[[], Figure]]] = [
        (language.text("What is missing, from day to day"), partial(plots.residual_by_date, seen, language))
    ]
    for finding in result.findings:
        title = language.text("What is missing, against {driver}")
        wanted += [
            (title.format(driver=language.name(driver)), partial(plots.residual_against_driver, seen, driver, language))
            for driver in _drivers(finding)
        ][:1]
    for quantity in result.errors:
        title = language.text("The worst unseen day: {quantity}", quantity=language.name(quantity))
        wanted.append((title, partial(plots.worst_day, seen, quantity, language)))
    if any(one.effect in EFFECTS for one in result.findings):
        wanted.append((language.text("When the evidence came"), partial(plots.evidence_by_day, seen, language)))
    for finding in result.findings:
        if finding.effect in EFFECTS and finding.regimes:
            unit = EFFECTS[finding.effect].amplitude.unit
            title = language.text("The size in parts of the log: {cause}")
            cause = language.text(EFFECTS[finding.effect].title)
            wanted.append(
                (title.format(cause=cause), partial(plots.coefficient_by_regime, finding.regimes, language, unit))
            )
    return list(_drawn(wanted, language))


def _drivers(finding: Finding) -> list[str]:
    """Return a finding's drivers; the air itself drives a sensor's fault, and says nothing."""
    outside = [name for name in finding.drivers if not name.startswith("air_")]
    return outside or list(finding.drivers)


def _drawn(wanted: list[tuple[str, Callable[[], Figure]]], language: Language) -> Iterator[Picture]:
    for title, draw in wanted:
        try:
            drawn = svg(with_signs_of(draw(), language), on_page=True)
        except IgrowError:
            continue  # The log has nothing to show there.
        label = f'<svg role="img" aria-label="{html.escape(title)}"'
        yield {"title": title, "svg": drawn.replace("<svg", label, 1)}
