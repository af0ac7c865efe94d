"""What each change of a plan is for: the same plan with one change taken back, simulated beside it."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from zoneinfo import ZoneInfo

import numpy as np

from igrow.core.arrays import Floats, Integers
from igrow.core.economics import Balance
from igrow.core.planner.optimise import PlanningState, PlanResult
from igrow.core.planner.template import Setpoints, Template
from igrow.core.quantities import QUANTITIES, SETPOINTS
from igrow.core.simulator.outcome import Simulator

PARTS = ("income", "heat", "electricity", "co2")
WORDS = {"income": "growth", "heat": "heat", "electricity": "electricity", "co2": "CO2"}
SAME = {
    "heating_setpoint": 0.25,
    "co2_setpoint": 20.0,
    "lamp_on": 0.05,
    "irrigation_on": 0.05,
    "humidity_setpoint": 0.75,
    "ventilation_setpoint": 0.25,
    "minimum_pipe_setpoint": 2.0,
    "energy_screen_setpoint": 5.0,
}
"""A smaller difference from the recipe is none."""
MOST = 8
"""Changes that are told of, those that matter most."""
INTERVAL = 1.96
"""Standard deviations on either side of an interval of 95 %."""


@dataclass(frozen=True)
class Amount:
    """EUR m-2, with its standard deviation over the ensemble."""

    mean: float
    deviation: float

    @property
    def interval(self) -> tuple[float, float]:
        """Of 95 %."""
        return self.mean - INTERVAL * self.deviation, self.mean + INTERVAL * self.deviation


@dataclass(frozen=True)
class Change:
    """One stretch of hours in which a plan departs from the recipe in one setpoint, and what that brings."""

    setpoint: str
    start: float
    """Seconds since 1970 UTC."""
    end: float
    plan: float
    """Mean over the stretch, in the setpoint's unit."""
    recipe: float
    parts: Mapping[str, float]
    """What the change adds to each of `PARTS`, EUR m-2: income, and costs."""
    gain: Amount

    def sentence(self, zone: ZoneInfo) -> str:
        """Return it for people."""
        begin, end = (datetime.datetime.fromtimestamp(one, zone) for one in (self.start, self.end))
        unit = QUANTITIES[self.setpoint].unit
        unit = "" if unit == "1" else f" {unit}"
        told = (
            ", ".join(f"{self.parts[name]:+.3f} {WORDS[name]}" for name in PARTS if abs(self.parts[name]) >= 5e-4)
            or "next to nothing in money"
        )
        low, high = self.gain.interval
        return (
            f"{begin:%a %H:%M} to {end:%a %H:%M}: {self.setpoint} {self.plan:.3g}{unit} instead of "
            f"{self.recipe:.3g}{unit}: {told}; gain {self.gain.mean:+.3f} ({low:+.3f} to {high:+.3f})"
        )


@dataclass(frozen=True)
class Explanation:
    """What a plan is expected to bring over its horizon, and why."""

    plan: Mapping[str, Amount]
    """By `PARTS` and ``profit``."""
    recipe: Mapping[str, Amount]
    gain: Amount
    changes: tuple[Change, ...]
    """By the size of what they bring."""


def explain(
    simulator: Simulator,
    state: PlanningState,
    forecast: Floats,
    result: PlanResult,
    horizon: int | None = None,
) -> Explanation:
    """Return why a plan is as it is; the arguments are those of `optimise`, and what it returned.

    A change is taken back alone, so that changes which need each other (lamps and their CO2) do not add up to the
    whole. What the recipe brings is told of a greenhouse that has always followed it. Of a search that looked beyond
    the plan's own `horizon` (h), the money is that of its hours; a change that begins within them is told with all
    that it does until the search's end.
    """
    horizon = horizon or len(result.setpoints)
    recipe, template = result.recipe, result.template
    objective = result.objective
    applied = np.array([state.applied.get(name, np.nan) for name in SETPOINTS])
    stretches = [one for one in _stretches(template, result.setpoints, recipe) if one[1][0] < horizon]
    back = np.repeat(result.setpoints[None], len(stretches) + 1, axis=0)
    for row, (column, hours) in enumerate(stretches, start=1):
        back[row, hours, column] = recipe[hours, column]
    # Row 0 is the plan itself: limits change nothing of it.
    limited = template.limit(back, applied, state.memory)
    balance = objective.value(simulator.simulate(dict(state.initial), forecast, limited, state.time)).balance
    changes = []
    seconds = result.time.astype("datetime64[s]").astype(np.int64)
    for row, (column, hours) in enumerate(stretches, start=1):
        added = {name: _part(balance, name)[:, 0] - _part(balance, name)[:, row] for name in PARTS}
        gain = balance.net_profit[:, 0] - balance.net_profit[:, row]
        changes.append(
            Change(
                SETPOINTS[column],
                float(seconds[hours[0]]),
                float(seconds[hours[-1]]) + 3600.0,
                float(result.setpoints[hours, column].mean()),
                float(recipe[hours, column].mean()),
                {name: float(values.mean()) for name, values in added.items()},
                _amount(gain),
            )
        )
    changes.sort(key=lambda change: -abs(change.gain.mean))
    own = objective.first(horizon)
    planned, followed = (own.value(one.first(horizon)).balance for one in (result.outcome, result.baseline))
    gain = planned.net_profit[:, 0] - followed.net_profit[:, 0]
    return Explanation(_amounts(planned), _amounts(followed), _amount(gain), tuple(changes[:MOST]))


def _stretches(template: Template, plan: Setpoints, recipe: Setpoints) -> Iterator[tuple[int, Integers]]:
    """Yield setpoints and the hours that follow one another in which the plan departs from the recipe."""
    for name in template.free:
        column = SETPOINTS.index(name)
        away = plan[:, column] - recipe[:, column]
        sign = np.where(np.abs(away) > SAME[name], np.sign(away), 0.0)
        edges = np.flatnonzero(np.diff(sign, prepend=0.0, append=0.0) != 0.0)
        for first, last in pairwise(edges.tolist()):
            if sign[first] != 0.0:
                yield column, np.arange(first, last)


def _part(balance: Balance, name: str) -> Floats:
    values: Floats = getattr(balance, name)
    return values


def _amounts(balance: Balance) -> dict[str, Amount]:
    amounts = {name: _amount(_part(balance, name)[:, 0]) for name in PARTS}
    return amounts | {"profit": _amount(balance.net_profit[:, 0])}


def _amount(values: Floats) -> Amount:
    return Amount(float(values.mean()), float(values.std()))


def limits_in_force(binding: Mapping[str, Sequence[Sequence[str]]]) -> Iterator[tuple[str, str, int, int]]:
    """Yield setpoint, limit, and first and last step of each stretch of a plan in which the limit stood in the way."""
    for setpoint, steps in binding.items():
        for limit in dict.fromkeys(name for step in steps for name in step):
            bound = np.array([limit in step for step in steps])
            edges = np.flatnonzero(np.diff(bound.astype(int), prepend=0, append=0))
            for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
                yield setpoint, limit, first, last - 1
