"""What a log lets be asked: its crop, vents, actuators and air beside those that the model was calibrated on."""

from __future__ import annotations

from dataclasses import dataclass, replace

from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis.answer import wording
from igrow.trainer.diagnosis.crop import LEAVES_AND_LIGHT, has_new_crop, new_leaves, with_its_drift
from igrow.trainer.diagnosis.design.freerun import LogDays, log_days
from igrow.trainer.diagnosis.knowledge import Knowledge, knowledge_of
from igrow.trainer.diagnosis.open_vents import under_open_vents
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.diagnosis.search import history
from igrow.trainer.diagnosis.search.actuators import Completed, complete
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.model import FittedModel


@dataclass(frozen=True)
class Circumstances:
    """Of one log, before anything is searched in it."""

    logged: LogDays
    completed: Completed
    knowledge: Knowledge
    rules: DecisionRules
    """For this log: what crop and vents leave uncertain may differ by more."""
    new_crop: bool
    """Of one that the calibration has not seen nothing is told."""
    by_days: bool
    """Unseen days alone may tell something: not of leaves unlike those that null skills were learned of."""
    of_crop: frozenset[str]
    """Effects and parameters that are not asked, of a crop that may be another by now, and of the light it takes up."""
    of_vents: frozenset[str]
    """Parameters that are not asked, of vents whose law the calibration did not try."""
    of_sensors: frozenset[str]
    """Effects that are not asked, since the readings tell that it is another."""
    notes: tuple[str, ...]

    @property
    def not_asked(self) -> frozenset[str]:
        """Effects and parameters."""
        return self.of_crop | self.of_vents | self.of_sensors


def circumstances_of(log: Log, model: FittedModel, seen: Discrepancy | None, rules: DecisionRules) -> Circumstances:
    """Return what a log lets be asked.

    Args:
        log: of a week or more, and not long.
        model: in force.
        seen: history of the greenhouse, the weeks between the calibration and this log seen too.
        rules: for any log.
    """
    site, logged, known = log.known_site, log_days(log, model), replace(model, history=seen)
    measured = "leaf_area_index" not in logged.record.missing
    new_crop = has_new_crop(log.telemetry.time, site, model)
    new = 1.0 if new_crop else new_leaves(model.history, site, history.leaf_area_of(logged.record))
    drifted = with_its_drift(rules, new, measured=measured)
    may_be_another = new_crop or (not measured and drifted.crop_drift > rules.crop_drift)
    of_vents, drifted = history.with_vents(knowledge_of(known, site, drifted).history, logged.record, drifted)
    knowledge = knowledge_of(known, site, drifted)
    completed = complete(log, logged, model, knowledge, drifted)
    opened = under_open_vents(logged.record, drifted)
    off = opened is not None and opened.is_offset(drifted)
    many_new = new > rules.most_new_leaves
    notes = (
        *((wording.NEW_CROP,) if new_crop else (wording.GROWN_CROP,) if may_be_another else ()),
        *((wording.NEW_LEAVES,) if many_new and not new_crop else ()),
        *((wording.VENTS_HARDLY_OPEN,) if of_vents else ()),
        *((wording.NOT_CALIBRATED,) if knowledge.transferred else ()),
        *wording.thin_air(site),
        *((opened.sentence,) if opened is not None and off else ()),
    )
    return Circumstances(
        logged, completed, knowledge, drifted, new_crop,
        by_days=not many_new,
        of_crop=LEAVES_AND_LIGHT if may_be_another else frozenset(),
        of_vents=of_vents,
        of_sensors=frozenset({"co2_drift"} if off else ()),
        notes=notes,
    )  # fmt: skip
