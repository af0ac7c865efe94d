from __future__ import annotations

import numpy as np

from igrow.core.effects import EFFECTS
from igrow.core.telemetry import Telemetry
from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import problem, refine, search, structure
from igrow.trainer.diagnosis.activation import ActiveTerm
from igrow.trainer.diagnosis.gram import Term
from igrow.trainer.diagnosis.refine import Refined
from tests.diagnosis.conftest import DAYS, STEP, deployed_model, greenhouse_log
from tests.virtual_log import SITE


def test_a_term_at_its_bound_comes_back_from_there(quiet_log: Telemetry) -> None:
    deployed = deployed_model()
    record = prepare_log(quiet_log, SITE).record()
    split = split_days(record, SITE.longitude)
    ready = problem.prepare(record, split, deployed.prior, {}, SITE.longitude, {})
    column = next(
        column
        for column, candidate in zip(ready.candidate, ready.candidates, strict=True)
        if candidate.effect == "wind_infiltration"
    )
    fit = search.fit(ready.grams, structure.null_model(ready).with_term(Term(column)))
    bound = EFFECTS["wind_infiltration"].amplitude.high
    shape = {one.name: one.typical for one in EFFECTS["wind_infiltration"].shapes}
    (found,) = refine.refine(ready, fit, [ActiveTerm("wind_infiltration", bound, shape)], ())
    assert found.term.amplitude < 0.5 * bound
    assert 0.0 < found.deviation < bound


def test_two_ways_for_co2_to_leak_in_have_no_sizes_of_their_own() -> None:
    count = round(DAYS * 86_400 / STEP)
    log = greenhouse_log(4, {"co2": np.full(count, 1.0 / 3.6e6)})
    log = log.with_columns({"air_temperature": log["air_temperature"] + 2.0})
    deployed = deployed_model()
    record = prepare_log(log, SITE).record()
    split = split_days(record, SITE.longitude)
    ready = problem.prepare(record, split, deployed.prior, {}, SITE.longitude, {})

    def together(*sizes: tuple[str, float]) -> list[Refined]:
        columns = {one.effect: column for column, one in zip(ready.candidate, ready.candidates, strict=True)}
        model = structure.null_model(ready)
        for name, _ in sizes:
            model = model.with_term(Term(columns[name]))
        shapes = {name: {one.name: one.typical for one in EFFECTS[name].shapes} for name, _ in sizes}
        terms = [ActiveTerm(name, size, shapes[name]) for name, size in sizes]
        return refine.refine(ready, search.fit(ready.grams, model), terms, ())

    assert refine.told_apart(together(("co2_valve_leak", 1.0), ("air_temperature_offset", 2.0)))
    assert not refine.told_apart(together(("co2_valve_leak", 0.5), ("soil_respiration", 0.5)))
