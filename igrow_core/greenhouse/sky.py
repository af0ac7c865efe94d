"""The long-wave temperature of the sky."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from igrow.core.air import saturation_pressure


def sky_temperature(temperature: Any, humidity: Any, cloud: Any) -> NDArray[np.float64]:
    """Return the black-body temperature of the sky in degC.

    Args:
        temperature: of the air outside, degC.
        humidity: relative, %.
        cloud: fraction of the sky that is covered, 0 to 1.

    Clear sky: emission 0.711 + 0.56 d / 100 + 0.73 (d / 100)^2 of the dew point d in degC (Berdahl and Martin 1984,
    Solar Energy 32, 663-664); clouds close 84 % of what is left (Monteith and Unsworth 2013, eq. 5.36).
    """
    pressure = np.maximum(0.01 * np.asarray(humidity), 0.01) * saturation_pressure(np, temperature)
    ratio = np.log(pressure / 610.94)
    dew_point = 243.04 * ratio / (17.625 - ratio)
    clear = 0.711 + 0.0056 * dew_point + 0.000073 * dew_point * dew_point
    emission = clear + 0.84 * np.asarray(cloud) * (1.0 - clear)
    return np.asarray((np.asarray(temperature) + 273.15) * emission**0.25 - 273.15)
