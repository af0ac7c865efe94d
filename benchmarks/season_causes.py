"""Why a season brings less than was expected of it: the strategy led through greenhouses that differ by one thing more.

    python -m benchmarks.season_causes [--first 20] [--greenhouses 20]

Each greenhouse stands three times under its own weather: as the mean of its kind, with its own parameters (8 % off),
and with its two undeclared effects too. Printed is what the season's simulator expects of the tuned strategy (today's
prices) over what each obtains, the median: by kind, then by undeclared effect among those that have it, and by 30 days
of the mean greenhouses, whose growth comes early or late. Greenhouses are counted on from those of
`benchmarks.seasons judge`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from benchmarks.season_greenhouses import EFFECTS, Greenhouse, Greenhouses, Led, lead, money
from benchmarks.seasons import GROWN_AND_USED, STRATEGIES, described, season_of, ways_of
from igrow.core.arrays import Floats
from igrow.core.greenhouse import GreenhouseParameters, tomato
from igrow.core.greenhouse.plant import Plant
from igrow.core.planner.season import SeasonOutcome, run_season

KINDS = ("the mean greenhouse", "8 % off", "with undeclared effects")
HEADS = ("net", "kg", "growth", "heat", "electricity", "CO2")
MONTH = 30
"""Days."""


class Kinds(Greenhouses):
    """Greenhouses in the order of `KINDS`, as many of each."""

    hidden: list[set[str]]
    """Names of each greenhouse's undeclared effects, where it has them."""

    def stand(self, each: Sequence[Greenhouse]) -> Plant:
        """Return the plant that these greenhouses are."""
        count = len(each) // len(KINDS)
        self.hidden = [{effect.name for effect in one.effects} for one in each[-count:]]
        mean = [replace(one, parameters=GreenhouseParameters(), effects=()) for one in each[:count]]
        off = [replace(one, effects=()) for one in each[count : 2 * count]]
        return super().stand([*mean, *off, *each[-count:]])


def by_month(outcome: SeasonOutcome, every: int) -> Floats:
    """Return what the season's crop is expected to grow in each whole 30 days, kg m-2."""
    grown = [float(np.squeeze(crop.net_growth)) for crop in (*outcome.crops, outcome.crop)]
    return np.diff(grown[:: MONTH // every])


def main() -> int:
    """Lead and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=20, help="number of the first greenhouse")
    parser.add_argument("--greenhouses", type=int, default=20)
    arguments = parser.parse_args()
    given = json.loads(STRATEGIES.read_text(encoding="utf-8"))
    days = given["days"]
    site, strategy = described("today", days), ways_of(days)["season"]
    genes = np.array([given["strategies"]["today"]["season"]["genes"]], dtype=np.float32)
    numbers = list(range(arguments.first, arguments.first + arguments.greenhouses))
    stood: list[Kinds] = []

    def stand(length: int, rows: Sequence[int]) -> Kinds:
        stood.append(Kinds(length, rows))
        return stood[-1]

    books, _ = lead(site, days, {kind: Led(strategy, genes) for kind in KINDS}, dict.fromkeys(KINDS, numbers), stand)
    season = season_of(site, days)
    outcome = run_season(season, strategy, genes, tomato.mature_crop(season.plant, 1.0))
    said = [outcome.balance.net_profit, outcome.harvest, *(outcome.used[name] for name in GROWN_AND_USED)]
    expected = np.array([float(one[0]) for one in said])
    ratios = {}
    for kind, book in books.items():
        had = [money(site, book)["net"], *(book[name].sum(axis=1) for name in ("kg", *GROWN_AND_USED))]
        ratios[kind] = expected / np.stack(had, axis=1)
    print(f"{'expected / obtained':38s}" + "".join(f"{head:>12s}" for head in HEADS))

    def show(label: str, rows: Floats) -> None:
        print(f"{label:38s}" + "".join(f"{cell:12.2f}" for cell in np.median(rows, axis=0)))

    for kind in KINDS:
        show(f"{kind}: {len(numbers)}", ratios[kind])
    for name in EFFECTS:
        has = np.array([name in one for one in stood[0].hidden])
        if has.any():
            show(f"  of these with {name}: {has.sum()}", ratios[KINDS[-1]][has])
    grown = books[KINDS[0]]["net_growth"].mean(axis=0)
    obtained = np.add.reduceat(grown, np.arange(0, days, MONTH))[: days // MONTH]
    months = by_month(outcome, season.every)
    print(f"\n{'days of the season':38s}" + "".join(f"{f'{MONTH * k} on':>12s}" for k in range(len(months))))
    print(f"{'growth, the mean greenhouse':38s}" + "".join(f"{cell:12.2f}" for cell in months / obtained))
    return 0


if __name__ == "__main__":
    sys.exit(main())
