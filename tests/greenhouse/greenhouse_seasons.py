"""The days on which the tests of the mechanistic greenhouse begin."""

from __future__ import annotations

import numpy as np

WINTER = np.datetime64("2020-01-12T00:00:00", "s")
SPRING = np.datetime64("2020-04-20T00:00:00", "s")


def hours(count: float) -> np.timedelta64:
    return np.timedelta64(int(count * 3600), "s")
