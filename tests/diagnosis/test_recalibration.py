"""Parameters and noise fitted by turns give back the parameters and the noise of the log."""

from __future__ import annotations

import numpy as np
import pytest

from igrow.core.arrays import Floats
from igrow.trainer.data import prepare_log
from igrow.trainer.data.splits import split_days
from igrow.trainer.diagnosis import sensitivity
from igrow.trainer.diagnosis.recalibration import averaging, recalibrate
from igrow.trainer.diagnosis.rules import DEFAULT
from igrow.trainer.fit import Gaussian
from tests.diagnosis.conftest import disturbances
from tests.virtual_log import GREENHOUSE, SITE, virtual_log

DAYS = 16


def test_a_parameter_that_moved_is_found_beside_coloured_disturbances() -> None:
    known = GREENHOUSE
    truth = known | {"transmissivity": 0.85 * known["transmissivity"]}
    added = disturbances(DAYS, 900.0, 9)
    record = prepare_log(virtual_log(DAYS, seed=9, step=900.0, parameters=truth, added=added), SITE).record(0.0)
    split = split_days(record, SITE.longitude)
    prior = Gaussian.independent(known, {name: 0.1 * abs(value) + 1e-9 for name, value in known.items()})
    start = sensitivity.linearise(record, sensitivity.day_runs(record, split.day), known, {})
    average = averaging(start, 3600.0, DEFAULT)
    line, whitening = recalibrate(start, split, prior, np.zeros((3, *average.observed.shape)), average, DEFAULT)
    assert line.parameters["transmissivity"] == pytest.approx(truth["transmissivity"], rel=0.03)
    fitted = split.fit[line.runs.day][:, None]
    white = whitening(average(line.errors[None]))[0] * fitted
    counted = white[:, np.flatnonzero(fitted[:, 0])]
    lagged = np.sum(counted[..., 1:] * counted[..., :-1]) / np.sum(counted**2)
    assert abs(lagged) < 0.15
    assert np.mean(counted**2) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize(("beside_noise", "share"), [(True, 0.15), (False, 0.3)])
def test_what_is_expected_to_be_missing_moves_no_parameter(*, beside_noise: bool, share: float) -> None:
    """Beyond what sensor noise moves them by, which is there without it too."""
    known = GREENHOUSE
    hours = np.arange(DAYS * 96) % 96
    flux = np.where(hours < 24, 15.0, 0.0)
    prior = Gaussian.independent(known, {name: 0.1 * abs(value) + 1e-9 for name, value in known.items()})

    def recalibrated(added: Floats, *, expects: bool) -> Floats:
        record = prepare_log(virtual_log(DAYS, seed=10, step=900.0, added={"heat": added}), SITE).record(0.0)
        split = split_days(record, SITE.longitude)
        start = sensitivity.linearise(record, sensitivity.day_runs(record, split.day), known, {})
        average = averaging(start, 3600.0, DEFAULT)
        expected = average(sensitivity.flux_sensitivities(start, [({"heat": flux}, 1.0)]))[0]
        line, _ = recalibrate(start, split, prior, expected if expects else 0.0 * expected, average, DEFAULT)
        return np.array([line.parameters[name] for name in prior.names]) / prior.standard_deviation

    start = prior.mean / prior.standard_deviation
    without = recalibrated(0.0 * flux, expects=False) if beside_noise else start
    moved = [float(np.abs(recalibrated(flux, expects=one) - without).max()) for one in (True, False)]
    assert moved[0] < share * moved[1]
