"""Figure 4 of Cao et al. (2022) as far as data allow: a season by the genetic algorithm, SAC, and as growers led it.

    python -m benchmarks.figure_4 [--greenhouses 3] [--minutes 15] [--data FOLDER] [--figure FILE]

Each way leads a whole season in our simulator, and the same greenhouses' season in the mechanistic plant, which
differs from it by 8 % in each parameter and two undeclared effects, through the PLC's own control. Net profit is fruit
that was ripe and picked, less costs; six dark hours and all other limits of the crop hold for all.

recipe     the grower's day of the annotated site
growers    the realised setpoints of the growers' compartment (Reference) of the second Autonomous Greenhouse Challenge,
           2 January to 29 April 2020: heating, CO2 and lamps, hour by hour
champion   Automatoes's setpoints are not published. These are the growers', their heating shifted from day to day by
           how much warmer or colder his slabs were than theirs; his lamps used the same electricity within one percent
rule       one date's numbers for the whole season, tuned by the elitist genetic algorithm on the simulator (EGA)
season     six dates' numbers, tuned by the same (EGA)
SAC        a policy of stable-baselines3's soft actor-critic, trained on the simulator for `--minutes` of the processor
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.figure_4_ways import DAYS, GROWN, SIMULATED, Learning, Tuning, World, led, prepare
from benchmarks.jobs import Jobs
from benchmarks.season_greenhouses import money
from benchmarks.seasons import brought, described
from igrow.core.arrays import Floats
from igrow.core.planner.season.search import GENERATIONS, SETTINGS
from igrow.core.site import Site


def main() -> int:
    """Tune, train, lead and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--greenhouses", type=int, default=3)
    parser.add_argument("--minutes", type=float, default=15.0, help="of the processor for SAC's training")
    parser.add_argument("--data", type=Path, default=Path("../shared/data/agc2019"))
    parser.add_argument("--figure", type=Path, help="SVG to write")
    given = parser.parse_args()
    with Jobs("figure 4", processes=2) as jobs:
        tuning, learning = jobs.each(prepare, [0.0, given.minutes])
        assert isinstance(tuning, Tuning) and isinstance(learning, Learning)
        worlds = [
            World(where, tuning, learning, given.greenhouses, given.data.resolve()) for where in (SIMULATED, GROWN)
        ]
        books = dict(zip((SIMULATED, GROWN), jobs.each(led, worlds), strict=True))
    each = SETTINGS.offspring * GENERATIONS
    course = ", ".join(f"{gain:+.3f}" for gain in learning.course)
    print(
        f"EGA: {tuning.seconds / 60.0:.1f} minutes of the processor, {each} simulated seasons each for rule and season"
    )
    print(
        f"SAC: {learning.seconds / 60.0:.1f} minutes of the processor, {learning.days} simulated days; it earned more"
    )
    print(f"     than the recipe while it explored, by sixths of the training: {course} EUR m-2 a day")
    site = described("today", DAYS)
    for where, led_by in books.items():
        brought(f"{where}, {DAYS} days", {name: (money(site, book), book) for name, book in led_by.items()})
    if given.figure:
        draw(given.figure, site, books)
    return 0


def draw(path: Path, site: Site, books: Mapping[str, Mapping[str, Mapping[str, Floats]]]) -> None:
    """Draw cumulative net profit from day to day, mean over the greenhouses, in the simulator and in the plant."""
    from igrow.trainer.figure_style import name_above, panels  # noqa: PLC0415, only this draws

    figure, axes = panels(2, 6.4, width=6.0)
    strokes = ("-", "--", ":", "-.", (0, (5, 1)), (0, (1, 1)))
    for panel, (where, each) in zip(axes, books.items(), strict=True):
        for number, (name, book) in enumerate(each.items()):
            until = range(1, DAYS + 1)
            net = [money(site, {key: one[:, :day] for key, one in book.items()})["net"].mean() for day in until]
            panel.plot(np.array(until), net, linestyle=strokes[number], color=f"C{number}", label=name)
        name_above(panel, f"cumulative net profit {where}, EUR/m²")
    axes[0].legend(loc="upper left", fontsize=8.5, frameon=False)
    axes[-1].set_xlabel("day of the season")
    figure.savefig(path, facecolor="white")


if __name__ == "__main__":
    sys.exit(main())
