"""`igrow-trainer season`: plan a site's season, and write the bundle that carries what its days need of it."""

from __future__ import annotations

import argparse
import datetime
from dataclasses import replace
from pathlib import Path

import numpy as np

from igrow.core.bundle import default_bundle_folder, read_bundle, self_test
from igrow.core.errors import IgrowError
from igrow.core.planner.season.search import GENERATIONS
from igrow.core.site import load_site
from igrow.trainer.data import read_log
from igrow.trainer.exporting import export, read_model
from igrow.trainer.season import plan_season

EXAMPLE = "igrow-trainer season --site config/site.yaml --bundle out/bundle --weather data/2019 --out out/with-season"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("--site", type=Path, required=True, help="site file: dates of the crop, prices, limits")
    parser.add_argument("--bundle", type=Path, help="bundle that brings the simulator (default: the built-in one)")
    parser.add_argument("--weather", type=Path, help="log with the weather of a year or more at the place")
    parser.add_argument(
        "--from", dest="begins", type=datetime.date.fromisoformat, help="first day (default: the planting date)"
    )
    parser.add_argument("--generations", type=int, default=GENERATIONS, help=f"of the search (default {GENERATIONS})")
    parser.add_argument("--out", type=Path, required=True, help="folder for the new bundle; must not exist yet")


def run(arguments: argparse.Namespace) -> int:
    """Plan, and write the bundle."""
    if arguments.out.exists():
        raise IgrowError(f"{arguments.out} exists already; name a new folder")
    site = load_site(arguments.site)
    bundle = read_bundle(arguments.bundle or default_bundle_folder())
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    plan = plan_season(
        site,
        bundle,
        begins=arguments.begins,
        weather=None if arguments.weather is None else read_log(arguments.weather, site).telemetry,
        generations=arguments.generations,
        partial=arguments.out.with_name(f".{arguments.out.name}.season"),
        progress=lambda line: print(line, flush=True),
    )
    print(f"expected: {plan.net_profit:.2f} EUR m-2 in {plan.days} days, fruit picked less costs")
    print("\n".join(plan.strategy.table(plan.genes)))
    print("  day     leaves     buffer  young fruit   old fruit   EUR for each kg of carbohydrate")
    for row, one in enumerate(plan.values):
        fruit = np.asarray(one.fruit)
        print(f"{row * plan.every:5d}{one.leaf:11.2f}{one.buffer:11.2f}{fruit[0]:13.2f}{fruit[-1]:12.2f}")
    written = export(replace(read_model(bundle, site), season=plan), arguments.out)
    worst = max(self_test(written), key=lambda deviation: deviation.relative)
    print(f"wrote {written.folder} ({written.label}); self-test: {worst.graph} {worst.output} {worst.relative:.1e}")
    return 0
