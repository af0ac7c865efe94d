"""The days of a log that a model was not calibrated on.

What a greenhouse already lacked while its model was calibrated is in the model, and those days fit it best: they tell
nothing of how well it predicts, and nothing of what has changed since.
"""

from __future__ import annotations

from datetime import datetime

import numpy as np

from igrow.core.bundle import Manifest
from igrow.trainer.data import Log
from igrow.trainer.fit.model import FittedModel


def unseen(log: Log, model: FittedModel | Manifest) -> tuple[Log, datetime | None]:
    """Return what of a log is later than all that a model was calibrated on, maybe nothing, and the end of that, UTC.

    The whole log, and None, where it is of another greenhouse or holds no such day.
    """
    span, time = model.training_span, log.telemetry.time
    if span is None or model.calibrated_on != log.known_site.name or len(time) == 0:
        return log, None
    start, end = (np.datetime64(one.replace(tzinfo=None), "s") for one in (span.start, span.end))
    if time[-1] <= start or time[0] > end:
        return log, None
    return log.select(end + np.timedelta64(1, "s")), span.end
