"""Which days of a log a diagnosis looks at."""

from __future__ import annotations

import math

from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis.rules import DecisionRules
from igrow.trainer.fit.model import FittedModel
from igrow.trainer.fit.unseen_days import unseen


def since_calibration(log: Log, model: FittedModel, rules: DecisionRules) -> tuple[Log, tuple[str, ...]]:
    """Return what of a log its model was not calibrated on, with a note; all of it where too little is left."""
    later, until = unseen(log, model)
    if until is None:
        return log, ()
    if later.days < rules.least_days:
        return log, (
            f"The model was calibrated on days of this log, up to {until:%Y-%m-%d %H:%M} UTC, and less than a week is "
            "later: what was wrong already then is not seen.",
        )
    return later, (f"The model was calibrated on the days up to {until:%Y-%m-%d %H:%M} UTC: they are left out.",)


def weeks_in_turn(log: Log, rules: DecisionRules) -> list[Log]:
    """Return a long log in equal parts, the oldest first.

    Within a long one the crop changes, and the weeks next to the calibration are those of which it says most.
    """
    if log.days <= rules.long_days:
        return [log]
    # So many local days at most, the first and the last of them cut.
    count = math.ceil(log.days / (rules.long_days - 1.0))
    start, end = log.telemetry.time[0], log.telemetry.time[-1]
    ends = [start + (end - start) * part // count for part in range(1, count)]
    return [log.select(begin, until) for begin, until in zip([None, *ends], [*ends, None], strict=True)]
