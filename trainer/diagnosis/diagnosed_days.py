"""Which days of a log a diagnosis looks at."""

from __future__ import annotations

import math
from collections.abc import Sequence

from igrow.core.errors import IgrowError
from igrow.trainer.data.log import Log
from igrow.trainer.data.plausibility.order import LEAST_DAYS, days_read
from igrow.trainer.data.screening import NEEDED
from igrow.trainer.diagnosis.answer import wording
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


def well_read(parts: Sequence[Log]) -> tuple[list[Log], tuple[str, ...]]:
    """Return the parts that show as much as a log of its own must, with a note where others are left out.

    Raises:
        IgrowError: none does.
    """
    read = [one for one in parts if min(_days_read(one).values()) >= LEAST_DAYS]
    if not read:
        first = parts[0]
        name, days = min(_days_read(first).items(), key=lambda one: one[1])
        since = str(first.telemetry.time[0].astype("datetime64[m]")).replace("T", " ")
        raise IgrowError(
            f"{first.name}: since {since} UTC {name} has readings in half of the hours on {days} days: a diagnosis "
            f"needs {LEAST_DAYS} in any six weeks"
        )
    return read, (wording.UNREAD,) if len(read) < len(parts) else ()


def _days_read(log: Log) -> dict[str, int]:
    return {name: days_read(log.telemetry, name) for name in NEEDED}
