"""Runs of climate and actuation stage together."""

from __future__ import annotations

import numpy as np

from igrow.core.arrays import Floats
from igrow.core.simulator import actuation
from igrow.core.simulator.closed_loop import closed_run
from igrow.core.simulator.hybrid import record as records
from igrow.core.simulator.hybrid.nominal import site_record
from tests.virtual_log import GREENHOUSE, SITE, setpoints, virtual_log

STEPS = 30
EFFECTS = {"wind_infiltration": {"air_changes": 0.05, "exponent": 1.0}, "vent_backlash": {"share": 0.7, "play": 5.0}}


def test_a_run_alone_is_what_it_is_among_others() -> None:
    record = site_record(virtual_log(2, seed=8), SITE, 300.0)
    states, asked = records.observe(record, GREENHOUSE, EFFECTS), setpoints(2, 300.0)
    added = {"heat": np.linspace(-5.0, 5.0, len(record))}

    def run(starts: list[int]) -> dict[str, Floats]:
        rules = actuation.default_rules()
        return closed_run(record, states, asked, starts, STEPS, GREENHOUSE, EFFECTS, rules, added)

    together, alone = run([100, 300]), run([300])
    assert set(alone) == set(together)
    for name, values in alone.items():
        assert values.shape == (STEPS, 1)
        np.testing.assert_allclose(values[:, 0], together[name][:, 1], rtol=1e-12, atol=1e-12)
    assert np.ptp(alone["air_temperature"]) > 0.1
