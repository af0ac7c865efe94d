"""The yardstick of the demo: the error that remains when the true effect is known, on the same unseen days."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from igrow.core.bundle import read_bundle
from igrow.core.effects import EFFECTS
from igrow.core.greenhouse.described import parse_effect
from igrow.core.site import load_site
from igrow.trainer.data import read_log
from igrow.trainer.diagnosis import diagnose
from igrow.trainer.diagnosis.evidence import errors_with
from igrow.trainer.diagnosis.knowledge import ActiveTerm
from igrow.trainer.exporting import read_model

LOG = "trainer/archive/telemetry/site=demo"
"""Where the trainer collects what the daemon leaves in the exchange."""


def ideal_errors(out: Path, effect: str) -> dict[str, float]:
    """Return the mean absolute error of 24 h free runs by quantity, the parameters refitted beside the true effect."""
    site = load_site(out / "site.yaml")
    span = json.loads((out / "diagnosis" / "diagnosis.json").read_text(encoding="utf-8"))["span"]
    first, last = (np.datetime64(span[key].rstrip("Z"), "s") for key in ("start", "end"))
    log = read_log(out / LOG, site).select(first, last + np.timedelta64(1, "s"))
    result = diagnose(log, read_model(read_bundle(out / "first-bundle"), site))
    if result.evidence is None:
        return {}
    truth = parse_effect(effect)
    size = truth.definition.amplitude.typical if truth.size is None else float(truth.size)
    shape = {one.name: one.typical for one in EFFECTS[truth.name].shapes}
    return errors_with(result.evidence, (ActiveTerm(truth.name, size, shape, truth.start),))
