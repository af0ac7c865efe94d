"""The search: decode candidates, simulate them, value them, breed the next; the recipe is what they must beat."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from igrow.core.agronomy import Memory
from igrow.core.arrays import Floats, Times
from igrow.core.errors import IgrowError
from igrow.core.planner.evolution import WORST, Generation, NumpyGeneration, draw
from igrow.core.planner.objective import Objective, Valuation, Worth, cautious, damp_hours
from igrow.core.planner.template import Setpoints, Template, for_site
from igrow.core.quantities import SETPOINTS, WEATHER
from igrow.core.simulator.outcome import Outcome, Simulator
from igrow.core.site import Site

RADIATION = WEATHER.index("global_radiation")
NOT_ADMITTED = -1e6
"""Fitness of a candidate that leaves a limit of the climate, EUR m-2 for one at the limit."""


@dataclass(frozen=True)
class Budget:
    """When a search ends: the first of these. Counted in candidates, whatever a generation of the graph has of them."""

    candidates: int = 10_752
    """Most candidates that are tried: 28 generations of 384."""
    patience: int = 3_840
    """Candidates without a better one."""
    seconds: float = float("inf")
    """Time by the monotonic clock that is passed in."""


@dataclass(frozen=True)
class PlanningState:
    """Where the greenhouse stands when the plan begins."""

    time: np.datetime64
    """UTC start of the first hour."""
    initial: Mapping[str, float]
    """Present value of quantities, in the registry's units."""
    applied: Mapping[str, float] = field(default_factory=dict)
    """Setpoints in force, from which slew limits count."""
    co2_before: float = 0.0
    """kg m-2 of CO2 that the crop has had before."""
    memory: Memory | None = None
    """What the crop has had until then, as its limits count it; None where that is not known."""


@dataclass(frozen=True)
class PlanResult:
    """The plan, and what is expected of it."""

    setpoints: Setpoints
    """(H, S), one row an hour, in the order of `quantities.SETPOINTS`."""
    time: Times
    """UTC starts of the hours, (H,)."""
    expected_profit: float
    """EUR m-2 over the horizon, mean over the ensemble, without penalties and doubt."""
    recipe_profit: float
    """The same of the `baseline`."""
    doubt: float
    """Standard deviation of the gain over the recipe, over the ensemble, EUR m-2."""
    leaves_range: bool
    """The plan visits what the simulator was not trained on."""
    follows_recipe: bool
    """No candidate beat the recipe, so the plan is the recipe."""
    history: tuple[float, ...]
    """Best cautious gain over the recipe after each generation, EUR m-2."""
    outcome: Outcome
    """What the simulator expects of the plan, arrays (M, 1, H)."""
    valuation: Valuation
    """The plan's balance and penalties, arrays (M, 1)."""
    recipe_valuation: Valuation
    """The recipe's."""
    recipe_outcome: Outcome
    """What the simulator expects of the recipe from now on, arrays (M, 1, H)."""
    baseline: Outcome
    """What it expects of the recipe had it led the day before, too, arrays (M, 1, H).

    After a plan that burned its lamps in the evening the recipe has to keep its own dark until the night's hours are
    full: a loss of that one morning, which a greenhouse that follows the recipe day by day never has.
    """
    objective: Objective
    """By which both were valued."""
    recipe: Setpoints
    """The recipe within all limits, (H, S)."""
    template: Template
    """By which candidates were decoded."""
    binding: tuple[Mapping[str, tuple[str, ...]], ...]
    """By hour and setpoint: the crop's limits that kept it from what the search asked for."""

    def profits(self, hours: int) -> tuple[float, float]:
        """Return what plan and `baseline` are expected to earn in the first hours, EUR m-2, mean over the ensemble."""
        objective = self.objective.first(hours)
        plan, recipe = (objective.value(one.first(hours)).profit.mean() for one in (self.outcome, self.baseline))
        return float(plan), float(recipe)


def optimise(
    simulator: Simulator,
    site: Site,
    state: PlanningState,
    forecast: Floats,
    recipe: Setpoints,
    rng: np.random.Generator,
    budget: Budget | None = None,
    *,
    generation: Generation | None = None,
    template: Template | None = None,
    seeds: Sequence[Setpoints] = (),
    worth: Worth | None = None,
    monotonic: Callable[[], float] = clock.monotonic,
) -> PlanResult:
    """Search for setpoints that earn more than the recipe.

    Args:
        simulator: says what setpoints do.
        site: limits, prices, planning.
        state: where the greenhouse stands.
        forecast: weather of the horizon, (H, 6), the hours' means in the registry's order.
        recipe: the grower's setpoints over the horizon, (H, S).
        rng: random numbers; the same generator state gives the same plan unless `budget.seconds` ends the search.
        budget: when to end.
        generation: the genetic algorithm, in numpy or from optimizer.onnx.
        template: genes to setpoints; that of `for_site` by default.
        seeds: what is known to be good beside the recipe, (H, S) each, such as what the season asks for. The search
            starts from what of them its genes can say, and each competes as it is.
        worth: what growth is worth to the crop; by default the average price of the days on which it ripens.
        monotonic: clock in seconds.

    Raises:
        IgrowError: where the forecast or the recipe has the wrong shape or a value is missing.
    """
    hours = len(forecast)
    for name, array, shape in (("forecast", forecast, (hours, 6)), ("recipe", recipe, (hours, len(SETPOINTS)))):
        if array.shape != shape or not np.isfinite(array).all():
            raise IgrowError(f"the {name} must have shape {shape} without missing values, not {array.shape}")
    budget = budget or Budget()
    run = generation or NumpyGeneration()
    time = state.time.astype("datetime64[s]") + np.arange(hours) * np.timedelta64(3600, "s")
    template = template or for_site(
        site, state.time, hours, radiation=forecast[:, RADIATION], known=simulator.setpoints
    )
    objective = Objective(site, time, state.co2_before, worth)
    applied = np.array([state.applied.get(name, np.nan) for name in SETPOINTS])
    known = [template.follow(one[None], applied, state.memory) for one in (recipe, *seeds)]
    followed = known[0].setpoints[0]

    def simulate(setpoints: Setpoints) -> tuple[Outcome, Valuation]:
        outcome = simulator.simulate(dict(state.initial), forecast, setpoints, state.time)
        return outcome, objective.value(outcome)

    recipe_outcome, recipe_valuation = simulate(followed[None])
    # No plan may expect more damp hours than the crop bears, or than the recipe has too where that is more.
    damp = max(site.crop.agronomy.damp_hours, float(damp_hours(recipe_outcome, site)[0]))

    def fitness(setpoints: Setpoints) -> NDArray[np.float32]:
        outcome, valuation = simulate(setpoints)
        gain, _ = cautious(valuation, recipe_valuation, site.planning.caution)
        too_damp = np.maximum(damp_hours(outcome, site) - damp, 0.0)
        # The less a candidate leaves the limit the better, but any that does not is better still (Deb 2000, Comput.
        # Methods Appl. Mech. Eng. 186, 311-338).
        admitted = np.where(too_damp > 0.0, NOT_ADMITTED * (1.0 + too_damp), gain)
        return np.where(np.isfinite(gain), admitted, WORST).astype(np.float32)

    began = monotonic()
    settings = run.settings
    known_fitness = fitness(np.concatenate([one.setpoints for one in known]))
    offspring = _first_candidates(template, [followed, *seeds], settings.offspring, rng)
    parents = offspring[: settings.parents]
    parent_fitness = np.full(settings.parents, WORST, dtype=np.float32)
    history: list[float] = []
    best_at = 0
    for number in range(math.ceil(budget.candidates / settings.offspring)):
        offspring_fitness = fitness(template.decode(offspring, recipe, applied, state.memory))
        random = draw(rng, settings, template.genes)
        parents, parent_fitness, offspring = run(parents, parent_fitness, offspring, offspring_fitness, random)
        if not history or parent_fitness[0] > history[best_at] + 1e-6:
            best_at = number
        history.append(float(parent_fitness[0]))
        tried_since = (number - best_at) * settings.offspring
        if tried_since >= budget.patience or monotonic() - began >= budget.seconds:
            break

    best_known = int(known_fitness.argmax())
    course = known[best_known]
    found = bool(parent_fitness[0] > known_fitness[best_known])
    if found:
        course = template.follow(template.wanted(parents[:1], recipe), applied, state.memory)
    follows_recipe = not found and best_known == 0
    plan = course.setpoints[0]
    outcome, valuation = simulate(plan[None])
    _, doubt = cautious(valuation, recipe_valuation, site.planning.caution)
    baseline, baseline_valuation = recipe_outcome, recipe_valuation
    if state.memory is not None:
        baseline, baseline_valuation = simulate(_led_before(template, site, state.time, forecast, recipe)[None])
    return PlanResult(
        setpoints=plan,
        time=time,
        expected_profit=float(valuation.profit.mean()),
        recipe_profit=float(baseline_valuation.profit.mean()),
        doubt=float(doubt[0]),
        leaves_range=bool((outcome.outside > 0).any()),
        follows_recipe=follows_recipe,
        history=tuple(history),
        outcome=outcome,
        valuation=valuation,
        recipe_valuation=recipe_valuation,
        recipe_outcome=recipe_outcome,
        baseline=baseline,
        objective=objective,
        recipe=followed,
        template=template,
        binding=course.binding(),
    )


def _led_before(template: Template, site: Site, time: np.datetime64, forecast: Floats, recipe: Setpoints) -> Setpoints:
    """Return the recipe (H, S) from a time on within all limits, as if it had led the day before under the same sun."""
    before = for_site(site, time - np.timedelta64(24, "h"), 24, radiation=forecast[:24, RADIATION])
    led = before.follow(recipe[None, :24], np.full(len(SETPOINTS), np.nan))
    setpoints: Setpoints = template.follow(recipe[None], led.setpoints[:, -1], led.memory).setpoints[0]
    return setpoints


def _first_candidates(
    template: Template, starts: Sequence[Setpoints], count: int, rng: np.random.Generator
) -> NDArray[np.float32]:
    """Return the first generation (count, G): the starting points, variations on them, and random candidates."""
    known = np.stack([template.encode(start) for start in starts])[:count]
    near = known[rng.integers(len(known), size=max(0, count // 2 - len(known)))]
    near = np.clip(near + 0.2 * rng.standard_normal(near.shape), 0.0, 1.0)
    free = template.draw(rng, count - len(known) - len(near))
    return np.concatenate([known, near, free]).astype(np.float32)
