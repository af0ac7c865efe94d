"""A toy greenhouse that the planner can see through."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from igrow.core.quantities import SETPOINTS, USUAL_SETPOINTS
from igrow.core.simulator.outcome import Outcome
from igrow.core.site import Site


class ToySimulator:
    """Heat rises with the heating setpoint, growth with light and CO2; `members` doubt the lamps' worth.

    One that takes a humidity setpoint is as damp as that, and loses heat where it keeps the air dry.
    """

    def __init__(
        self,
        members: tuple[float, ...] = (1.0,),
        known_lamp_hours: float = 1e9,
        leaf_area: float = 3.0,
        setpoints: tuple[str, ...] = USUAL_SETPOINTS,
    ) -> None:
        self.members = members
        self.known_lamp_hours = known_lamp_hours
        self.leaf_area = leaf_area
        self.calls = 0
        self.setpoints = setpoints

    def simulate(
        self, initial: Any, weather: np.ndarray, setpoints: np.ndarray, start: np.datetime64 | np.ndarray
    ) -> Outcome:
        self.calls += len(setpoints)
        asked = dict(zip(SETPOINTS, np.moveaxis(setpoints, -1, 0), strict=True))
        temperature, co2, lamp = (asked[name] for name in ("heating_setpoint", "co2_setpoint", "lamp_on"))
        damp = asked["humidity_setpoint"] if "humidity_setpoint" in self.setpoints else np.full(1, 80.0)
        outdoor, radiation = weather[..., 0], weather[..., 3]
        light = radiation * 0.5 + 81.0 * np.array(self.members)[:, None, None] * lamp
        growth = 8e-6 * light * (co2 / (co2 + 400.0)) * np.exp(-(((temperature - 22.0) / 8.0) ** 2))
        beyond = np.maximum(np.cumsum(lamp, axis=-1) - self.known_lamp_hours, 0.0) / 10.0
        shape = growth.shape

        def spread(values: np.ndarray) -> np.ndarray:
            return np.broadcast_to(values, shape)

        return Outcome(
            air_temperature=spread(temperature),
            air_humidity=spread(damp),
            air_co2=spread(co2),
            heat=spread((np.maximum(temperature - outdoor, 0.0) * 7.0 + 100.0 * (80.0 - damp)) * 3600 / 1e6),
            electricity=spread(0.081 * lamp),
            co2=spread(2e-5 * np.maximum(co2 - 400.0, 0.0)),
            net_growth=growth,
            fruit_fresh_weight=spread(np.zeros(1)),
            leaf_area_index=spread(np.full(1, self.leaf_area)),
            outside=spread(beyond),
        )


HOURS = 48
START = np.datetime64("2020-02-01T23:00:00", "s")


def with_planning(site: Site, **changes: Any) -> Site:
    """Return the site with other planning settings."""
    return replace(site, planning=replace(site.planning, **changes))
