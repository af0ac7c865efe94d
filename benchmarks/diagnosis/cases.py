"""The benchmark's cases: what is hidden in which greenhouse, drawn from seeds, never by hand.

Sizes are in ENR: RMS of the effect in 24 h free runs over the RMS that stays when nothing is missing, the larger of
the quantities; measured once per season on the reference log with the calibrated model. Tuning and scoring draw from
disjoint seeds, and bend the truth with disjoint forms.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from igrow_core.effects import EFFECTS
from igrow_core.greenhouse import HiddenEffect
from igrow_core.greenhouse.uncatalogued import UNCATALOGUED

SEASONS = {"winter": "2020-01-20", "spring": "2020-04-01", "autumn": "2020-10-05"}
"""First day of the log; the reference log of the calibration ends there."""
SIZES = (0.3, 1.0, 3.0)
SEEDS = {"tuning": 1000, "scoring": 5000}
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
UNUSED = {
    "photosynthesis_heat_limit": ("winter",),
    "leaf_area_transpiration": (),
    "deficit_stomata_closure": ("winter",),
}
"""Effects that cannot show in a season: no hour is hot enough."""


@dataclass(frozen=True)
class Case:
    """One log and what is hidden in it."""

    name: str
    group: str
    """nothing, single, sensor, pair, onset, outside or withheld."""
    season: str
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
    shapes: tuple[dict[str, float], ...] = field(default=())


def draw(kind: str, count: int) -> list[Case]:
    """Draw a balanced list of cases: a quarter with nothing missing.

    Args:
        kind: ``tuning`` or ``scoring``.
        count: about how many.
    """
    rng = np.random.default_rng(SEEDS[kind])
    shares = {
        "nothing": 0.25,
        "single": 0.27,
        "sensor": 0.11,
        "pair": 0.08,
        "onset": 0.1,
        "outside": 0.11,
        "withheld": 0.08,
    }
    process = [name for name, effect in EFFECTS.items() if effect.kind == "process"]
    sensor = [name for name, effect in EFFECTS.items() if effect.kind == "sensor"]
    seasons = list(SEASONS)
    cases: list[Case] = []
    turns = {"single": _turns(rng, process), "sensor": _turns(rng, sensor), "withheld": _turns(rng, process),
             "outside": _turns(rng, list(UNCATALOGUED)), "pair": _turns(rng, process), "onset": _turns(rng, [*process, *sensor])}  # fmt: skip
    for group, share in shares.items():
        for index in range(max(1, round(share * count))):
            season = seasons[index % len(seasons)]
            causes: tuple[str, ...] = ()
            if group != "nothing":
                causes = (_next(turns[group], season),)
            if group == "pair":
                second = _next(turns["single"] if index % 2 else turns["sensor"], season)
                while second == causes[0]:
                    second = _next(turns["single"], season)
                causes = (*causes, second)
            forms = FORMS[kind]
            cases.append(
                Case(
                    name=f"{kind}-{group}-{index:03d}",
                    group=group,
                    season=season,
                    seed=SEEDS[kind] + len(cases),
                    causes=causes,
                    size=0.0
                    if group == "nothing"
                    else SIZES[index // len(seasons) % 3]
                    if group in {"single", "sensor"}
                    else (1.0, 3.0)[index % 2]
                    if group in {"outside", "withheld"}
                    else 1.5,
                    forms=tuple(forms[int(rng.integers(len(forms)))] for _ in causes),
                    onset_day=float(rng.uniform(7.0, 20.0)) if group == "onset" else None,
                    without=causes if group == "withheld" else (),
                    heavy_tails=bool(rng.random() < 0.5),
                    wrong_noise=group == "nothing" and index % 4 == 3,
                )
            )
    return cases


def hidden(case: Case, unit: dict[str, float], start: np.datetime64) -> list[HiddenEffect]:
    """Return the plant's hidden effects of a case.

    Args:
        case: the case.
        unit: amplitude of ENR 1 for every cause in the case's season.
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


def _turns(rng: np.random.Generator, names: list[str]) -> list[str]:
    order = list(names)
    rng.shuffle(order)
    return order


def _next(turn: list[str], season: str) -> str:
    for _ in range(len(turn)):
        name = turn.pop(0)
        turn.append(name)
        if season not in UNUSED.get(name, ()):
            return name
    raise AssertionError("a season without any possible effect")
