"""Which days of a log a diagnosis looks at."""

from __future__ import annotations

import numpy as np

from igrow.trainer.data.log import Log
from igrow.trainer.diagnosis.knowledge import Knowledge
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


def newest_weeks(log: Log, knowledge: Knowledge, rules: DecisionRules) -> Log:
    """Return the newest weeks of a long log where its greenhouse's history can be asked what has changed, else all."""
    if knowledge.history is None or log.days <= rules.long_days:
        return log
    # So many local days at most, the first and the last of them cut.
    return log.select(log.telemetry.time[-1] - np.timedelta64(round((rules.long_days - 1.0) * 86_400.0), "s"))
