"""What a new greenhouse gains when others of its builder share their discrepancy.

`python -m benchmarks.shared_discrepancy [--shared N] [--new N]` draws a builder as `benchmarks.population` does. Each
greenhouse is calibrated on four weeks; then its crop has grown on and each parameter has drifted a little. N of them
share what `igrow-trainer fleet learn` keeps of a site. The new ones are diagnosed on the four weeks that follow, once
with nothing missing and once with something hidden: by what came with the trainer, and by what was shared.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.builder import QUANTITIES, SHARED_DAYS, START, asked_for, site_of
from benchmarks.diagnosis.nurseries import DRIFT
from igrow.core.greenhouse import GreenhouseParameters, HiddenEffect, generate_weather, recipe, simulate_many
from igrow.core.greenhouse.tomato import Crop
from igrow.trainer.calibration import calibrate
from igrow.trainer.data import Log, prepare_log
from igrow.trainer.diagnosis import Diagnosis, diagnose, learned_from
from igrow.trainer.fit import FittedModel
from igrow.trainer.fit.population import Population, learn_population

LATER_DAYS = 28
CAUSES = ("wind_infiltration", "night_transpiration", "co2_valve_leak", "structure_shade")


@dataclass(frozen=True)
class Told:
    """What one diagnosis said."""

    verdict: str
    causes: tuple[str, ...]
    errors: dict[str, float]
    """Of the calibrated model a day ahead, by quantity."""


def both(plants: Sequence[GreenhouseParameters], hidden: Sequence[str | None], seed: int) -> list[tuple[Log, Log]]:
    """Return the calibration log and a later one of each greenhouse, which has drifted, with what is hidden in it."""
    middle = START + np.timedelta64(SHARED_DAYS, "D")
    end, count = middle + np.timedelta64(LATER_DAYS, "D"), len(plants)
    weather = generate_weather(START, end, seed=seed)
    first = simulate_many(plants, weather, recipe, START, middle, count=count, seed=seed)
    rng = np.random.default_rng(seed)
    later = simulate_many(
        [one.varied(rng, DRIFT) for one in plants], weather, recipe, middle, end, count=count, seed=seed + 1,
        effects=[[] if name is None else [HiddenEffect(name)] for name in hidden],
        crop=Crop(*(np.concatenate(parts, axis=-1) for parts in zip(*(one.crop for one in first), strict=True))),
    )  # fmt: skip
    sites = [site_of(plant) for plant in plants]
    return [
        (prepare_log(one.measured, site), prepare_log(two.measured, site))
        for one, two, site in zip(first, later, sites, strict=True)
    ]


def told(result: Diagnosis) -> Told:
    """Return what counts of a diagnosis."""
    errors = {name: horizons["24_h"]["deployed"] for name, horizons in result.errors.items()}
    return Told(result.verdict, tuple(one.effect for one in result.findings), errors)


def share(logs: Iterable[tuple[Log, Log]]) -> Population:
    """Return what greenhouses share: where they lie, and what models of them miss."""
    learned = []
    for number, (first, _) in enumerate(logs, 1):
        learned.append(learned_from(calibrate(first)))
        print(f"{number} shared", file=sys.stderr, flush=True)
    return learn_population(learned)


def main() -> None:
    plants = asked_for(__doc__, shared=6, new=4, seed=45_000)
    new = plants.new
    population = share(both(plants.shared, [None] * len(plants.shared), plants.seed + 1))
    causes = [CAUSES[number % len(CAUSES)] for number in range(len(new))]
    logs = both([*new, *new], [*(None for _ in new), *causes], plants.seed + 3)
    found: dict[str, list[tuple[str, Told]]] = {"alone": [], "shared": []}
    for number in range(len(new)):
        models: dict[str, FittedModel] = {
            "alone": calibrate(logs[number][0]), "shared": calibrate(logs[number][0], population=population)
        }  # fmt: skip
        for name, model in models.items():
            for cause, place in (("", number), (causes[number], number + len(new))):
                found[name].append((cause, told(diagnose(logs[place][1], model))))
        print(f"{number + 1} of {len(new)} new", file=sys.stderr, flush=True)
    print(f"{len(plants.shared)} shared; {len(new)} new greenhouses; keys of the population {len(population.mean)}")
    print(f"{'mean over later logs':52}{'logs':>6}{'alone':>10}{'shared':>10}")
    rows: list[tuple[str, Callable[[str, Told], float | None]]] = [
        ("false claims where nothing is missing", lambda c, t: None if c else float(t.verdict != "nothing")),
        ("right cause first", lambda c, t: float(t.causes[:1] == (c,)) if c else None),
        ("another cause first", lambda c, t: float(bool(t.causes) and t.causes[0] != c) if c else None),
    ]
    cells: list[tuple[str, list[list[float]]]] = [
        (what, [[one for case in found[name] if (one := value(*case)) is not None] for name in found])
        for what, value in rows
    ]
    for quantity in QUANTITIES:
        errors = [[one.errors[quantity] for cause, one in found[name] if not cause] for name in found]
        cells.append((f"error a day ahead, {quantity}", errors))
    for what, values in cells:
        print(f"{what:52}{len(values[0]):6}" + "".join(f"{np.mean(one):10.3g}" for one in values))


if __name__ == "__main__":
    main()
