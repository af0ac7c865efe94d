"""The benchmark's cases: what is hidden in which greenhouse, drawn from seeds, never by hand.

Sizes are in ENR: RMS of the effect in 24 h free runs over the RMS that stays when nothing is missing, root mean square
over temperature, humidity and CO2; measured once per greenhouse on the reference log with the calibrated model. A cause
that its bounds keep from reaching the size there (a closed valve in a winter of full heat) is not drawn.
Tuning and scoring draw from disjoint seeds, and bend the truth with disjoint forms.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.core.greenhouse import HiddenEffect
from igrow.core.greenhouse.uncatalogued import UNCATALOGUED

SEASONS = {"winter": "2020-01-20", "spring": "2020-04-01", "autumn": "2020-10-05"}
"""First day of the log; the reference log of the calibration ends there."""
FORMS = {
    "tuning": ((1.0, 0.0, 0.0), (1.2, 0.0, 0.0), (1.0, 0.1, 0.0), (1.0, 0.0, 600.0), (0.85, 0.0, 300.0)),
    "scoring": (
        (1.0, 0.0, 0.0),
        (1.3, 0.0, 0.0),
        (0.75, 0.0, 0.0),
        (1.0, 0.15, 0.0),
        (1.0, 0.0, 900.0),
        (1.15, 0.05, 450.0),
    ),
}
"""(exponent, threshold, delay in seconds) of the true effect against the catalogue's."""
CHANGES: Mapping[str, tuple[float, tuple[str, ...]]] = {
    "cover_transmission": (0.7, ("transmissivity",)),
    "rail_exchange": (0.7, ("rail_pipe_heat_transfer",)),
    "vent_area": (0.6, ("ventilation", "vent_wind", "vent_stack")),
    "leakage": (3.0, ("leakage", "leakage_still", "leakage_wind", "wind_infiltration")),
}
"""A parameter of the plant, what it is over before, and what is right to say of it."""
REACHABLE = 1.5
"""ENR that a cause must be able to reach in a greenhouse to be drawn for it."""


@dataclass(frozen=True)
class Case:
    """One log and what is hidden in it."""

    name: str
    group: str
    """nothing, noise, clean, single, onset, pair, outside or parameter."""
    greenhouse: str
    """Key of `greenhouses`."""
    seed: int
    causes: tuple[str, ...] = ()
    size: float = 0.0
    """ENR."""
    forms: tuple[tuple[float, float, float], ...] = ()
    onset_day: float | None = None
    heavy_tails: bool = False
    wrong_noise: bool = False
    """Disturbances twice as large, with six times the correlation time, than the calibration saw."""
    changed: str = ""
    """Parameter of the plant that is another since the calibration, of `CHANGES`."""


def draw(
    kind: str,
    first: int,
    count: int,
    units: Mapping[str, Mapping[str, float]],
    groups: Sequence[tuple[str, float, float]],
) -> list[Case]:
    """Draw cases.

    Args:
        kind: ``tuning`` or ``scoring``, of `FORMS`.
        first: seed; each case's is a thousand and more on.
        count: about how many.
        units: amplitude of ENR 1 of every cause, by greenhouse, which take turns.
        groups: name, ENR, and share of the cases.
    """
    rng = np.random.default_rng(first)
    turn, beyond = Turn(rng, list(EFFECTS)), Turn(rng, list(UNCATALOGUED))
    greenhouses = itertools.cycle(units)
    changes = list(CHANGES)
    cases: list[Case] = []
    for group, size, share in groups:
        for place in range(max(1, round(share * count))):
            greenhouse, number = next(greenhouses), len(cases)
            causes: tuple[str, ...] = ()
            if size:
                causes = ((beyond if group == "outside" else turn).next(units[greenhouse], ()),)
            if group == "pair":
                causes = (*causes, turn.next(units[greenhouse], causes))
            cases.append(
                Case(
                    name=f"{kind}-{group}-{number:03d}",
                    group=group,
                    greenhouse=greenhouse,
                    seed=first + 1000 + number,
                    causes=causes,
                    size=size,
                    forms=tuple(FORMS[kind][int(rng.integers(len(FORMS[kind])))] for _ in causes),
                    onset_day=float(rng.uniform(7.0, 20.0)) if group == "onset" else None,
                    heavy_tails=bool(rng.random() < 0.5),
                    wrong_noise=group == "noise",
                    # In every greenhouse another each time round.
                    changed=changes[(place + place // len(units)) % len(changes)] if group == "parameter" else "",
                )
            )
    return cases


def hidden(case: Case, unit: dict[str, float], start: np.datetime64) -> list[HiddenEffect]:
    """Return the plant's hidden effects of a case.

    Args:
        case: the case.
        unit: amplitude of ENR 1 for every cause in the case's greenhouse.
        start: of the log.
    """
    onset = None if case.onset_day is None else start + np.timedelta64(round(case.onset_day * 24), "h")
    effects = []
    for cause, (exponent, threshold, delay) in zip(case.causes, case.forms, strict=True):
        definition = EFFECTS.get(cause) or UNCATALOGUED[cause]
        straight = definition.kind == "sensor"
        amplitude = float(np.clip(case.size * unit[cause], definition.amplitude.low, definition.amplitude.high))
        effects.append(
            HiddenEffect(
                cause,
                amplitude,
                onset,
                exponent=1.0 if straight else exponent,
                threshold=None if straight or threshold == 0.0 else threshold,
                delay_seconds=0.0 if straight else delay,
            )
        )
    return effects


class Turn:
    """Causes in a random order, each as often as the others, as far as they can be seen."""

    def __init__(self, rng: np.random.Generator, names: list[str]) -> None:
        self._order = list(names)
        rng.shuffle(self._order)

    def next(self, unit: Mapping[str, float], but: tuple[str, ...]) -> str:
        """Take the next cause that can be seen in the greenhouse, and put it at the end of the line."""
        for position, name in enumerate(self._order):
            definition = EFFECTS.get(name) or UNCATALOGUED[name]
            if name not in but and REACHABLE * unit[name] <= abs(definition.amplitude.high):
                self._order.append(self._order.pop(position))
                return name
        raise AssertionError("a greenhouse in which no cause can be seen")
