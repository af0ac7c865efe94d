"""Algorithm 1 with and without its lower level, in greenhouses that lack something the simulator does not know.

    python -m benchmarks.algorithm_1 [--days 35] [--greenhouses 3] [--first 0] [--generations 5] [--every 14]
        [--figure FILE]

Mechanistic greenhouses, each with other parameters (8 %), disturbances, sensor noise, and two undeclared effects: one
stands, one begins a week later. After four weeks under the recipe the upper level plans every day (K1)
by the season's marginal values: on the built-in bundle as it is; on the same corrected by what the last three days used
and grew; and, so corrected, on a simulator that the lower level renews every `--every` days (K2). That is the trainer's
road: the rows that were collected are calibrated to at first and diagnosed against the model in force from then on;
what unseen days bear out (the service's own rule) is exported as a bundle, and plans go on with it. All that counts is
fruit that was picked, less costs. Searches are smaller than the daemon's.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.logged_greenhouses import LATER, LoggedGreenhouses
from benchmarks.season_greenhouses import Greenhouses, Morning, Recipe, Way, lead, money
from benchmarks.season_plans import Planned
from benchmarks.seasons import brought, described, season_of, ways_of
from igrow.core.arrays import Floats
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.greenhouse import tomato
from igrow.core.planner import PlanResult
from igrow.core.planner.recent_use import totals
from igrow.core.planner.season import SeasonPlan, valued
from igrow.core.planner.season.search import rule_and_strategy
from igrow.core.simulator.outcome import Outcome, Simulator
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Site
from igrow.trainer import FittedModel, Log, calibrate, compare, diagnose, export, prepare_log, read_model
from igrow.trainer.service.recalibration import LEAST_GAIN, relative_gain

LOOKED_AT = 28
"""Newest days of a log that the lower level looks at."""
CLIMATE = {"air_temperature": "K", "air_humidity": "%", "air_co2": "ppm"}
TUNED = 24
"""Generations in which the season's strategy is tuned, whose marginal values all plans take."""
JUDGED = ("profit", "net_growth", "heat", "electricity", "co2")


class Watched(Planned):
    """Plans whose expectations are kept beside what the greenhouses then did."""

    def __init__(
        self, site: Site, simulator: BundleSimulator, season: SeasonPlan, generations: int, *, corrected: bool
    ) -> None:
        super().__init__(site, simulator, season, generations)
        self._corrected = corrected
        self._plans: dict[int, PlanResult] = {}
        self.books: dict[tuple[str, str], dict[int, float]] = {}
        """Sums over days, by what and whether expected or obtained, then by greenhouse."""

    def believed(self, greenhouse: int) -> Simulator:
        """Return the simulator in force, corrected or as it is."""
        return super().believed(greenhouse) if self._corrected else self.simulator(greenhouse)

    def plan(self, morning: Morning, greenhouse: int) -> PlanResult:
        """Return the plan of a greenhouse."""
        self._plans[greenhouse] = super().plan(morning, greenhouse)
        return self._plans[greenhouse]

    def learn(self, morning: Morning, outcome: Outcome, weather: Floats) -> None:
        """Book both sides of the day."""
        super().learn(morning, outcome, weather)
        for greenhouse, plan in self._plans.items():
            one = Outcome(**{name: value[:, [greenhouse]] for name, value in vars(outcome).items()})
            for side, what in (("expected", plan.outcome.first(24)), ("obtained", one)):
                found = {name: each.item() for name, each in totals(what).items()}
                found["profit"] = plan.objective.first(24).value(what).profit.mean().item()
                for name, amount in found.items():
                    book = self.books.setdefault((name, side), {})
                    book[greenhouse] = book.get(greenhouse, 0.0) + amount

    def expected_over_obtained(self, name: str) -> float:
        """Return the median greenhouse's ratio over the season."""
        expected, obtained = self.books[name, "expected"], self.books[name, "obtained"]
        return float(np.median([expected[greenhouse] / obtained[greenhouse] for greenhouse in expected]))


@dataclass(frozen=True)
class Turn:
    """One run of the lower level in one greenhouse."""

    day: int
    greenhouse: int
    before: FittedModel
    """The model in force."""
    after: FittedModel
    said: str


class Renewed(Watched):
    """The same with the lower level: each greenhouse's simulator is renewed from its log every so many days."""

    def __init__(
        self, site: Site, simulator: BundleSimulator, season: SeasonPlan, generations: int, every: int, out: Path
    ) -> None:
        super().__init__(site, simulator, season, generations, corrected=True)
        self._every = every
        self._out = out
        self._simulators: dict[int, BundleSimulator] = {}
        self._built_in = read_model(read_bundle(default_bundle_folder()), site)
        self._models: dict[int, FittedModel] = {}
        self.turns: list[Turn] = []
        self.greenhouses: LoggedGreenhouses | None = None
        """Whose logs are read; known when they stand."""

    def log(self, row: int, first: int, last: int) -> Log:
        """Return the log that was collected of a row."""
        assert self.greenhouses is not None
        return prepare_log(self.greenhouses.telemetry(row, first, last), self._site)

    def simulator(self, greenhouse: int) -> BundleSimulator:
        """Return the newest simulator of a greenhouse."""
        return self._simulators.get(greenhouse, self._simulator)

    def plan(self, morning: Morning, greenhouse: int) -> PlanResult:
        """Return the plan of a greenhouse, on a simulator that is renewed where that is due."""
        if morning.day % self._every == 0:
            self._renew(greenhouse, morning.day, morning.rows.start + greenhouse)
        return super().plan(morning, greenhouse)

    def _renew(self, greenhouse: int, day: int, row: int) -> None:
        log, before = self.log(row, day - LOOKED_AT, day), self._models.get(greenhouse, self._built_in)
        if greenhouse not in self._models:
            after, said = calibrate(log), "calibrated"
        else:
            result = diagnose(log, before)
            better = result.verdict != "data_fault" and relative_gain(result.errors) >= LEAST_GAIN
            after = result.corrected if better else before
            causes = ", ".join(one.effect for one in result.findings)
            said = f"{result.verdict} {causes}".strip() + ("" if better else "; the model stays")
        self.turns.append(Turn(day, greenhouse, before, after, said))
        print(f"\nday {day}, greenhouse {greenhouse}: {said}", file=sys.stderr, flush=True)
        if after is not before:
            bundle = export(after, self._out / f"{greenhouse}-{day}")
            self._models[greenhouse] = after
            self._simulators[greenhouse] = BundleSimulator(bundle, self._site.greenhouse, members=1)


def climate_errors(renewed: Renewed, row: int, days: int, every: int) -> dict[int, dict[str, list[Floats]]]:
    """Return by day of the turn, and ``before`` or ``after``: each greenhouse's errors a day ahead by `CLIMATE`.

    On the days until the next turn, which no step of the lower level had seen; `row` is the first greenhouse's.
    """
    found: dict[int, dict[str, list[Floats]]] = {}
    for turn in renewed.turns:
        later = renewed.log(row + turn.greenhouse, turn.day, min(turn.day + every, days))
        scores = compare({"before": turn.before, "after": turn.after}, later, ("24_h",)).scores
        for name, one in scores.items():
            errors = np.array([one[quantity]["24_h"].mae for quantity in CLIMATE])
            found.setdefault(turn.day, {}).setdefault(name, []).append(errors)
    return found


def main() -> int:
    """Tune, lead and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--days", type=int, default=35)
    parser.add_argument("--greenhouses", type=int, default=3)
    parser.add_argument("--first", type=int, default=0, help="number of the first greenhouse")
    parser.add_argument("--generations", type=int, default=5, help="of each day's search")
    parser.add_argument("--every", type=int, default=14, help="days between two runs of the lower level (K2)")
    parser.add_argument("--figure", type=Path, help="SVG to write")
    given = parser.parse_args()
    numbers = list(range(given.first, given.first + given.greenhouses))
    site, kinds = described("today", given.days), ways_of(given.days)
    season = season_of(site, given.days)
    crop = tomato.mature_crop(season.plant, 1.0)
    genes, _ = rule_and_strategy(season, kinds["rule"], kinds["season"], crop, TUNED)["season"]
    plan = valued(season, kinds["season"], genes, crop)
    simulator = BundleSimulator(read_bundle(default_bundle_folder()), site.greenhouse, members=1)
    with tempfile.TemporaryDirectory() as folder:
        renewed = Renewed(site, simulator, plan, given.generations, given.every, Path(folder))
        planned: dict[str, Watched] = {
            "as it is": Watched(site, simulator, plan, given.generations, corrected=False),
            "recent use": Watched(site, simulator, plan, given.generations, corrected=True),
            "lower level": renewed,
        }
        ways: dict[str, Way] = {"recipe": Recipe(), **planned}

        def stood(days: int, numbers: Sequence[int]) -> Greenhouses:
            renewed.greenhouses = LoggedGreenhouses(days, numbers)
            return renewed.greenhouses

        books, _ = lead(site, given.days, ways, dict.fromkeys(ways, numbers), stood)
        errors = climate_errors(renewed, list(ways).index("lower level") * given.greenhouses, given.days, given.every)
    brought(f"{given.days} days", {name: (money(site, book), book) for name, book in books.items()})
    print(f"\n{'expected / obtained':22s}" + "".join(f"{name:>12s}" for name in JUDGED))
    for name, way in planned.items():
        print(f"{name:22s}" + "".join(f"{way.expected_over_obtained(what):12.2f}" for what in JUDGED))
    tell(renewed, errors)
    if given.figure:
        draw(given.figure, site, books, errors)
    return 0


def tell(renewed: Renewed, errors: Mapping[int, Mapping[str, list[Floats]]]) -> None:
    """Print the simulators' errors before and after each run of the lower level, and what it said."""
    heads = [f"{quantity.removeprefix('air_')}, {unit}" for quantity, unit in CLIMATE.items()]
    print(f"\n{'error a day ahead':22s}" + "".join(f"{head:>18s}" for head in heads))
    for day, both in errors.items():
        for when, each in both.items():
            cells = "".join(f"{value:18.2f}" for value in np.mean(each, axis=0))
            print(f"{f'day {day}, {when}':22s}{cells}")
    print("\nwhat the lower level said")
    assert renewed.greenhouses is not None
    for turn in renewed.turns:
        stands, begins = renewed.greenhouses.hidden[turn.greenhouse]
        print(f"greenhouse {turn.greenhouse} ({stands}; from day {LATER} on {begins}), day {turn.day}: {turn.said}")


def draw(
    path: Path, site: Site, books: Mapping[str, Mapping[str, Floats]], errors: Mapping[int, Mapping[str, list[Floats]]]
) -> None:
    """Draw what plans netted more than the recipe from day to day, and the simulators' error of temperature."""
    from igrow.trainer.figure_style import COLOURS, name_above, panels  # noqa: PLC0415, only this draws

    figure, (gain, error) = panels(2, 5.0, width=6.0)
    days = books["recipe"]["kg"].shape[1]

    def net(name: str) -> Floats:
        """Return the net profit of the greenhouses until each day, (days,), mean."""
        until = range(1, days + 1)
        return np.array(
            [money(site, {key: one[:, :day] for key, one in books[name].items()})["net"].mean() for day in until]
        )

    strokes = {
        "as it is": ("deployed", ":"),
        "recent use": ("recalibrated", "--"),
        "lower level": ("corrected", "-"),
    }
    for name, (colour, stroke) in strokes.items():
        gain.plot(np.arange(1, days + 1), net(name) - net("recipe"), stroke, color=COLOURS[colour], label=name)
    name_above(gain, "net profit more than by the recipe, EUR/m²")
    gain.legend(loc="upper left", fontsize=8.5, frameon=False)
    turns = sorted(errors)
    for name, colour, stroke in (("before", "deployed", ":"), ("after", "corrected", "-")):
        for number, day in enumerate(turns):
            until = turns[number + 1] if number + 1 < len(turns) else days
            level = float(np.mean(errors[day][name], axis=0)[0])
            label = f"the simulator {name} the turn" if number == 0 else None
            error.plot([day, until], [level, level], stroke, color=COLOURS[colour], label=label)
    error.set_ylim(bottom=0.0)
    name_above(error, "error of the temperature a day ahead, K")
    error.legend(loc="lower left", fontsize=8.5, frameon=False)
    error.set_xlabel("day of the season")
    figure.savefig(path, facecolor="white")


if __name__ == "__main__":
    sys.exit(main())
