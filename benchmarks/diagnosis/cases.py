"""The benchmark's cases: what is hidden in which greenhouse, drawn from seeds, never by hand.

Sizes are in ENR: RMS of the effect in 24 h free runs over the RMS that stays when nothing is missing, root mean square
over temperature, humidity and CO2; measured once per greenhouse on the reference log with the calibrated model. A cause
that its bounds keep from reaching the size there (a closed valve in a winter of full heat) is not drawn.
Tuning and scoring draw from disjoint seeds, and bend the truth with disjoint forms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.core.greenhouse import HiddenEffect
from igrow.core.greenhouse.uncatalogued import UNCATALOGUED

SEASONS = {"winter": "2020-01-20", "spring": "2020-04-01", "autumn": "2020-10-05"}
"""First day of the log; the reference log of the calibration ends there."""
SIZES = (0.3, 1.0, 3.0)
SHARES = {
    "nothing": 0.25,
    "single": 0.27,
    "sensor": 0.11,
    "pair": 0.08,
    "onset": 0.1,
    "outside": 0.11,
    "withheld": 0.08,
}
"""Of all cases."""
SEEDS = {"tuning": 1000, "scoring": 26000}
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
    """nothing, single, sensor, pair, onset, outside, withheld or parameter."""
    greenhouse: str
    """Key of `greenhouses`."""
    seed: int
    causes: tuple[str, ...] = ()
    size: float = 0.0
    """ENR."""
    forms: tuple[tuple[float, float, float], ...] = ()
    onset_day: float | None = None
    without: tuple[str, ...] = ()
    """Taken out of the catalogue for this case."""
    heavy_tails: bool = False
    wrong_noise: bool = False
    """Disturbances twice as large, with six times the correlation time, than the calibration saw."""
    changed: str = ""
    """Parameter of the plant that is another since the calibration, of `CHANGES`."""


def draw(kind: str, count: int, units: Mapping[str, Mapping[str, float]], seed: int | None = None) -> list[Case]:
    """Draw a balanced list of cases: a quarter with nothing missing.

    Args:
        kind: ``tuning`` or ``scoring``.
        count: about how many.
        units: amplitude of ENR 1 of every cause, by greenhouse; its greenhouses are used.
        seed: of the first case (None: the kind's).
    """
    first = SEEDS[kind] if seed is None else seed
    rng = np.random.default_rng(first)
    process = [name for name, effect in EFFECTS.items() if effect.kind == "process"]
    sensor = [name for name, effect in EFFECTS.items() if effect.kind == "sensor"]
    turns = {
        "single": Turn(rng, process),
        "sensor": Turn(rng, sensor),
        "withheld": Turn(rng, process),
        "outside": Turn(rng, list(UNCATALOGUED)),
        "pair": Turn(rng, process),
        "onset": Turn(rng, [*process, *sensor]),
    }
    greenhouses = list(units)
    cases: list[Case] = []
    for group, share in SHARES.items():
        for index in range(max(1, round(share * count))):
            greenhouse = greenhouses[index % len(greenhouses)]
            causes: tuple[str, ...] = ()
            if group != "nothing":
                causes = (turns[group].next(units[greenhouse], ()),)
            if group == "pair":
                causes = (*causes, turns["single" if index % 2 else "sensor"].next(units[greenhouse], causes))
            cases.append(
                Case(
                    name=f"{kind}-{group}-{index:03d}",
                    group=group,
                    greenhouse=greenhouse,
                    seed=first + len(cases),
                    causes=causes,
                    size=_size(group, index // len(greenhouses)),
                    forms=tuple(FORMS[kind][int(rng.integers(len(FORMS[kind])))] for _ in causes),
                    onset_day=float(rng.uniform(7.0, 20.0)) if group == "onset" else None,
                    without=causes if group == "withheld" else (),
                    heavy_tails=bool(rng.random() < 0.5),
                    wrong_noise=group == "nothing" and index % 4 == 3,
                )
            )
    return cases


def _size(group: str, turn: int) -> float:
    if group == "nothing":
        return 0.0
    if group in {"single", "sensor"}:
        return SIZES[turn % 3]
    return (1.0, 3.0)[turn % 2] if group in {"outside", "withheld"} else 1.5


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
