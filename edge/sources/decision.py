"""How a decision is made: for each setpoint, the first source in the order that offers one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from igrow.edge.image import Image


@dataclass(frozen=True, slots=True)
class Offer:
    """What one source offers now: setpoints by name, or none and the reason."""

    why: str
    setpoints: Mapping[str, float] = field(default_factory=dict)
    lent: Mapping[str, float] = field(default_factory=dict)
    """Points that are the PLC's own otherwise, such as a vent; it gets them back when nobody offers them any more."""


class Source(Protocol):
    """Somebody who may decide."""

    @property
    def name(self) -> str:
        """The word in the ledger: override, separating_test, plan, last_plan, recipe or hands_off."""

    def offer(self, image: Image) -> Offer:
        """Return what this source would do in this cycle; never raises for what a grower or a sensor does."""


@dataclass(frozen=True, slots=True)
class Choice:
    """One setpoint's value, and who chose it and why."""

    value: float
    source: str
    why: str


@dataclass(frozen=True, slots=True)
class Decision:
    """All setpoints of one cycle, and what the PLC lends."""

    choices: Mapping[str, Choice]
    source: str
    """The source of most setpoints."""
    why: str
    """One line for people: why this source, and why not those before it."""


def decide(sources: Sequence[Source], image: Image, setpoints: Sequence[str]) -> Decision:
    """Return the decision of this cycle. `sources` stand in order of precedence."""
    choices: dict[str, Choice] = {}
    lent: dict[str, Choice] = {}
    passed_over: list[str] = []
    main_why = ""
    for source in sources:
        if len(choices) == len(setpoints):
            break
        offer = source.offer(image)
        taken = {
            name: Choice(offer.setpoints[name], source.name, offer.why)
            for name in setpoints
            if name in offer.setpoints and name not in choices
        }
        also = {name: Choice(value, source.name, offer.why) for name, value in offer.lent.items() if name not in lent}
        lent.update(also)
        if taken or also:
            choices.update(taken)
        elif offer.why:
            passed_over.append(offer.why)
    counts = Counter(choice.source for choice in choices.values())
    main = counts.most_common(1)[0][0] if counts else "none"
    main_why = next((choice.why for choice in choices.values() if choice.source == main), "no source offers anything")
    if passed_over:
        main_why = f"{main_why} ({'; '.join(passed_over)})"
    return Decision({**choices, **lent}, main, main_why)
