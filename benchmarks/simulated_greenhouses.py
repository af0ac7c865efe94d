"""The season's greenhouses in a bundle's simulator: their weather, the simulator's climate, the season's crop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.season_greenhouses import BEFORE, START, Greenhouses
from benchmarks.strategies import beside
from igrow.core.arrays import Floats
from igrow.core.greenhouse import tomato
from igrow.core.greenhouse.described import parameters_of
from igrow.core.planner.season.course import DAY, MORNING, believed
from igrow.core.planner.season.crop import fresh, like, live, supplied
from igrow.core.simulator.outcome import Outcome
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site


class SimulatedGreenhouses(Greenhouses):
    """Greenhouses that differ by weather alone; each day begins where the simulator says that the one before ended."""

    def __init__(self, site: Site, simulator: BundleSimulator, days: int, numbers: Sequence[int]) -> None:
        super().__init__(days, numbers)
        self._simulator = simulator
        self._parameters = parameters_of(site)
        self._crop = like(tomato.mature_crop(self._parameters, 1.0), len(numbers))
        self._state = [dict(MORNING) for _ in numbers]

    def measured(self) -> dict[str, Floats]:
        """Return climate and crop by quantity, (rows,)."""
        climate = {name: np.array([state[name] for state in self._state]) for name in MORNING}
        grown = {
            "leaf_area_index": np.asarray(tomato.leaf_area_index(self._parameters, self._crop)),
            "plant_load": np.asarray(self._crop.fruits.sum(axis=0)),
        }
        return climate | grown

    def advance(self, setpoints: Floats, begin: np.datetime64) -> Outcome:
        """Live a day; see `Greenhouses`. As in `season.run_season`, simulator and crop have a leaf area each."""
        weather = self.weather(int((begin - START) // DAY))
        parts = [
            self._simulator.simulate(state, weather[row], setpoints[[row]], begin)
            for row, state in enumerate(self._state)
        ]
        outcome = beside(parts)
        for row, state in enumerate(self._state):
            state |= {
                name: float(getattr(outcome, name)[0, row, -1])
                for name in ("air_temperature", "air_humidity", "air_co2")
            }
        p, before = self._parameters, fresh(self._parameters, self._crop)
        supply = supplied(p, believed(outcome), outcome.air_temperature[0])
        self._crop = live(p, self._crop, supply, outcome.air_temperature[0], outcome.leaf_area_index[0])
        if (int((begin - START) // DAY) + BEFORE) % max(int(p.deleafing_interval), 1) == 0:
            self._crop = tomato.deleaf(np, p, self._crop)
        picked = (fresh(p, self._crop) - before) / 24.0
        return replace(outcome, fruit_fresh_weight=np.repeat(picked[None, :, None], 24, axis=-1))
