"""The one calibration: the same from command line, default bundle and benchmark; where it cannot, it says why."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from igrow.core.bundle import BUILT_IN, default_bundle_folder, read_bundle
from igrow.core.errors import IgrowError
from igrow.core.quantities import ACTUATORS
from igrow.core.simulator.hybrid.nominal import nominal
from igrow.core.telemetry import Telemetry, write_csv
from igrow.trainer import calibrate, calibration, export, prepare_log, read_model
from igrow.trainer.cli import main
from igrow.trainer.diagnosis import DEFAULT
from igrow.trainer.fit import FittedModel
from igrow.trainer.fit.model import training_envelope, united
from tests.made_once import made_once
from tests.virtual_log import SITE, disturbances, virtual_log

DAYS, STEP = 30, 900.0
PARAMETERS = ("latitude: 52.0", "longitude: 4.5", "name: virtual")


def shifted(telemetry: Telemetry, rows: int) -> Telemetry:
    """The log of a computer that writes an actuator's cell so many rows late."""
    late = {
        name: np.concatenate([np.repeat(telemetry[name][:1], rows), telemetry[name][: len(telemetry) - rows]])
        for name in ACTUATORS
        if name in telemetry
    }
    return telemetry.with_columns(late)


TRUTH = nominal(SITE) | {"transmissivity": 0.5, "leakage_wind": 0.1, "transpiration_moist_air": 48.0, "sky_share": 0.3}


@pytest.fixture(scope="module")
def telemetry() -> Telemetry:
    return virtual_log(DAYS, seed=5, step=STEP, parameters=TRUTH, added=disturbances(DAYS, STEP, 6))


@pytest.fixture(scope="module")
@made_once
def model(telemetry: Telemetry) -> FittedModel:
    return calibrate(prepare_log(telemetry, SITE))


@pytest.fixture(scope="module")
def short() -> Telemetry:
    return virtual_log(9, seed=7, step=STEP, parameters=TRUTH, added=disturbances(9, STEP, 8))


@pytest.fixture(scope="module")
@made_once
def clean(short: Telemetry) -> FittedModel:
    return calibrate(prepare_log(short, SITE))


def site_file(folder: Path) -> Path:
    path = folder / "site.yaml"
    path.write_text("\n".join(PARAMETERS) + "\n")
    return path


def assert_same_posterior(one: FittedModel, other: FittedModel) -> None:
    assert one.posterior.names == other.posterior.names
    np.testing.assert_array_equal(one.posterior.mean, other.posterior.mean)
    np.testing.assert_array_equal(one.posterior.covariance, other.posterior.covariance)


@pytest.mark.slow
def test_the_command_gives_the_posterior_of_the_function(short: Telemetry, clean: FittedModel, tmp_path: Path) -> None:
    write_csv(tmp_path / "log.csv", short)
    given = [str(tmp_path / "log.csv"), "--site", str(site_file(tmp_path))]
    assert main(["calibrate", *given, "--out", str(tmp_path / "out")]) == 0
    again = read_model(tmp_path / "out", SITE)
    # A CSV holds nine digits.
    np.testing.assert_allclose(again.posterior.mean, clean.posterior.mean, rtol=1e-4)
    np.testing.assert_allclose(again.posterior.standard_deviation, clean.posterior.standard_deviation, rtol=1e-3)
    np.testing.assert_allclose(again.posterior.correlation, clean.posterior.correlation, atol=1e-2)
    assert again.alignment == clean.alignment


def test_the_default_bundle_gives_the_posterior_of_the_function(
    short: Telemetry, monkeypatch: pytest.MonkeyPatch
) -> None:
    from igrow.trainer import default_bundle

    class Season:
        measured = true = short

    stages = (object(), object())
    monkeypatch.setattr(default_bundle, "virtual_seasons", lambda *_: [Season])
    monkeypatch.setattr(default_bundle, "train_networks", lambda *_, **__: stages)
    monkeypatch.setattr(default_bundle, "fit_net_growth", lambda *_: (0.5, 1e-4))
    monkeypatch.setattr(default_bundle, "RANGED", ("air_temperature",))
    built = default_bundle.default_model(SITE)
    assert_same_posterior(built, calibrate(prepare_log(short, SITE)))
    assert built.calibrated_on == BUILT_IN
    assert built.alignment is None


def test_the_benchmark_gives_the_posterior_of_the_function(short: Telemetry, monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks.diagnosis import logs
    from benchmarks.diagnosis.greenhouses import VirtualGreenhouse
    from igrow.core.greenhouse import GreenhouseParameters

    class Season:
        measured = short
        crop = None

    monkeypatch.setattr(logs, "simulate_many", lambda *_, **__: [Season])
    monkeypatch.setattr(logs, "history_of", lambda *_: None)
    monkeypatch.setattr(logs, "enr_units", lambda *_: {})
    greenhouse = VirtualGreenhouse(SITE, GreenhouseParameters(), np.datetime64("2020-03-01T00:00:00"), 1)
    found, wanted = logs.reference(greenhouse).model, calibrate(prepare_log(short, SITE))
    assert_same_posterior(found, wanted)
    assert found.alignment == wanted.alignment


@pytest.mark.parametrize("rows", [0, 1])
def test_the_alignment_of_the_actuators_is_recovered(telemetry: Telemetry, rows: int) -> None:
    log = prepare_log(shifted(telemetry, rows), SITE)
    model = calibrate(log.select(None, log.telemetry.time[0] + np.timedelta64(8, "D")))
    assert model.alignment == float(rows)


def test_a_model_tells_what_it_is(model: FittedModel) -> None:
    assert repr(model) == "FittedModel(virtual: 35 parameters, calibrated on virtual)"
    assert {one.quantity for one in model.errors} == {"air_temperature", "air_humidity", "air_co2"}
    assert all(one.after < one.before for one in model.errors if one.horizon == "24_h")
    text = model.summary()
    assert "transmissivity" in text
    assert "90 % interval" in text
    assert "persistence" in text
    (day,) = (line for line in text.splitlines() if line.startswith("air_temperature") and "24_h" in line)
    assert day.endswith("  K")


def test_errors_are_of_weeks_that_no_fit_saw(telemetry: Telemetry, model: FittedModel) -> None:
    """Spoiling the weeks that are held out moves the model, and not the fit that the errors are of."""
    week = (np.arange(len(telemetry)) // (7 * 96)) % 4 == 3
    spoiled = telemetry.with_columns({"air_temperature": telemetry["air_temperature"] + 1.5 * week})
    again = calibrate(prepare_log(spoiled, SITE))
    assert not np.allclose(again.posterior.mean, model.posterior.mean)
    clean, dirty = ({(one.quantity, one.horizon): one.after for one in some.errors} for some in (model, again))
    assert dirty["air_temperature", "24_h"] > clean["air_temperature", "24_h"] + 0.1


@pytest.mark.slow
def test_covariance_alignment_and_discrepancy_go_through_the_bundle(model: FittedModel, tmp_path: Path) -> None:
    bundle = export(replace(model, alignment=0.5), tmp_path / "bundle")
    again = read_model(read_bundle(tmp_path / "bundle"), SITE)
    assert_same_posterior(again, model)
    assert again.alignment == 0.5
    assert again.calibrated_on == SITE.name
    assert again.errors == model.errors
    draws = bundle.manifest.simulator["members"]
    assert len({draw["parameter:transmissivity"] for draw in draws}) == len(draws) > 1


def test_what_is_known_before_narrows_what_is_known_after(model: FittedModel, short: Telemetry) -> None:
    log = prepare_log(short, SITE)
    alone, after = calibrate(log), calibrate(log, prior_model=model)
    assert np.mean(after.posterior.standard_deviation / alone.posterior.standard_deviation) < 0.9
    assert after.crop is not None
    assert model.crop is not None
    assert (after.crop.growth, after.crop.harvest) == (model.crop.growth, model.crop.harvest)
    assert (after.crop.conversion, after.crop.maintenance) == (model.crop.conversion, model.crop.maintenance)
    assert any("counts no growth" in note for note in after.notes)


def test_plans_are_not_held_to_what_the_weeks_of_a_log_happened_to_hold(short: Telemetry, clean: FittedModel) -> None:
    built_in = read_bundle(default_bundle_folder()).manifest.training_range
    own = training_envelope({name: short[name] for name in ("air_temperature", "air_co2")})
    assert built_in["air_co2"][1] > own["air_co2"][1] + 50.0, "the log's weeks saw less CO2 than plans may ask for"
    for name in own:
        low, high = clean.training_range[name]
        # The working grid takes the edge off a log's extremes.
        assert low <= min(built_in[name][0], own[name][0] + 2.0)
        assert high >= max(built_in[name][1], own[name][1] - 20.0)
    assert united({"a": (0.0, 1.0)}, {}, {"a": (0.5, 2.0), "b": (1.0, 3.0)}) == {"a": (0.0, 2.0), "b": (1.0, 3.0)}


def test_a_log_of_less_than_four_weeks_is_fitted_without_errors_on_unseen_days(short: Telemetry) -> None:
    told: list[str] = []
    model = calibrate(prepare_log(short, SITE), progress=told.append)
    assert model.errors == ()
    assert any("four weeks" in line for line in told)


def test_a_model_whose_discrepancy_cannot_be_learned_is_written_with_a_sentence(
    short: Telemetry, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def refuse(*_: object) -> None:
        raise IgrowError("too few days")

    monkeypatch.setattr(calibration, "history_of", refuse)
    monkeypatch.setattr(calibration, "DEFAULT", replace(DEFAULT, least_history_days=7.0))
    model = calibrate(prepare_log(short, SITE))
    assert model.history is None
    assert any("could not be learned" in note and "too few days" in note for note in model.notes)
    assert "discrepancy.npz" not in export(model, tmp_path / "bundle").manifest.files


def zeros(log: Telemetry) -> Telemetry:
    rows = np.arange(len(log))
    out = (rows > 300) & (rows < 350)
    return log.with_columns({name: np.where(out, 0.0, values) for name, values in log.columns.items()})


def jittered(log: Telemetry) -> Telemetry:
    generator = np.random.default_rng(0)
    shift = generator.integers(-120, 120, len(log)).astype("timedelta64[s]")
    return Telemetry(log.time + shift, dict(log.columns))


def without_co2(log: Telemetry) -> Telemetry:
    return log.with_columns({"air_co2": np.zeros(len(log))})


@pytest.mark.parametrize("spoil", [zeros, jittered, without_co2])
def test_a_spoiled_log_is_fitted_without_a_warning_or_a_wild_parameter(
    short: Telemetry, clean: FittedModel, spoil
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        log = prepare_log(spoil(short), SITE)
        model = calibrate(log)
    assert log.notes
    assert np.isfinite(model.posterior.mean).all()
    heat = [model.posterior.names.index(name) for name in ("cover_heat_transfer", "transmissivity", "leakage_wind")]
    # What is spoiled tells less: without CO2 a leak is known half as well.
    deviation = np.maximum(clean.posterior.standard_deviation, model.posterior.standard_deviation)
    away = np.abs(model.posterior.mean - clean.posterior.mean) / deviation
    assert away[heat].max() < 2.0


def test_a_stuck_co2_sensor_is_told_and_teaches_nothing(short: Telemetry) -> None:
    log = prepare_log(short.with_columns({"air_co2": np.full(len(short), 640.0)}), SITE)
    assert any("air_co2" in note and "nothing is said of it" in note for note in log.notes)
    model = calibrate(log)
    known = FittedModel.described(SITE).posterior
    row = known.names.index("assimilation_maximum")
    assert model.posterior.mean[row] == pytest.approx(known.mean[row])


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (lambda log: log.select(None, log.time[0] + np.timedelta64(3, "D")), "spans 3.0 days"),
        (
            lambda log: log.only([name for name in log.columns if name != "outdoor_temperature"]),
            "no outdoor_temperature",
        ),
        (lambda log: log.with_columns({"air_temperature": np.full(len(log), 20.0)}), "air_temperature"),
        (lambda log: log.with_columns({"wind_speed": np.where(np.arange(len(log)) % 40 < 20, np.nan, 3.0)}), "24 h"),
    ],
)
def test_a_log_that_cannot_be_fitted_to_is_refused_with_the_reason(short: Telemetry, spoil, reason: str) -> None:
    with pytest.raises(IgrowError, match=reason):
        calibrate(prepare_log(spoil(short), SITE))
