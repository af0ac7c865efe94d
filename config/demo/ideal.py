"""The yardstick of the demo: the error that remains when the true effect is known, on the same unseen days."""

from __future__ import annotations

from pathlib import Path

from igrow.core.bundle import read_bundle
from igrow.core.effects import EFFECTS
from igrow.core.greenhouse.described import parse_effect
from igrow.core.site import load_site
from igrow.trainer.data import read_log
from igrow.trainer.diagnosis import diagnose
from igrow.trainer.diagnosis.evidence import errors_with
from igrow.trainer.diagnosis.knowledge import ActiveTerm
from igrow.trainer.exporting import read_model


def ideal_errors(out: Path, effect: str) -> dict[str, float]:
    """Return the mean absolute error of 24 h free runs by quantity, the parameters refitted beside the true effect."""
    site = load_site(out / "site.yaml")
    result = diagnose(read_log(out / "log", site), read_model(read_bundle(out / "first-bundle"), site))
    if result.evidence is None:
        return {}
    truth = parse_effect(effect)
    size = truth.definition.amplitude.typical if truth.size is None else float(truth.size)
    shape = {one.name: one.typical for one in EFFECTS[truth.name].shapes}
    return errors_with(result.evidence, (ActiveTerm(truth.name, size, shape, truth.start),))
