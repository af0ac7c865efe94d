"""The yardstick of the demo: the error that remains when the true effect is known, on the same unseen days."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from igrow.core.bundle import read_bundle
from igrow.core.effects import EFFECTS
from igrow.core.greenhouse.described import parse_effect
from igrow.core.simulator.hybrid.measurement import PREDICTED
from igrow.core.site import load_site
from igrow.trainer.data import read_log
from igrow.trainer.diagnosis import freefit
from igrow.trainer.diagnosis.activation import ActiveTerm, activate
from igrow.trainer.diagnosis.deployed import from_manifest
from igrow.trainer.diagnosis.diagnose import Stage, diagnose


def ideal_errors(out: Path, effect: str) -> dict[str, float]:
    """Return the mean absolute error of 24 h free runs by quantity, the parameters refitted beside the true effect."""
    site = load_site(out / "site.yaml")
    deployed = from_manifest(read_bundle(out / "first-bundle").manifest, site)
    _, evidence = diagnose(read_log(out / "log", site), site, deployed)
    if evidence is None:
        return {}
    truth = parse_effect(effect)
    size = truth.definition.amplitude.typical if truth.size is None else float(truth.size)
    shape = {one.name: one.typical for one in EFFECTS[truth.name].shapes}
    terms = (ActiveTerm(truth.name, size, shape, truth.start),)
    record, split = evidence.record, evidence.split
    fitted = freefit.fit(record, evidence.first.problem.line.runs, split, evidence.knowledge, activate(record, terms))
    runs = Stage(*fitted, terms).runs(record, split)
    if runs is None:
        return {}
    return {name: float(np.nanmean(np.abs(error))) for name, error in runs.errors.items() if name in PREDICTED}
