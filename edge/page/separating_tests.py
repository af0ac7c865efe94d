"""Separating tests in words: what the diagnosis asks for, what each would do, and how the approved one stands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from igrow.core.language import N_
from igrow.core.separating_tests import Condition, SeparatingTest, separating_tests_for
from igrow.edge.configuration import Configuration
from igrow.edge.page.words import Words
from igrow.edge.separating_tests import Approval, possible
from igrow.edge.separating_tests.possible import conditions_of

WHEN = {
    "night": N_("at night, whole between sunset and sunrise"),
    "day": N_("by day, whole between sunrise and sunset"),
}


@dataclass(frozen=True)
class Asked:
    """One test that waits for the grower, or that he has approved."""

    name: str
    title: str
    course: str
    """What it moves, and for how long."""
    when: str
    tells: str
    """Why it is asked for, or what it tells apart."""
    stands: str
    """How it stands once it is approved; empty before."""
    approvable: bool


@dataclass(frozen=True)
class Panel:
    """What the page shows of separating tests."""

    tests: tuple[Asked, ...]
    last: str
    """What became of the last one; empty while one is approved."""


def panel(
    configuration: Configuration, state: Mapping[str, Any], approval: Approval | None, say: Words, now: float
) -> Panel | None:
    """Return the tests that are asked for and the approved one; None where there are none, or they are not permitted.

    Args:
        configuration: of the daemon.
        state: what the daemon says.
        approval: the last one, as its file has it.
        say: the visitor's language.
        now: seconds since 1970 UTC.
    """
    if not configuration.file.separating_tests.permitted:
        return None
    here = possible(configuration)
    asked: dict[str, tuple[str, ...]] = {}
    for effects in state["bundle"].get("confounded") or ():
        for test in separating_tests_for(effects):
            asked.setdefault(test.name, tuple(effects))
    open_one = approval if approval is not None and not approval.is_over else None
    names = dict.fromkeys([*([open_one.test] if open_one is not None else []), *asked])
    tests = []
    for name in names:
        if name in here:
            stands = _stands(open_one, state, say, now) if open_one is not None and name == open_one.test else ""
            tests.append(_asked(configuration, here[name], asked.get(name, ()), stands, open_one is None, say))
    last = ""
    if approval is not None and approval.is_over:
        why = say.told(approval.ended, now)
        last = say.whole(say.text("The last test, {test}, has ended: {why}", test=say.spoken(approval.test), why=why))
    return Panel(tuple(tests), last) if tests else None


def _asked(
    configuration: Configuration,
    test: SeparatingTest,
    effects: tuple[str, ...],
    stands: str,
    approvable: bool,
    say: Words,
) -> Asked:
    points = configuration.register_map.points
    weather = say.language.listed(
        [
            _range(one, say)
            for one in conditions_of(test, configuration.site)
            if one.quantity in points or not one.if_measured
        ]
    )
    # Names of effects have commas of their own.
    told = "; ".join(say.effect(name) for name in effects or test.separates)
    if effects:
        tells = say.text("The diagnosis could not tell these apart: {effects}.", effects=told)
    else:
        tells = say.text("It tells these from other causes: {effects}.", effects=told)
    when = say.text("When: {when}; {weather}.", when=say.text(WHEN[test.when]), weather=weather)
    return Asked(test.name, say.title(test.name), _course(test, say), when, tells, stands, approvable)


def _course(test: SeparatingTest, say: Words) -> str:
    """Return what a test moves: every point with its values in turn, and for how long."""
    stages, lasts = test.course, say.lasting(60.0 * test.minutes)
    each = say.lasting(60.0 * stages[0].minutes)
    found = []
    for point in test.points:
        values = say.language.listed(
            [say.shown(point, value) for value in dict.fromkeys(s.values[point] for s in stages)]
        )
        title = say.title(point)
        if len(stages) == 1:
            found.append(say.text("{point} at {value} for {time}.", point=title, value=values, time=lasts))
        else:
            text = N_("{point} at {values} in turn, {each} each, {time} in all.")
            found.append(say.text(text, point=title, values=values, each=each, time=lasts))
    return " ".join(found)


def _range(condition: Condition, say: Words) -> str:
    """Return within what a quantity must be for a test to begin."""
    name, title = condition.quantity, say.spoken(condition.quantity)
    low, high = (
        "" if abs(bound) == float("inf") else say.shown(name, bound)
        for bound in (condition.low + condition.margin, condition.high - condition.margin)
    )
    if low and high:
        return say.text("{quantity} between {low} and {high}", quantity=title, low=low, high=high)
    if low:
        return say.text("{quantity} at least {low}", quantity=title, low=low)
    return say.text("{quantity} at most {high}", quantity=title, high=high)


def _stands(approval: Approval, state: Mapping[str, Any], say: Words, now: float) -> str:
    """Return how the approved test stands, by its file and by what the daemon says of the same test."""
    heard = state.get("separating_test") or {}
    same = heard.get("test") == approval.test and not heard.get("ended")
    if approval.begun is not None:
        how = say.text("It runs.")
    elif same and heard.get("waits_for"):
        how = say.text("It waits: {why}.", why=say.told(str(heard["waits_for"]), now))
    else:
        how = say.text("It waits for its weather, for {time} at most.", time=say.lasting(approval.seconds))
    return say.text("Approved by {who}.", who=approval.by) + " " + how
