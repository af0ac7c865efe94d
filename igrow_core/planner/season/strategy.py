"""A season in a grower's terms: a few numbers at a few dates, and straight lines between them.

What a grower writes on the wall: temperature by day and by night, how much warmer on a bright day, CO2, from when and
for how long the lamps burn and above which sun they rest. Six dates of a season of five months are a number every four
weeks. One date alone is a rule for the whole season.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from igrow.core.arrays import Floats, Mask
from igrow.core.planner.template import Setpoints
from igrow.core.quantities import SETPOINTS, WEATHER

RANGES = {
    "day_temperature": (17.0, 24.0),
    "night_temperature": (15.0, 20.0),
    "warmer_by_sun": (0.0, 2.0),
    "co2": (400.0, 1000.0),
    "lamp_hours": (0.0, 18.0),
    "lamps_from": (-6.0, 6.0),
    "lamps_below": (0.0, 400.0),
}
"""What a strategy says, and between what: degC, degC, K for each 100 W m-2 of the day's mean radiation, ppm while there
is light, h a day, local hour (before midnight negative), W m-2 of sun above which lamps rest."""
OPTIONAL = {
    "humidity_setpoint": {"humidity": (75.0, 90.0)},
    "ventilation_setpoint": {"vents_above": (1.0, 6.0)},
}
"""What it says beside by setpoint, where the climate computer takes that one: % above which vents open for damp air; K
above the heating setpoint from which they open for heat."""
UNITS = {
    "day_temperature": "degC",
    "night_temperature": "degC",
    "warmer_by_sun": "K for each 100 W m-2",
    "co2": "ppm",
    "lamp_hours": "h",
    "lamps_from": "h",
    "lamps_below": "W m-2",
    "humidity": "%",
    "vents_above": "K",
}
"""Units of what a strategy says, as its sentences name them."""
NO_CO2 = 400.0
"""ppm asked for in the dark."""


@dataclass(frozen=True)
class Strategy:
    """How genes (B, G) become the numbers of a day; one gene for each number at each knot."""

    days: int
    """Length of the season."""
    knots: int
    """Dates, evenly over the season."""
    ends: bool = False
    """Whether one more gene tells the day from which on the lamps stay off."""
    optional: tuple[str, ...] = ()
    """Setpoints of `OPTIONAL` that it says as well."""

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """What it says, and between what."""
        return RANGES | {name: ends for one in self.optional for name, ends in OPTIONAL[one].items()}

    @property
    def genes(self) -> int:
        """Number of genes."""
        return len(self.ranges) * self.knots + self.ends

    def numbers(self, genes: NDArray[np.float32], day: float) -> dict[str, Floats]:
        """Return the numbers of `RANGES` by name on a day counted from the season's first, (B,) each."""
        count = len(self.ranges)
        knots = genes[:, : count * self.knots].astype(np.float64).reshape(len(genes), count, self.knots)
        place = min(max(day / max(self.days - 1, 1), 0.0), 1.0) * (self.knots - 1)
        left = min(int(place), max(self.knots - 2, 0))
        share = place - left
        between = knots[:, :, left] * (1.0 - share) + knots[:, :, min(left + 1, self.knots - 1)] * share
        numbers = {
            name: low + between[:, column] * (high - low)
            for column, (name, (low, high)) in enumerate(self.ranges.items())
        }
        if self.ends:
            numbers["lamp_hours"] = numbers["lamp_hours"] * (day < genes[:, -1] * self.days)
        return numbers

    def of_rule(self, rule: Strategy, genes: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the genes (G,) of a strategy that says what a rule (one date) of genes (R,) says."""
        days = np.linspace(0.0, self.days - 1.0, self.knots)
        numbers = [rule.numbers(genes[None], day) for day in days]
        columns = [
            [(float(one[name][0]) - low) / (high - low) for one in numbers] for name, (low, high) in self.ranges.items()
        ]
        return np.array([share for column in columns for share in column] + [1.0] * self.ends, dtype=np.float32)

    def setpoints(
        self,
        genes: NDArray[np.float32],
        day: float,
        local_hour: Floats,
        sun_up: Mask,
        weather: Floats,
        recipe: Setpoints,
    ) -> Setpoints:
        """Return a day's setpoints (B, H, S), before any limit.

        Args:
            genes: (B, G).
            day: counted from the season's first.
            local_hour: at which each hour begins, (H,).
            sun_up: (H,).
            weather: that is expected, (H, 6).
            recipe: the grower's setpoints, (H, S), for what a strategy says nothing of.
        """
        said = {name: value[:, None] for name, value in self.numbers(genes, day).items()}
        radiation = weather[:, WEATHER.index("global_radiation")]
        warm = said["day_temperature"] + said["warmer_by_sun"] * radiation.mean() / 100.0
        since = (local_hour - said["lamps_from"]) % 24.0
        lamp = (since < np.round(said["lamp_hours"])) & (radiation < said["lamps_below"])
        light = sun_up | lamp
        setpoints = np.repeat(recipe[None], len(genes), axis=0)
        for name, values in (
            ("heating_setpoint", np.where(sun_up, warm, said["night_temperature"])),
            ("lamp_on", 1.0 * lamp),
            ("co2_setpoint", np.where(light, said["co2"], NO_CO2)),
        ):
            setpoints[:, :, SETPOINTS.index(name)] = values
        heating = setpoints[:, :, SETPOINTS.index("heating_setpoint")]
        for name in self.optional:
            values = said["humidity"] if name == "humidity_setpoint" else heating + said["vents_above"]
            setpoints[:, :, SETPOINTS.index(name)] = values
        return setpoints

    def table(self, genes: NDArray[np.float32], every: int = 14) -> list[str]:
        """Return the strategy (G,) as lines for people, a row for every `every` days."""
        lines = ["  day" + "".join(f"{name:>19s}" for name in self.ranges)]
        for day in range(0, self.days, every):
            numbers = self.numbers(genes[None], day)
            lines.append(f"{day:5d}" + "".join(f"{float(value[0]):19.1f}" for value in numbers.values()))
        return lines
