"""A discrepancy as a file: read back as it was written, and refused where it is damaged."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from igrow.core.bundle import Span
from igrow.core.errors import IgrowError
from igrow.trainer.exporting import export, read_model
from igrow.trainer.fit import FittedModel
from igrow.trainer.fit.discrepancy import Discrepancy
from igrow.trainer.fit.gaussian import Gaussian
from tests.virtual_log import SITE

MIDDLE = np.datetime64("2020-01-15T12:00:00", "s")


def known() -> Discrepancy:
    covariance = np.array([[4.0, 1.0], [1.0, 9.0]])
    amplitudes = Gaussian(("parameter:leakage_wind", "heat:cold weather"), np.array([0.5, -2.0]), covariance)
    return Discrepancy(
        {"leakage_wind": 0.06}, amplitudes, {0: (2.0, 4.5), 2: (1.0, 3.0)}, 900.0, {"lamp_heat": 7.5}, MIDDLE,
        12.5, 2.25, ("heating_valve_leak:threshold=3",),
    )  # fmt: skip


def test_what_is_written_is_read_back() -> None:
    read = Discrepancy.from_bytes(known().to_bytes(), where="discrepancy.npz")
    assert (read.parameters, read.filters, read.step, read.own_gains, read.middle, read.opening, read.unseen) == (
        known().parameters, known().filters, known().step, known().own_gains, MIDDLE, 12.5, known().unseen,
    )  # fmt: skip
    assert read.amplitudes.names == known().amplitudes.names
    np.testing.assert_array_equal(read.amplitudes.mean, known().amplitudes.mean)
    np.testing.assert_allclose(read.amplitudes.covariance, known().amplitudes.covariance, rtol=1e-6)


def test_a_damaged_file_is_named_in_one_line() -> None:
    with pytest.raises(IgrowError, match=r"bundle/discrepancy\.npz: holds no discrepancy") as raised:
        Discrepancy.from_bytes(known().to_bytes()[:-200], where="bundle/discrepancy.npz")
    assert "\n" not in str(raised.value)


def test_keys_and_covariance_must_be_of_one_size() -> None:
    wrong = Gaussian(("a",), np.zeros(2), np.eye(2))
    content = Discrepancy({}, wrong, {}, 900.0, {}, MIDDLE).to_bytes()
    with pytest.raises(IgrowError, match="1 keys, but"):
        Discrepancy.from_bytes(content, where="x")


def test_the_history_of_another_greenhouse_does_not_become_this_ones() -> None:
    span = Span(datetime(2020, 1, 1, tzinfo=UTC), datetime(2020, 1, 29, tzinfo=UTC))
    for home, kept in ((SITE.name, True), ("elsewhere", False)):
        model = replace(FittedModel.described(SITE), calibrated_on=home, history=known())
        corrected = model.corrected(model.posterior, (), span=span, errors=())
        assert (corrected.history is not None) is kept


def test_a_bundle_carries_it_as_a_file_that_its_manifest_lists(tmp_path: Path) -> None:
    model = replace(FittedModel.described(SITE), calibrated_on=SITE.name, history=known())
    bundle = export(model, tmp_path / "bundle")
    assert "discrepancy.npz" in bundle.manifest.files
    read = read_model(bundle, SITE).history
    assert read is not None and read.own_gains == known().own_gains
    assert read_model(export(replace(model, history=None), tmp_path / "plain"), SITE).history is None


def test_what_was_fitted_to_other_balances_is_a_calibration_of_no_greenhouse(tmp_path: Path) -> None:
    model = replace(FittedModel.described(SITE), calibrated_on=SITE.name, history=known())
    bundle = export(model, tmp_path / "bundle")
    fitted = bundle.manifest.parameters
    other = replace(bundle, manifest=replace(bundle.manifest, parameters={**fitted, "blocked": fitted["leakage_wind"]}))
    fewer = {name: one for name, one in fitted.items() if name != "soil_heat_transfer"}
    before = replace(bundle, manifest=replace(bundle.manifest, parameters=fewer, covariance=None))
    assert read_model(bundle, SITE).calibrated_on == SITE.name
    for earlier in (other, before):
        read = read_model(earlier, SITE)
        assert (read.calibrated_on, read.history) == ("", None)
