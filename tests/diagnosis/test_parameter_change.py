"""A parameter's own change: named where it alone explains a log, with its size and its beginning, and no more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from igrow.core.language import speak
from igrow.core.simulator.hybrid import climate
from igrow.core.simulator.hybrid.parameters import PARAMETERS
from igrow.core.simulator.hybrid.record import observe
from igrow.core.telemetry import Telemetry
from igrow.trainer.diagnosis import Diagnosis, Finding, diagnose
from igrow.trainer.diagnosis.answer import wording
from igrow.trainer.diagnosis.design import amplitudes, linear, sensitivity
from igrow.trainer.diagnosis.design.design import Design, History
from igrow.trainer.diagnosis.learned.null_gains import NullGains
from igrow.trainer.diagnosis.search import history, parameter_change
from igrow.trainer.diagnosis.search.parameter_change import find
from igrow.trainer.diagnosis.visible_parameters import VISIBLE, members
from igrow.trainer.fit import FittedModel
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.report import sentences
from igrow.trainer.report.worth import worth
from tests.diagnosis.known_greenhouse import DAYS, KNOWN, later, weeks
from tests.diagnosis.synthetic_design import BALANCES, PLAIN, Truth, make_design
from tests.virtual_log import GREENHOUSE, SITE

NAMES = ("transmissivity", "mass_heat_capacity", "leakage_wind")


@pytest.fixture(name="linear")
def linear_at_any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """No greenhouse stands behind a design of `with_parameters`: its columns are what the changes are at any size."""
    monkeypatch.setattr(parameter_change, "at_its_size", lambda design, one, *_: (design, one))


def with_parameters(truth: Truth, seed: int, *, names: Sequence[str] = NAMES, **null_gains: float) -> Design:
    """A design of parameters of the simulator, one of which nobody can look at; columns are in a tenth of the value."""
    design = make_design(truth, seed=seed)
    block = replace(design.block("parameter"), labels=tuple(names))
    values = np.array([PARAMETERS[name].value for name in names])
    design = replace(
        design,
        prior=Gaussian(tuple(names), values, np.diag((0.1 * values) ** 2)),
        blocks={**design.blocks, "parameter": block},
    )
    columns = list(block.columns)
    scaled = design.values.copy()
    scaled[columns] /= 0.1 * values[:, None, None, None]
    design = replace(design, values=scaled)
    keys = amplitudes.keys(design)
    deviation = np.concatenate([0.01 * values, np.full(len(keys) - len(values), 0.01)])
    gains = {f"parameter:{name}": gain for name, gain in null_gains.items()}
    known = History(
        Gaussian(keys, np.zeros(len(keys)), np.diag(deviation**2)),
        np.zeros_like(design.values[0]),
        (PLAIN,) * BALANCES,
        {},
        null_gains=NullGains(gains, 8.0),
    )
    _, solved = history.solve_jointly(replace(design, history=known))
    return solved


def test_a_change_at_whose_size_the_model_runs_out_of_all_bounds_is_what_its_slope_says(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    design = parameter_change.joined(with_parameters(Truth({}, {}, (0.0, 1.2, 0.0)), 4))
    null, rng = linear.fit(design.grams, design.null_model()), np.random.default_rng(0)
    (first, *_) = parameter_change.score(design, null, [None], rng)
    monkeypatch.setattr(sensitivity, "parameter_secant", lambda *_: np.full(design.line.shown.shape, np.inf))
    told, at_its_size = parameter_change.at_its_size(design, first, [None], rng)
    assert told is design and at_its_size is first


@pytest.mark.usefixtures("linear")
def test_the_parameter_that_has_changed_is_named_with_its_size() -> None:
    found = find(with_parameters(Truth({}, {}, (-3.0, 0.0, 0.0)), 1), np.random.default_rng(0))
    assert found is not None and found.leads
    assert found.confounded == ("transmissivity",)
    assert found.share.low < -0.3 < found.share.high
    assert abs(found.share.value + 0.3) < 0.03


@pytest.mark.usefixtures("linear")
def test_parameters_that_one_thing_changes_together_are_named_as_one() -> None:
    names = ("vent_stack", "vent_wind", "mass_heat_capacity")
    found = find(with_parameters(Truth({}, {}, (-6.0, -6.0, 0.0)), 1, names=names), np.random.default_rng(0))
    assert found is not None and found.leads
    assert (found.parameter, found.confounded) == ("ventilation", ("ventilation",))
    assert found.share.low < -0.6 < found.share.high
    alone = find(with_parameters(Truth({}, {}, (-6.0, 0.0, 0.0)), 1, names=names), np.random.default_rng(0))
    assert alone is not None and alone.parameter == "vent_stack"


@pytest.mark.usefixtures("linear")
def test_a_torn_screen_saves_less_and_lets_more_air_through() -> None:
    names = ("energy_screen_saving", "screen_air_resistance", "mass_heat_capacity")
    found = find(with_parameters(Truth({}, {}, (-6.0, -6.0, 0.0)), 1, names=names), np.random.default_rng(0))
    assert found is not None and (found.parameter, found.leads) == ("screens", True)
    assert found.share.low < -0.6 < found.share.high


@pytest.mark.usefixtures("linear")
def test_a_small_change_is_named_only_where_it_leads() -> None:
    """A washed cover: 15 % more light. Named an effect in its place it would be a sensor in the sun."""
    washed, cleaned = (with_parameters(Truth({}, {}, (tenths, 0.0, 0.0)), 1) for tenths in (1.5, 0.6))
    found = find(washed, np.random.default_rng(0))
    assert found is not None and (found.parameter, found.leads) == ("transmissivity", True)
    assert find(cleaned, np.random.default_rng(0)) is None
    beside = with_parameters(Truth({"lamp_heat": 4.0}, {}, (-1.5, 0.0, 0.0)), 4)
    assert find(beside, np.random.default_rng(0)) is None


@pytest.mark.usefixtures("linear")
def test_nothing_is_named_where_nothing_has_changed() -> None:
    for seed in range(5):
        assert find(with_parameters(Truth({}, {}), 10 + seed), np.random.default_rng(0)) is None


@pytest.mark.usefixtures("linear")
def test_a_parameter_that_nobody_can_look_at_is_not_named() -> None:
    assert find(with_parameters(Truth({}, {}, (0.0, 3.0, 0.0)), 2), np.random.default_rng(0)) is None


@pytest.mark.usefixtures("linear")
def test_a_parameter_must_gain_far_more_than_where_nothing_had_changed() -> None:
    truth = Truth({}, {}, (-3.0, 0.0, 0.0))
    assert find(with_parameters(truth, 3, transmissivity=1e6), np.random.default_rng(0)) is None


@pytest.mark.usefixtures("linear")
def test_what_a_parameter_must_gain_tells_whether_it_is_told_and_not_before_which() -> None:
    """Both have changed; of the one that explains more of the log more is asked."""
    design = with_parameters(Truth({}, {}, (-3.0, 0.0, -2.7)), 1)
    assert design.history is not None
    for usual in (0.0, 60.0):
        gains = replace(design.history, null_gains=NullGains({"parameter:transmissivity": usual}, 8.0))
        found = find(replace(design, history=gains), np.random.default_rng(0))
        assert found is not None and found.parameter == "transmissivity"


@pytest.mark.usefixtures("linear")
def test_a_change_to_less_than_nothing_is_none() -> None:
    assert find(with_parameters(Truth({}, {}, (-11.0, 0.0, 0.0)), 6), np.random.default_rng(0)) is None


@pytest.mark.usefixtures("linear")
def test_an_effect_that_explains_more_goes_before_a_parameter() -> None:
    found = find(with_parameters(Truth({"lamp_heat": 4.0}, {}, (-3.0, 0.0, 0.0)), 4), np.random.default_rng(0))
    assert found is not None and not found.leads


def test_every_parameter_that_may_be_named_has_words_in_every_language() -> None:
    english = speak("en", SITE.time_zone)
    for name, visible in VISIBLE.items():
        assert set(members(name)) <= set(PARAMETERS) and visible.balances
        assert sentences.title(name, english) == visible.title
        for code in ("nl", "de", "es", "zh"):
            assert sentences.title(name, speak(code, SITE.time_zone)) != visible.title


def test_air_that_leaks_may_come_in_by_a_vent_that_does_not_close() -> None:
    assert all("vents" in VISIBLE[name].check for name in ("leakage_still", "leakage_wind"))


@pytest.fixture(scope="module")
def log() -> tuple[Telemetry, Telemetry]:
    """The same weeks twice: with the cover as it was, and with a third of its light taken."""
    return weeks(), weeks(GREENHOUSE | {"transmissivity": 0.67 * GREENHOUSE["transmissivity"]})


def costs(told: Diagnosis, finding: Finding) -> None:
    """A darker greenhouse needs more heat, and the lamps' electricity for the sun's light that it lost."""
    found = worth(told, finding)
    assert found is not None and told.evidence is not None
    assert found.heat > 0.0
    record, now = told.evidence.log.record, told.evidence.stages["corrected"].posterior.values["transmissivity"]
    drivers = [
        climate.derive(
            np,
            observe(record, told.model.posterior.values, {}),
            record.inputs,
            told.model.posterior.values | {"transmissivity": value},
            record.lamp_efficacy,
        )
        for value in (now / (1.0 + finding.parameters["change"].value), now)
    ]
    lost = (drivers[0]["par"] - drivers[1]["par"])[record.usable].mean()
    assert found.lamp_light == pytest.approx(lost * 604_800.0 / record.lamp_efficacy / 3.6e6, rel=1e-3)
    assert found.spread is not None and found.spread[0] < 1.0 < found.spread[1]
    crop = replace(finding, effect="assimilation_maximum")
    assert worth(told, crop) is None


@pytest.mark.slow
def test_a_painted_cover_is_told_and_is_no_news_afterwards(
    log: tuple[Telemetry, Telemetry], known_model: FittedModel
) -> None:
    seen = later(*log, 0)
    told = diagnose(seen, known_model)
    assert told.verdict == "named"
    (finding,) = told.findings
    assert (finding.effect, finding.kind, finding.onset) == ("transmissivity", "parameter", None)
    change = finding.parameters["change"]
    assert change.low < -0.33 < change.high
    day = told.errors["air_temperature"]["24_h"]
    assert max(day["corrected"], day["recalibrated"] * 1.05) < 0.7 * day["deployed"]
    # What is shipped is no worse with it, all quantities together.
    shares = [by["24_h"]["corrected"] / by["24_h"]["recalibrated"] for by in told.errors.values()]
    assert np.mean(shares) < 1.0
    assert "less than at the calibration" in told.summary()
    assert "licht door het dek" in sentences.cause(finding, speak("nl", SITE.time_zone)).lower()
    assert sentences.checks(finding, speak("en", SITE.time_zone))
    costs(told, finding)
    # Pipes that nobody logged can look like a cover that changed.
    assert all(one.kind != "parameter" for one in diagnose(seen.without("rail_pipe_temperature"), known_model).findings)
    again = diagnose(seen, told.corrected)
    assert all(one.effect != "transmissivity" for one in again.findings)


@pytest.mark.slow
def test_a_cover_that_is_painted_within_the_log_has_a_date(
    log: tuple[Telemetry, Telemetry], known_model: FittedModel
) -> None:
    seen = later(*log, 9)
    told = diagnose(seen, known_model)
    (finding,) = told.findings
    assert finding.effect == "transmissivity" and finding.onset is not None
    painted = seen.telemetry.time[0] + np.timedelta64(9, "D")
    assert abs(finding.onset.time - painted) <= np.timedelta64(2, "D")
    assert told.start >= finding.onset.time - np.timedelta64(1, "D")
    assert finding.sentence.startswith("Since ")
    assert finding.parameters["change"].low < -0.33 < finding.parameters["change"].high


@pytest.mark.slow
def test_leaves_that_wilt_within_the_log_have_a_date_and_are_no_sensor(
    log: tuple[Telemetry, Telemetry], known_model: FittedModel
) -> None:
    plain, values = log[0], GREENHOUSE
    wilted = values | {name: 0.4 * values[name] for name in members("transpiration")}
    after = weeks(wilted)
    told = diagnose(later(plain, after, 9), known_model)
    (finding,) = told.findings
    assert finding.effect == "transpiration" and finding.onset is not None
    assert abs(finding.onset.time - plain.time[0] - np.timedelta64(KNOWN + 9, "D")) <= np.timedelta64(2, "D")
    assert finding.parameters["change"].low < -0.6 < finding.parameters["change"].high
    assert "transpires" in finding.sentence
    assert worth(told, finding) is None


@pytest.mark.slow
def test_a_leak_keeps_its_name_beside_the_parameter_that_it_is_more_of(
    log: tuple[Telemetry, Telemetry], known_model: FittedModel
) -> None:
    """At its size a parameter gains more than an effect does along its slope, though both are one."""
    leaking = weeks(GREENHOUSE | {"leakage_wind": GREENHOUSE["leakage_wind"] + 0.12})
    (finding,) = diagnose(later(log[0], leaking, 9), known_model).findings
    assert finding.effect == "wind_infiltration"
    size = finding.parameters["air_changes"]
    assert size.low < 0.12 < size.high


@pytest.mark.slow
@pytest.mark.parametrize("left", [0.6, 0.67])
def test_a_cover_that_was_painted_some_days_ago_waits_for_a_later_log(
    log: tuple[Telemetry, Telemetry], known_model: FittedModel, left: float
) -> None:
    # Fewer days than a diagnosis needs: no set of parameters is right for this log.
    painted = GREENHOUSE | {"transmissivity": left * GREENHOUSE["transmissivity"]}
    after = weeks(painted)
    told = diagnose(later(log[0], after, DAYS - KNOWN - 6), known_model)
    assert told.findings == ()
    assert wording.WAITING in told.notes


@pytest.mark.slow
def test_the_cover_as_it_was_is_not_named(log: tuple[Telemetry, Telemetry], known_model: FittedModel) -> None:
    assert diagnose(later(*log, DAYS), known_model).verdict == "nothing"
