"""What a cold day costs a tomato: growth that the plant cannot use, and fruit that ripens later.

Both cost more the colder it is: at a mean of 18, 17, 16, 15 and 14 degC a day's growth is worth 0.97, 0.84, 0.64, 0.38
and 0.16 of that of a warm day.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

RIPENING = ((14.0, 95.0), (18.0, 65.0), (22.0, 46.0), (26.0, 42.0))
"""degC, and days from flower to ripe fruit (Adams, Cockshull and Cave 2001, Annals of Botany 88, 869-877)."""
_USUAL = 18.0
"""degC at and above which ripening is in time."""


def usable_growth(mean: Any) -> NDArray[np.float64]:
    """Return which part of a day's assimilates the organs can use at a mean temperature in degC, 0 to 1.

    1 / (1 + exp(-1.1587 (T - 15))), the lower limb of Vanthoor (2011), A model-based greenhouse design method, thesis
    Wageningen, electronic appendix, section 9.3.
    """
    return np.asarray(1.0 / (1.0 + np.exp(-1.1587 * (np.asarray(mean, dtype=np.float64) - 15.0))))


def ripening_in_time(mean: Any) -> NDArray[np.float64]:
    """Return the pace of ripening at a mean temperature in degC over that at 18 degC, at most 1."""
    temperature, days = np.array(RIPENING).T
    pace = np.interp(mean, [0.0, *temperature], [0.0, *(1.0 / days)])
    return np.asarray(np.minimum(pace * np.interp(_USUAL, temperature, days), 1.0))


def worth_of_growth(mean: Any) -> NDArray[np.float64]:
    """Return what a day's growth is worth at a mean temperature in degC, over that of a warm day, 0 to 1."""
    return usable_growth(mean) * ripening_in_time(mean)
