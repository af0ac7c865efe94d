"""What parts of a log tell, beside what other parts of it have told."""

from __future__ import annotations

from dataclasses import dataclass, replace

from igrow.trainer.diagnosis.answer import wording
from igrow.trainer.diagnosis.answer.result import DISCREPANCY, Diagnosis, Finding
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search.estimate import Estimated
from igrow.trainer.diagnosis.search.parameter_change import ParameterChange
from igrow.trainer.fit.discrepancy import Discrepancy


@dataclass(frozen=True)
class Answer:
    """What a log, or some weeks of it, tell."""

    diagnosis: Diagnosis
    causes: tuple[Estimated, ...] = ()
    parameter: ParameterChange | None = None
    history: Discrepancy | None = None
    """Of the greenhouse, these weeks seen; None where it has none."""


def bears_out(later: Answer, earlier: Answer, rules: DecisionRules) -> bool:
    """Tell whether later weeks tell all that earlier ones have named, or anything where these had no name for it."""
    told = {one.effect for one in later.diagnosis.findings}
    named = [one for one in earlier.diagnosis.findings if one.kind != DISCREPANCY]
    if not named:
        return bool(told) or not earlier.diagnosis.findings
    sizes = {one.effect: one.term.amplitude for one in later.causes}
    return all(told.intersection(_same_as(one)) for one in named) and all(
        sizes.get(one.effect, 0.0) / one.term.amplitude >= rules.regime_share for one in earlier.causes
    )


def _same_as(one: Finding) -> tuple[str, ...]:
    """Return the names under which later weeks may tell a finding: of parameters, of all that change alike."""
    return one.confounded if one.kind == "parameter" else (one.effect,)


def is_same(later: Finding, change: ParameterChange) -> bool:
    """Tell whether the days since a parameter has changed tell it, or one that explains as much."""
    return later.kind == "parameter" and (later.effect in change.confounded or change.parameter in later.confounded)


def begun(later: Finding, change: ParameterChange) -> Finding:
    """Return what the days since a change tell, with the beginning that the whole log tells."""
    share = later.parameters["change"]
    return wording.parameter(replace(change, parameter=later.effect, share=share, confounded=later.confounded))
