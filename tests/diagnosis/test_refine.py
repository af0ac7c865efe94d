from __future__ import annotations

from igrow_core.effects import EFFECTS
from igrow_core.telemetry import Telemetry
from tests.diagnosis.conftest import deployed_model
from tests.virtual_log import SITE
from trainer.diagnosis import problem, refine, runner, search, structure
from trainer.diagnosis.activation import ActiveTerm
from trainer.diagnosis.gram import Term
from trainer.diagnosis.refine import Refined
from trainer.diagnosis.split import split_days


def test_a_term_at_its_bound_comes_back_from_there(quiet_log: Telemetry) -> None:
    deployed = deployed_model()
    record, _ = runner.open_record(quiet_log, SITE, deployed)
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
    leak, soil = (ActiveTerm(name, 1.0, {}) for name in ("co2_valve_leak", "soil_respiration"))
    assert refine.told_apart([Refined(leak, 0.1, {}, {}), Refined(soil, 0.2, {}, {})])
    assert not refine.told_apart([Refined(leak, 11.0, {}, {}), Refined(soil, 0.2, {}, {})])
