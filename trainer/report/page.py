"""One self-contained HTML page: nothing is fetched from anywhere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, select_autoescape

from igrow.core.effects import EFFECTS
from igrow.core.quantities import QUANTITIES
from igrow.trainer.diagnosis.deployed import Deployed
from igrow.trainer.diagnosis.diagnose import Evidence
from igrow.trainer.diagnosis.result import HORIZONS, STAGES, Diagnosis
from igrow.trainer.diagnosis.wording import plain

_VERDICTS = {
    "nothing": "Nothing is missing that is large enough to matter: the model fits this greenhouse.",
    "named": "The model lacked something, and it has a name.",
    "ambiguous": "The model lacks something; more than one cause would explain it.",
    "unexplained": "Something real goes on that no known cause explains.",
    "data_fault": "The log cannot be diagnosed as it stands: the data are at fault, not the greenhouse.",
}
_HORIZON_NAMES = {"1_step": "1 step", "24_h": "24 h", "7_d": "7 days"}


def write_report(path: Path, diagnosis: Diagnosis, evidence: Evidence | None, deployed: Deployed) -> None:
    """Write the page to a file."""
    path.write_text(render_report(diagnosis, evidence, deployed), encoding="utf-8")


def render_report(diagnosis: Diagnosis, evidence: Evidence | None, deployed: Deployed) -> str:
    """Return the page's HTML."""
    from igrow.trainer.report import figures  # noqa: PLC0415  (matplotlib is slow to import)

    pictures: list[tuple[str, str]] = []
    if evidence is not None and "deployed" in evidence.runs:
        for quantity in diagnosis.errors:
            name = quantity.replace("_", " ")
            pictures.append((f"The worst unseen day, {name}", figures.worst_day(evidence, quantity)))
        if evidence.first.cause is not None:
            pictures.append(("When the evidence came", figures.gain_by_day(evidence)))
        for finding in diagnosis.findings:
            against = figures.residual_against_driver(evidence, finding)
            if against is not None:
                pictures.append((f"What is missing, against what drives {finding.effect}", against))
            regimes = figures.coefficient_by_regime(finding)
            if regimes is not None:
                pictures.append((f"The coefficient of {finding.effect} by regime", regimes))
    environment = Environment(loader=PackageLoader("igrow.trainer.report"), autoescape=select_autoescape())
    moved = (
        [
            (name, deployed.parameters[name], value)
            for name, value in evidence.corrected.parameters.items()
            if name in deployed.parameters
            and abs(value - deployed.parameters[name]) > 0.05 * abs(deployed.parameters[name])
        ]
        if evidence is not None
        else []
    )
    return environment.get_template("page.html").render(
        diagnosis=diagnosis,
        verdict=_VERDICTS[diagnosis.verdict],
        gains=_gains(diagnosis),
        effects=EFFECTS,
        quantities=QUANTITIES,
        horizons=[(name, _HORIZON_NAMES[name]) for name in HORIZONS],
        stages=STAGES,
        pictures=pictures,
        moved=moved,
        day=lambda time: np.datetime_as_string(time, unit="m").replace("T", " "),
    )


def _gains(diagnosis: Diagnosis) -> list[str]:
    """Return the sentences on the error a day ahead, for the grower."""
    sentences = []
    for quantity, horizons in diagnosis.errors.items():
        day = horizons.get("24_h", {})
        if {"deployed", "corrected"} <= day.keys():
            unit = QUANTITIES[quantity].unit.replace("degC", "K")
            name = quantity.removeprefix("air_").replace("co2", "CO2")
            before, after = (f"{plain(day[stage])} {unit}" for stage in ("deployed", "corrected"))
            sentences.append(f"Predicted {name} was off by {before} a day ahead; now {after}.")
    return sentences
