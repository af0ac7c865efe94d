"""A grower's plain schedule of setpoints, for want of a better plan."""

from __future__ import annotations

import numpy as np

from igrow.core.sun import solar_hour


def recipe(time: np.datetime64, longitude: float = 4.53) -> dict[str, float]:
    """Return the four setpoints of a tomato grower in winter and spring at a time (UTC).

    Local solar time counts: 20.5 degC and 800 ppm by day from 7 to 17, an afternoon of 19.5 degC, a night of 17 degC
    after 20 h; lamps from 1 to 17 h, which the PLC puts off in strong light; irrigation from 2 h after the lamps to
    2 h before sunset.
    """
    hour = float(solar_hour(time, 52.0, longitude))
    if 7.0 <= hour < 17.0:
        temperature = 20.5
    elif 17.0 <= hour < 20.0:
        temperature = 19.0
    elif 1.0 <= hour < 7.0:
        temperature = 18.5
    else:
        temperature = 17.0
    return {
        "heating_setpoint": temperature,
        "co2_setpoint": 800.0 if 1.0 <= hour < 17.0 else 400.0,
        "lamp_on": 1.0 if 1.0 <= hour < 17.0 else 0.0,
        "irrigation_on": 1.0 if 3.0 <= hour < 16.0 else 0.0,
    }
