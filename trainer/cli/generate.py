"""`igrow-trainer generate`: simulate greenhouses with the mechanistic model and write their logs."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

from igrow.core.errors import IgrowError
from igrow.core.greenhouse import generate_weather, recipe, simulate_many
from igrow.core.greenhouse.described import parameters_of, parse_effect
from igrow.core.greenhouse.recipe import varied_recipe
from igrow.core.greenhouse.weather import WeatherClimate
from igrow.core.site import load_site
from igrow.core.telemetry import Telemetry, read_csv, write_csv
from igrow.trainer.cli.progress import days_done

EXAMPLE = "igrow-trainer generate --site config/site.yaml --days 28 --effect wind_infiltration=0.1 --out out/virtual"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's options."""
    parser.add_argument("--site", type=Path, required=True, help="site file: place and equipment of the greenhouse")
    parser.add_argument("--out", type=Path, required=True, help="folder for the logs, one file a greenhouse")
    parser.add_argument("--days", type=int, default=28, help="length of each log (default 28)")
    parser.add_argument("--count", type=int, default=1, help="number of greenhouses, which differ a little (default 1)")
    parser.add_argument("--spread", type=float, default=0.08, help="how much they differ, relative (default 0.08)")
    parser.add_argument("--start", default="2020-02-01", help="first day, UTC (default 2020-02-01)")
    parser.add_argument("--weather", type=Path, help="telemetry file with weather; without one it is generated")
    parser.add_argument(
        "--setpoints", choices=("recipe", "varied"), default="recipe", help="who commands (default recipe)"
    )
    parser.add_argument(
        "--effect", action="append", default=[], metavar="NAME[=SIZE][@START]", help="an effect that no model knows of"
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of weather, parameters, disturbances and noise (default 0)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Simulate and write."""
    site = load_site(arguments.site)
    effects = [parse_effect(text) for text in arguments.effect]
    try:
        start = np.datetime64(arguments.start.removesuffix("Z"), "s")
    except ValueError:
        raise IgrowError(f"--start {arguments.start}: a day such as 2020-02-01 is right") from None
    if arguments.days < 1 or arguments.count < 1:
        raise IgrowError("--days and --count must be at least 1")
    end = start + np.timedelta64(arguments.days, "D")
    random = np.random.default_rng(arguments.seed)
    place = WeatherClimate(site.latitude, site.longitude)
    weather = read_csv(arguments.weather) if arguments.weather else None
    plants = [parameters_of(site).varied(random, arguments.spread) for _ in range(arguments.count)]
    setpoints: list[Telemetry] | Callable[[np.datetime64], dict[str, float]] = recipe
    if arguments.setpoints == "varied":
        setpoints = [varied_recipe(start, end, random) for _ in plants]
    weathers = weather or [
        generate_weather(start, end, seed=arguments.seed + row, climate=place) for row in range(len(plants))
    ]
    with days_done(f"simulating {arguments.count} greenhouses", start, end) as reached:
        seasons = simulate_many(
            plants,
            weathers,
            setpoints,
            start,
            end,
            count=len(plants),
            seed=arguments.seed,
            effects=effects,
            reached=reached,
        )
    arguments.out.mkdir(parents=True, exist_ok=True)
    for number, season in enumerate(seasons):
        path = arguments.out / f"greenhouse-{number:03d}.csv.gz"
        write_csv(path, season.measured)
        used = ", ".join(f"{name} {season.total(name):.4g}" for name in ("heat", "electricity", "co2"))
        print(f"{path}: {len(season.measured)} rows; {used} (MJ, kWh, kg per m2)")
    return 0
