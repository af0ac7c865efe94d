"""Free runs: steps that are laid out together are those of a run step by step, and each variant is as if alone."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.effects.definition import Values
from igrow.core.simulator.hybrid import climate, measurement, record
from igrow.core.simulator.hybrid.nominal import site_record
from igrow.core.simulator.hybrid.record import Record, free_run, observe
from tests.virtual_log import GREENHOUSE, SITE, virtual_log

STARTS, STEPS = np.array([0, 24, 60]), 30
OFF = {"pipe_temperature_offset": {"offset": 3.0}}


@pytest.fixture(scope="module")
def log() -> Record:
    return site_record(virtual_log(2, seed=4, step=1800.0), SITE, 1800.0)


def by_steps(log: Record, start: int, parameters: Values, effects: climate.ActiveEffects) -> np.ndarray:
    """Temperature, humidity and CO2 at each of `STEPS` rows after a start, (steps, 3), every driver derived anew."""
    state = {name: values[..., start] for name, values in observe(log, parameters, effects).items()}
    shown = []
    for row in range(start, start + STEPS + 1):
        inputs = {name: values[row] for name, values in log.inputs.items()}
        drivers = climate.derive(np, state, inputs, parameters, log.lamp_efficacy)
        shown.append(list(measurement.measured(np, drivers, state, effects).values()))
        for _ in range(2):
            drivers = climate.derive(np, state, inputs, parameters, log.lamp_efficacy)
            true = measurement.correct_inputs(np, inputs, drivers, state, effects)
            state = climate.advance(
                np, state, true, parameters, effects, seconds=900.0, lamp_efficacy=log.lamp_efficacy
            )
    return np.array(shown[1:])


@pytest.mark.parametrize("at_once", [1, 20, 16_384])
@pytest.mark.parametrize("effects", [{}, OFF])
def test_steps_laid_out_together_are_those_of_a_run_step_by_step(
    log: Record, effects: climate.ActiveEffects, at_once: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(record, "_AT_ONCE", at_once)
    shown = free_run(log, observe(log, GREENHOUSE, effects), STARTS, STEPS, GREENHOUSE, effects)
    for column, start in enumerate(STARTS):
        run = np.stack([shown[name][:, column] for name in measurement.PREDICTED], axis=1)
        np.testing.assert_allclose(run, by_steps(log, int(start), GREENHOUSE, effects), rtol=1e-12)


@pytest.mark.parametrize("at_once", [1, 20, 16_384])
def test_each_variant_runs_as_if_alone(log: Record, at_once: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record, "_AT_ONCE", at_once)
    shares = np.array([[1.0], [0.7], [1.2]])
    several = {**GREENHOUSE, **{name: shares * GREENHOUSE[name] for name in ("transmissivity", "leakage_wind")}}
    together = free_run(log, observe(log, several, OFF), STARTS, STEPS, several, OFF)
    for number, share in enumerate(shares[:, 0]):
        one = {**GREENHOUSE, **{name: share * GREENHOUSE[name] for name in ("transmissivity", "leakage_wind")}}
        alone = free_run(log, observe(log, one, OFF), STARTS, STEPS, one, OFF)
        for name, values in alone.items():
            np.testing.assert_allclose(together[name][:, number], values, rtol=1e-12)
    assert np.abs(together["air_temperature"][:, 0] - together["air_temperature"][:, 1]).max() > 0.1
