"""One self-contained HTML page: nothing is fetched from anywhere."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, select_autoescape

from igrow.core.effects import EFFECTS
from igrow.core.errors import IgrowError
from igrow.core.language import Language, speak
from igrow.core.quantities import QUANTITIES
from igrow.trainer.diagnosis.answer.result import STAGES, Diagnosis, Finding
from igrow.trainer.diagnosis.design.freerun import HORIZONS
from igrow.trainer.figure_style import COLOURS, DARK
from igrow.trainer.report import figures, sentences, verdicts
from igrow.trainer.report.worth import Worth, worth

MOVED = 0.05
"""Relative change from which on a recalibrated parameter is shown."""
MOST_STRETCHES = 60
"""Stretches set aside that are listed one by one."""


@dataclass(frozen=True)
class ErrorRow:
    """One line of the table of errors."""

    quantity: str
    ahead: str
    cells: list[tuple[str, bool]]
    """Error of each stage, and whether it is the best of them."""
    unit: str


def write_diagnosis(folder: Path, result: Diagnosis, language: str = "en", typed: Sequence[str] = ()) -> None:
    """Write ``diagnosis.json`` and ``report.html`` into a folder, which is made where it is not there.

    `typed` are the words of a command that read the log.

    Raises:
        IgrowError: the folder cannot be written, or the language is not known.
    """
    page = render_report(result, language, typed)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(priced(result), indent=2, allow_nan=False) + "\n"
        (folder / "diagnosis.json").write_text(text, encoding="utf-8")
        (folder / "report.html").write_text(page, encoding="utf-8")
    except OSError as error:
        raise IgrowError(f"{folder}: cannot be written: {error.strerror}") from None


def priced(result: Diagnosis) -> dict[str, Any]:
    """Return the diagnosis' document, each finding with what it takes from the whole greenhouse, EUR a week or null."""
    document = result.to_json()
    area = result.model.site.greenhouse.floor_area
    for told, finding in zip(document["findings"], result.findings, strict=True):
        found = priced_at(result, finding)
        told["eur_per_week"] = None if found is None else round(area * found.money, 2)
    return document


def priced_at(result: Diagnosis, finding: Finding) -> Worth | None:
    """Return what a finding takes; None where nothing does, such as of a difference between two greenhouses."""
    return None if result.uncalibrated else worth(result, finding)


def render_report(result: Diagnosis, language: str = "en", typed: Sequence[str] = ()) -> str:
    """Return the page's HTML in a language (`igrow.core.language.LANGUAGES`), by the greenhouse's clock.

    Raises:
        IgrowError: the language is not known.
    """
    site = result.model.site if result.log is None else result.log.known_site
    spoken = speak(language, site.time_zone, site.units)
    environment = Environment(
        loader=PackageLoader("igrow.trainer.report"),
        autoescape=select_autoescape(),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["map_name"] = lambda names, spoken: [spoken.name(name) for name in names]
    before, after = result.model.posterior.values, result.corrected.posterior.values
    faults = () if result.log is None or result.verdict != "data_fault" else result.log.faults
    return environment.get_template("page.html").render(
        _=spoken.text,
        language=spoken,
        diagnosis=result,
        time_zone=site.time_zone,
        first=verdicts.first(result, typed, spoken),
        verdict=verdicts.verdict(result, spoken),
        causes=[_cause(result, one, spoken) for one in result.findings],
        faults=[sentences.fault(one, spoken) for one in faults],
        gains=list(sentences.gains(result, spoken)),
        warnings=list(sentences.warnings(result, spoken)),
        notes=[] if faults else list(sentences.notes(result, spoken)),
        set_aside=list(sentences.set_aside(result, spoken)),
        overview=figures.overview(result, spoken),
        pictures=figures.evidence(result, spoken),
        stages=[spoken.name(stage) for stage in STAGES],
        errors=list(error_rows(result, spoken)),
        effects=EFFECTS,
        moved=[
            (name, spoken.number(value, 4), spoken.number(after[name], 4))
            for name, value in before.items()
            if name in after and abs(after[name] - value) > MOVED * abs(value)
        ],
        most=MOST_STRETCHES,
        colours=COLOURS,
        dark=DARK,
    )


def _cause(result: Diagnosis, finding: Finding, language: Language) -> dict[str, Any]:
    """Return a finding as the page tells it."""
    title = sentences.title(finding.effect, language)
    site = result.model.site if result.log is None else result.log.known_site
    return {
        "finding": finding,
        "title": f"{title[0].upper()}{title[1:]}",
        "sentence": sentences.cause(finding, language),
        "rivals": sentences.rivals(finding, language),
        "checks": sentences.checks(finding, language),
        "costs": sentences.costs(finding, priced_at(result, finding), site.greenhouse.floor_area, language),
        "signature": sentences.signature(finding, language),
    }


def error_rows(result: Diagnosis, language: Language) -> Iterator[ErrorRow]:
    """Yield the table of errors; the best of a row is the smallest, told apart to the digits that are shown."""
    for quantity, table in result.errors.items():
        for horizon in HORIZONS:
            if horizon not in table:
                continue
            unit = QUANTITIES[quantity].difference_unit
            shown = [float(f"{language.shown(unit).of(table[horizon][stage]):.3g}") for stage in STAGES]
            best = min(shown)
            cells = [(language.number(value, 3), value == best and max(shown) > best) for value in shown]
            yield ErrorRow(language.name(quantity), language.name(horizon), cells, language.unit(unit))
