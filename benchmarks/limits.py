"""Whether any plan leaves a limit of the crop, or is worth less than the recipe by its own estimate.

    python -m benchmarks.limits [--cases 1000]

Random sites anywhere, with any limits that make sense, any state, weather and recipe; the search on the default
bundle's simulator. Each plan is inspected as a whole by `igrow.core.agronomy.inspection`, which is written apart from
what keeps the limits.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from datetime import time, timedelta

import numpy as np
from numpy.typing import NDArray

from igrow.core.agronomy import Place
from igrow.core.agronomy.inspection import violations
from igrow.core.bundle import default_bundle_folder, read_bundle
from igrow.core.greenhouse.recipe import COMPUTER
from igrow.core.planner import Budget, PlanningState, optimise
from igrow.core.planner.optimise import RADIATION
from igrow.core.quantities import SETPOINTS, USUAL_SETPOINTS
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Agronomy, Band, Greenhouse, Rest, Site

ZONES = ("Europe/Amsterdam", "UTC", "Asia/Kolkata", "America/New_York", "Australia/Adelaide", "Asia/Kathmandu")
HOURS = 48
QUICK = Budget(candidates=400)


def random_site(rng: np.random.Generator) -> Site:
    """Return a site anywhere, whose crop has any limits that make sense."""
    zone = ZONES[int(rng.integers(len(ZONES)))]
    site = Site("any", float(rng.uniform(-75, 75)), float(rng.uniform(-180, 180)), zone)
    night_low, day_low, highs = rng.uniform(12, 17), rng.uniform(13, 18), rng.uniform(19, 26, 2)
    mean_low = rng.uniform(max(13, night_low - 2, day_low - 2), 18)
    crop = Agronomy(
        dark_hours=float(rng.choice([0.0, 4.0, 6.0, 8.5, 12.0])),
        day_temperature=Band(float(day_low), float(highs[0])),
        night_temperature=Band(float(night_low), float(highs[1])),
        mean_temperature=Band(float(mean_low), float(mean_low + rng.uniform(2.2, 6))),
        temperature_difference=float(rng.uniform(1, 10)),
        temperature_drift=float(rng.uniform(0.4, 4)),
        light_sum_high=float(rng.uniform(4, 40)),
        co2_with_people=float(rng.uniform(450, 1200)),
        people_from=time(int(rng.integers(24)), 30),
        people_until=time(int(rng.integers(24)), 15),
        rest={"lamp_on": Rest(timedelta(hours=float(rng.uniform(0, 4))), timedelta(hours=float(rng.uniform(0, 4))))},
    )
    return replace(site, crop=replace(site.crop, agronomy=crop))


def random_weather(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the weather of two days, (48, 6)."""
    hour = np.arange(HOURS) % 24
    sun = np.maximum(np.sin((hour - rng.uniform(3, 9)) / 12 * np.pi), 0.0) * rng.uniform(0, 1000)
    cold = rng.uniform(-20, 35)
    rows = [cold + 0.01 * sun, np.full(HOURS, rng.uniform(30, 100)), np.full(HOURS, 420.0), sun]
    return np.column_stack([*rows, np.full(HOURS, rng.uniform(0, 15)), np.full(HOURS, cold - 10.0)])


def main() -> int:
    """Run all cases; the exit status tells whether one failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=1000)
    cases = parser.parse_args().cases
    simulator = BundleSimulator(read_bundle(default_bundle_folder()), Greenhouse(), members=1)
    left = worse = followed = 0
    for case in range(cases):
        rng = np.random.default_rng(case)
        site, weather = random_site(rng), random_weather(rng)
        start = np.datetime64("2020-01-01T00:00:00") + np.timedelta64(int(rng.integers(366 * 24)), "h")
        usual = rng.random((HOURS, len(USUAL_SETPOINTS))) * [20.0, 1000.0, 1.0, 1.0] + [10.0, 300.0, 0.0, 0.0]
        recipe = np.tile([{**COMPUTER, **dict.fromkeys(USUAL_SETPOINTS, 0.0)}[name] for name in SETPOINTS], (HOURS, 1))
        recipe[:, [SETPOINTS.index(name) for name in USUAL_SETPOINTS]] = usual
        initial = {"air_temperature": float(rng.uniform(10, 30)), "air_humidity": float(rng.uniform(40, 98))}
        result = optimise(simulator, site, PlanningState(start, initial), weather, recipe, rng, QUICK)
        place = Place.of(site)
        heating, co2, lamp = (
            result.setpoints[:, SETPOINTS.index(one)] for one in ("heating_setpoint", "co2_setpoint", "lamp_on")
        )
        seconds = float(start.astype("datetime64[s]").astype(np.int64))
        told = violations(place, seconds, heating, lamp, co2, place.sunlight(1.0) * weather[:, RADIATION])
        left += bool(told)
        gain = float(result.valuation.score.mean() - result.recipe_valuation.score.mean())
        worse += gain < -1e-9
        followed += result.follows_recipe
        if told:
            print(f"\ncase {case}: {told}")
        print(f"\r{case + 1} of {cases}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    print(f"{cases} plans: {left} left a limit, {worse} worth less than the recipe, {followed} were the recipe")
    return int(bool(left or worse))


if __name__ == "__main__":
    sys.exit(main())
