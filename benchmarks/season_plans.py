"""A plan a day through a whole season: with the season's marginal values, and with an average price instead.

    python -m benchmarks.season_plans [--days 45] [--greenhouses 2] [--generations 30]

A season of `--days` is tuned (as many generations as a plan of a day has, a rule beside it), and its marginal values
are taken. Then greenhouses that no simulator was fitted to are led by the recipe, the rule, the season's strategy, and
by a search each midnight on the built-in bundle's simulator, corrected by what the last days used and grew, under the
mean weather of the last three days. All that counts in the end is fruit that was picked, less costs. Searches here are
smaller than the daemon's (one member, fewer generations), so that a season of them can be paid for.
"""

from __future__ import annotations

import argparse
import sys
from collections import deque
from dataclasses import dataclass

import numpy as np

from benchmarks.season_greenhouses import Led, Morning, Recipe, Way, lead, money
from benchmarks.seasons import brought, described, season_of, ways_of
from benchmarks.strategies import Day, recently
from igrow.core.agronomy.memory import one_of
from igrow.core.arrays import Floats
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.greenhouse import tomato
from igrow.core.planner import Budget, EvolutionSettings, NumpyGeneration, PlanningState, PlanResult, optimise
from igrow.core.planner.recent_use import grown_days, totals
from igrow.core.planner.season import SeasonPlan, valued
from igrow.core.planner.season.course import RADIATION
from igrow.core.planner.season.search import rule_and_strategy
from igrow.core.planner.template import for_site
from igrow.core.quantities import SETPOINTS
from igrow.core.simulator.outcome import Outcome, Simulator
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site
from igrow.edge.planning.make_plan import RECENT_DAYS

SEARCH = NumpyGeneration(EvolutionSettings(parents=24, offspring=48))


@dataclass(frozen=True)
class Lived:
    """A day that a greenhouse lived through."""

    begin: np.datetime64
    present: dict[str, float]
    """As measured at its beginning."""
    weather: Floats
    """(24, 6)."""
    setpoints: Floats
    """(24, S)."""
    had: dict[str, Floats]
    """What it used and grew, (1,) each."""
    warmth: float
    """Mean of the air's temperature, degC."""

    def beside(self, simulator: BundleSimulator) -> Day:
        """Return what a simulator says of the day, and what it was."""
        again = simulator.simulate(self.present, self.weather, self.setpoints[None], self.begin)
        driven = (0.0, 0.0) if simulator.growth is None else grown_days(simulator.growth, again)
        return totals(again), self.had, driven, (float(again.air_temperature.mean()), self.warmth)


class Planned(Recipe):
    """A search each midnight, over the day that follows and the one after it."""

    def __init__(self, site: Site, simulator: BundleSimulator, season: SeasonPlan | None, generations: int) -> None:
        self._site = site
        self._simulator = simulator
        self._season = season
        candidates = generations * SEARCH.settings.offspring
        self._budget = Budget(candidates, candidates)
        self._past: dict[int, deque[Lived]] = {}
        self._chosen: list[Floats] = []

    def ask(self, morning: Morning) -> Floats:
        """Return the first day of a plan for each greenhouse."""
        self._chosen = [self.plan(morning, greenhouse).setpoints[:24] for greenhouse in range(len(morning.weather))]
        return np.stack(self._chosen)

    def simulator(self, greenhouse: int) -> BundleSimulator:
        """Return the simulator in force."""
        return self._simulator

    def believed(self, greenhouse: int) -> Simulator:
        """Return it corrected by what the last days used and grew."""
        simulator = self.simulator(greenhouse)
        past = self._past.get(greenhouse, ())
        return recently(simulator, self._site, [one.beside(simulator) for one in past])

    def plan(self, morning: Morning, greenhouse: int) -> PlanResult:
        """Return the plan of a greenhouse."""
        present = _present(morning, greenhouse)
        row = morning.rows.start + greenhouse
        state = PlanningState(
            morning.begin,
            present,
            dict(zip(SETPOINTS, morning.applied[greenhouse].tolist(), strict=True)),
            co2_before=float(morning.co2_before[greenhouse]),
            memory=one_of(morning.memory, row),
        )
        weather, recipe = np.tile(morning.weather[greenhouse], (2, 1)), np.tile(morning.recipe, (2, 1))
        template = for_site(self._site, morning.begin, len(weather), radiation=weather[:, RADIATION])
        worth, seeds = None, []
        if self._season is not None:
            past = self._past.get(greenhouse)
            worth = self._season.worth(self._site, morning.begin, present, past[-1].warmth if past else None)
            seeds = [self._season.setpoints(template, weather, recipe, morning.begin)]
        return optimise(
            self.believed(greenhouse),
            self._site,
            state,
            weather,
            recipe,
            np.random.default_rng(1000 * morning.day + greenhouse),
            self._budget,
            generation=SEARCH,
            template=template,
            seeds=seeds,
            worth=worth,
        )

    def learn(self, morning: Morning, outcome: Outcome, weather: Floats) -> None:
        """Remember what the day was."""
        for greenhouse, chosen in enumerate(self._chosen):
            had = {name: each[[greenhouse]] for name, each in totals(outcome).items()}
            warmth = float(outcome.air_temperature[:, greenhouse].mean())
            lived = Lived(morning.begin, _present(morning, greenhouse), weather[greenhouse], chosen, had, warmth)
            self._past.setdefault(greenhouse, deque(maxlen=RECENT_DAYS)).append(lived)


def _present(morning: Morning, greenhouse: int) -> dict[str, float]:
    return {name: float(value[greenhouse]) for name, value in morning.present.items()}


def main() -> int:
    """Tune, lead and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--days", type=int, default=45)
    parser.add_argument("--greenhouses", type=int, default=2)
    parser.add_argument("--generations", type=int, default=30)
    given = parser.parse_args()
    site, kinds = described("today", given.days), ways_of(given.days)
    season = season_of(site, given.days)
    found = rule_and_strategy(
        season, kinds["rule"], kinds["season"], tomato.mature_crop(season.plant, 1.0), given.generations
    )
    plan = valued(season, kinds["season"], found["season"][0], tomato.mature_crop(season.plant, 1.0))
    simulator = BundleSimulator(read_bundle(default_bundle_folder()), site.greenhouse, members=1)
    ways: dict[str, Way] = {
        "recipe": Recipe(),
        **{name: Led(kinds[name], genes[None]) for name, (genes, _) in found.items()},
        "by price": Planned(site, simulator, None, given.generations),
        "by season": Planned(site, simulator, plan, given.generations),
    }
    books, _ = lead(site, given.days, ways, {name: list(range(given.greenhouses)) for name in ways})
    title = f"{given.days} days, energy at today's prices"
    brought(title, {name: (money(site, book), book) for name, book in books.items()})
    return 0


if __name__ == "__main__":
    sys.exit(main())
