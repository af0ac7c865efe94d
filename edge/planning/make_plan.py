"""From a request to a plan: what the planning process runs."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from igrow.core.agronomy import Place, remember
from igrow.core.bundle import Bundle, read_bundle
from igrow.core.co2_count import co2_since_planting
from igrow.core.errors import IgrowError
from igrow.core.planner import Budget, PlanningState, PlanResult, optimise
from igrow.core.planner.explain import explain, limits_in_force
from igrow.core.planner.onnx_generation import OnnxGeneration
from igrow.core.planner.recent_use import (
    SCALED,
    Corrected,
    factors,
    grown_days,
    growth_of_days,
    totals,
    used_in,
    warmer,
)
from igrow.core.planner.season import CropWorth, SeasonPlan
from igrow.core.planner.season.course import RADIATION
from igrow.core.planner.season.strategy import UNITS
from igrow.core.planner.template import for_site
from igrow.core.planner.weather_ensemble import WeatherEnsemble
from igrow.core.quantities import QUANTITIES, SETPOINTS
from igrow.core.simulator.growth import GrowthBalance
from igrow.core.simulator.outcome import Simulator
from igrow.core.simulator.plan import BundleSimulator
from igrow.core.site import Greenhouse, Site
from igrow.core.telemetry import Telemetry
from igrow.edge.planning.forecast import forecast_in_time, from_forecast, hourly, persistence, without_gaps
from igrow.edge.ports import Plan, PlanRequest

HOUR = 3600
DAY = 24 * HOUR
RECENT_DAYS = 3
"""Whole days of the log that plans are corrected by."""
PRESENT_SECONDS = 2 * HOUR
"""A value of the log that is older says nothing about the present (slow quantities excepted)."""
VALID_HOURS = 24
"""Longest time a plan is followed, where the site's pace of planning is not slower."""
BEYOND = 24
"""Hours that are searched beyond the last one that is followed. A night's dark hours count over midnight: a plan that
ends there burns the lamps until it ends, at the price of the next morning's light, which it does not see."""
SLOW = ("leaf_area_index", "plant_load", "net_growth", "fruit_fresh_weight")
"""Quantities whose last value counts, however old: they are counted by hand, weekly."""


def make_plan(site: Site, request: PlanRequest) -> Plan:
    """Search for the setpoints over the request's horizon; raises IgrowError where something is missing."""
    bundle, simulator, generation, season = _open(request.bundle, site.greenhouse)
    start = int(request.time)
    horizon = round(len(next(iter(request.recipe.values()))) * request.step_seconds)
    followed = min(horizon, max(VALID_HOURS * HOUR, round(site.planning.replan_every.total_seconds())))
    # The simulator knows whole days; the hours beyond the horizon are planned too, and not used.
    hours = 24 * math.ceil(max(horizon, followed + BEYOND * HOUR) / DAY)
    members, problem = forecast_in_time(request.forecast)
    courses = [from_forecast(one, request.telemetry, start, hours) for one in members]
    if not courses:
        usual, lacking = _without_forecast(request.telemetry, season, start, hours)
        courses, problem = [usual], "; ".join(filter(None, (problem, lacking)))
    forecast = np.mean(courses, axis=0)
    state = PlanningState(
        time=np.datetime64(start, "s"),
        initial=beginning(request.telemetry, start),
        applied=present(request.telemetry.only(name for name in SETPOINTS if name in request.telemetry), start),
        co2_before=co2_since_planting(site, request.telemetry, start, request.co2_counted),
        memory=remember(Place.of(site), request.telemetry, start),
    )
    corrected = recently(simulator, simulator.growth, site, request.telemetry, start)
    expected = corrected if len(courses) == 1 else WeatherEnsemble(corrected, courses)
    worth = None if season is None else season.worth(site, state.time, state.initial, warmth(request.telemetry, start))
    recipe = hourly_recipe(site, request, hours)
    template = for_site(site, state.time, hours, radiation=forecast[:, RADIATION], known=simulator.setpoints)
    # What the season asks of these days is the first candidate.
    seeds = [] if season is None or worth is None else [season.setpoints(template, forecast, recipe, state.time)]
    result = optimise(
        expected,
        site,
        state,
        forecast,
        recipe,
        np.random.default_rng(request.seed),
        Budget(),
        generation=generation,
        template=template,
        seeds=seeds,
        worth=worth,
    )
    steps = round(horizon / request.step_seconds)
    hour_of_step = [int(step * request.step_seconds) // HOUR for step in range(steps)]
    outcome = result.outcome
    own = hour_of_step[-1] + 1
    expected_profit, recipe_profit = result.profits(own)
    binding = _by_step(result.binding, hour_of_step)
    return Plan(
        created=request.time,
        start=request.time,
        step_seconds=request.step_seconds,
        setpoints={
            name: tuple(float(result.setpoints[hour, column]) for hour in hour_of_step)
            for column, name in enumerate(SETPOINTS)
            if name in request.recipe
        },
        valid_until=request.time + followed,
        bundle=bundle.label,
        expected_profit=expected_profit,
        recipe_profit=recipe_profit,
        co2_before=state.co2_before,
        leaves_range=result.leaves_range,
        note=_note(result, binding, corrected),
        problem=problem,
        predicted={
            name: tuple(float(values[:, 0, hour].mean()) for hour in hour_of_step)
            for name, values in (
                ("air_temperature", outcome.air_temperature),
                ("air_humidity", outcome.air_humidity),
                ("air_co2", outcome.air_co2),
            )
        },
        binding=binding,
        explanation=explain(expected, state, forecast, result, own),
        season=() if season is None or worth is None else tuple(told(season, worth, state.time)),
    )


def _without_forecast(
    log: Telemetry, season: SeasonPlan | None, start: int, hours: int
) -> tuple[NDArray[np.float64], str]:
    """Return the weather of the last days, else what is usual at the date, and one line where it is that."""
    try:
        return persistence(log, start, hours), ""
    except IgrowError as error:
        time = np.datetime64(start, "s")
        if season is None or not season.covers(time):
            raise
        return season.typical_weather(time, hours), f"planned with the weather that is usual at this date: {error}"


def _note(result: PlanResult, binding: Mapping[str, Sequence[Sequence[str]]], corrected: Corrected) -> str:
    """Return what a grower must know of a plan beside its numbers."""
    bound = dict.fromkeys(f"{limit} ({name})".replace("_", " ") for name, limit, *_ in limits_in_force(binding))
    notes = [
        "follows the recipe: nothing better was found" if result.follows_recipe else "",
        f"limits of the crop that bind: {', '.join(bound)}" if bound else "",
        "" if corrected.growth is None or corrected.growth.told else corrected.growth.sentence,
    ]
    return "; ".join(filter(None, notes))


def told(season: SeasonPlan, worth: CropWorth, time: np.datetime64) -> Iterator[str]:
    """Yield what the season says of a day: its strategy, and what the crop is worth."""
    fresh = worth.plant.fruit_dry_matter
    oldest, youngest = worth.values.fruit[-1] * fresh, worth.values.fruit[0] * fresh
    yield (
        f"day {season.day_of(time):.0f} of {season.days} of the season, which is expected to bring "
        f"{season.net_profit:.2f} EUR m-2"
    )
    numbers = ", ".join(
        f"{name.replace('_', ' ')} {value:.3g} {UNITS[name]}" for name, value in season.numbers(time).items()
    )
    yield f"its strategy for this day: {numbers}"
    yield (
        f"growth is worth what it brings until the season's end: {oldest:.2f} EUR for a kg of fruit that is nearly "
        f"ripe, {youngest:.2f} for one that has just set, {worth.values.leaf:.2f} for a kg of leaves (dry), "
        f"{worth.values.buffer:.2f} for one of assimilates that nothing has used yet"
    )


def warmth(log: Telemetry, start: int) -> float:
    """Return the mean air temperature of the day before `start`, degC; NaN where the log does not tell it."""
    hours = hourly(log, start - DAY, 24, ("air_temperature",))
    return float(np.nanmean(hours)) if np.isfinite(hours).sum() > 12 else float("nan")


def _by_step(
    binding: Sequence[Mapping[str, tuple[str, ...]]], hour_of_step: Sequence[int]
) -> dict[str, tuple[tuple[str, ...], ...]]:
    """Return by setpoint and step the crop's limits that stood in the way; setpoints that none did are left out."""
    names = {name for hour in binding for name in hour}
    return {name: tuple(binding[hour].get(name, ()) for hour in hour_of_step) for name in sorted(names)}


def present(log: Telemetry, start: int) -> dict[str, float]:
    """Return the last value of each quantity before `start` that still counts."""
    seconds = log.time.astype(np.int64)
    values = {}
    for name, column in log.columns.items():
        usable = np.isfinite(column) & (seconds <= start)
        if name not in SLOW:
            usable &= seconds > start - PRESENT_SECONDS
        found = np.flatnonzero(usable)
        if len(found):
            values[name] = float(column[found[-1]])
    return values


def beginning(log: Telemetry, start: int) -> dict[str, float]:
    """Return what a simulated plan begins from: what is present, and the air's mean of the day before for the floor."""
    return present(log, start) | {"mean_air_temperature": warmth(log, start)}


def recently(simulator: Simulator, balance: GrowthBalance | None, site: Site, log: Telemetry, start: int) -> Corrected:
    """Return the simulator corrected by how the last whole days of the log departed from what it says of them."""
    begin = np.datetime64(start, "s")
    safe = {name: np.full(len(log), site.limits[name].safe) for name in SETPOINTS}
    log = log.with_columns({name: held for name, held in safe.items() if name not in log})
    # What a site took up lately its log of before does not hold.
    lately = [name for name in SETPOINTS if QUANTITIES[name].optional]
    log = log.with_columns({name: np.where(np.isfinite(log[name]), log[name], safe[name]) for name in lately})
    expected: dict[str, list[float]] = {name: [] for name in SCALED}
    used: dict[str, list[float]] = {name: [] for name in SCALED}
    warmth: list[tuple[float, float]] = []
    driven: list[tuple[float, float]] = []
    grown: list[float] = []
    for back in range(1, RECENT_DAYS + 1):
        morning = start - back * DAY
        day = log.select(begin - np.timedelta64(back * DAY, "s"), begin - np.timedelta64((back - 1) * DAY, "s"))
        setpoints = hourly(log, morning, 24, SETPOINTS)
        if not np.isfinite(setpoints).all():
            continue
        try:
            weather = without_gaps(hourly(log, morning, 24))
        except IgrowError:
            continue
        outcome = simulator.simulate(beginning(log, morning), weather, setpoints[None], np.datetime64(morning, "s"))
        measured = used_in(day, site.greenhouse)
        for column, values in ((expected, totals(outcome)), (used, measured)):
            for name in SCALED:
                column[name].append(float(np.mean(values[name])))
        air = hourly(log, morning, 24, ("air_temperature",))
        warmth.append((float(outcome.air_temperature.mean()), float(air.mean())))
        if balance is not None:
            driven.append(grown_days(balance, outcome))
            grown.append(measured["net_growth"])
    factor = factors(
        {name: np.array(values) for name, values in expected.items()},
        {name: np.array(values) for name, values in used.items()},
    )
    growth = None if balance is None else growth_of_days(balance, site.crop, driven, grown)
    return Corrected(simulator, factor, balance, growth, warmer(*np.array(warmth, dtype=np.float64).reshape(-1, 2).T))


def hourly_recipe(site: Site, request: PlanRequest, hours: int) -> NDArray[np.float64]:
    """Return the recipe (hours, S) in the order of `SETPOINTS`; a setpoint that the site lacks stands at safe."""
    table = np.empty((hours, len(SETPOINTS)))
    for column, name in enumerate(SETPOINTS):
        course = request.recipe.get(name)
        if course is None:
            table[:, column] = site.limits[name].safe
            continue
        given = [course[int(hour * HOUR / request.step_seconds)] for hour in range(_covered(course, request, hours))]
        # What lies beyond the course repeats the day before.
        for hour in range(hours):
            table[hour, column] = given[hour] if hour < len(given) else table[hour - min(24, len(given)), column]
    if not np.isfinite(table).all():
        raise IgrowError("the recipe holds a value that is no number")
    return table


def _covered(course: tuple[float, ...], request: PlanRequest, hours: int) -> int:
    """Return how many of the hours begin within a course."""
    return min(hours, math.ceil(len(course) * request.step_seconds / HOUR))


@functools.lru_cache(maxsize=1)
def _open(folder: Path, greenhouse: Greenhouse) -> tuple[Bundle, BundleSimulator, OnnxGeneration, SeasonPlan | None]:
    """Open the bundle in force once; a request with another bundle closes it."""
    bundle = read_bundle(folder)
    graphs = BundleSimulator(bundle, greenhouse), OnnxGeneration(bundle.graph("optimizer"))
    return bundle, *graphs, SeasonPlan.of(bundle)
