"""How greenhouses change: rates that are learned back from logs of known truth, and what they are good for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.shared_changes import evidence
from igrow.core.arrays import Floats
from igrow.core.errors import IgrowError
from igrow.trainer.diagnosis import drift
from igrow.trainer.diagnosis.drift import Drift, Pair
from igrow.trainer.diagnosis.rules import DEFAULT

KEYS = ("parameter:respiration", "parameter:vent_wind", "rain_cooling", "rain_cooling")


def pairs(rates: Floats, count: int) -> list[Pair]:
    """Later logs in which each amplitude has changed at its rate; the two shapes of an effect share one."""
    rng = np.random.default_rng(5)
    unit, known = np.array([2.0, 0.01, 1.0, 1.0]), 0.02**2
    found = []
    for _ in range(count):
        design = rng.normal(size=(4, 400)) / unit[:, None] * 3.0
        change = rng.normal(size=4) * np.sqrt((rates * unit) ** 2 + known * unit**2)
        residual = rng.normal(size=400) - change @ design
        found.append(
            Pair(KEYS, unit, np.full(4, 0.02), np.diag(known * unit**2), design @ design.T, -design @ residual)
        )
    return found


def test_rates_are_learned_back() -> None:
    found = drift.learn(pairs(np.array([0.4, 0.05, 0.1, 0.1]), 150), 42.0)
    assert found.rates["parameter:respiration"] == pytest.approx(0.4, rel=0.2)
    assert found.rates["parameter:vent_wind"] == pytest.approx(0.05, rel=0.3)
    assert found.rates["rain_cooling"] == pytest.approx(0.1, rel=0.2)


def test_what_was_learned_makes_its_logs_likelier() -> None:
    true = np.array([0.4, 0.05, 0.1, 0.1])
    logs = pairs(true, 40)
    found = drift.learn(logs, 42.0)
    learned = np.array([found.rates[key] for key in KEYS])
    told = [sum(evidence(one, rates * one.unit) for one in logs) for rates in (learned, np.full(4, 0.02))]
    assert told[0] > told[1]


def test_a_fleet_moves_what_came_with_the_trainer_the_more_the_more_sites_share() -> None:
    rates = {"parameter:respiration": 0.1, "rain_cooling": 0.1, "soil_respiration": 0.3}
    came = Drift(rates, 42.0, {"co2_drift": 20.0}, 9.0)
    true = np.array([0.4, 0.05, 0.1, 0.1])
    few, many = (drift.learn(pairs(true, count), 42.0, came) for count in (3, 150))
    assert 0.1 < few.rates["parameter:respiration"] < many.rates["parameter:respiration"]
    assert many.rates["parameter:respiration"] == pytest.approx(0.4, rel=0.2)
    assert few.rates["soil_respiration"] == 0.3, "what no site shows stays"
    assert (few.null_gains, few.least_gain) == (came.null_gains, came.least_gain)


def test_a_change_is_read_back_and_another_file_refused_in_one_line(tmp_path: Path) -> None:
    (one,) = pairs(np.full(4, 0.1), 1)
    back = Pair.from_bytes(one.to_bytes(), where="x")
    assert back.keys == one.keys
    for name in ("unit", "expected", "known", "information", "score"):
        np.testing.assert_array_equal(getattr(back, name), getattr(one, name))
    for content in (b"", b"PK", one.to_bytes()[:-40], replace(one, score=np.full(4, np.nan)).to_bytes(),
                    replace(one, unit=np.ones(3)).to_bytes()):  # fmt: skip
        with pytest.raises(IgrowError, match=r"^change\.npz: holds no change of a greenhouse: [^\n]+$"):
            Pair.from_bytes(content, where="change.npz")
    for text in ("", "[]", "{}", '{"rates": 3}', '{"rates": 3, "days": 42}', '{"rates": {"x": "y"}, "days": 42}'):
        (tmp_path / "drift.json").write_text(text)
        with pytest.raises(IgrowError, match=r"drift\.json: no drift as"):
            drift.read_drift(tmp_path / "drift.json")
    with pytest.raises(IgrowError, match=r"none\.json: No such file"):
        drift.read_drift(tmp_path / "none.json")


def test_a_rate_lies_between_physics_and_what_was_learned_and_grows_with_time() -> None:
    known = Drift({"parameter:vent_wind": 0.09, "parameter:respiration": 0.8, "rain_cooling": 0.001}, 42.0)
    assert known.rate("parameter:vent_wind", 0.01, 42.0) == pytest.approx(0.03)
    assert 0.3 < known.rate("parameter:respiration", 0.05, 42.0) < 0.8
    # Nothing changes less than by physics, nor less after some days than after those that were learned from.
    assert known.rate("rain_cooling", 0.02, 10.0) == pytest.approx(0.02)
    assert known.rate("rain_cooling", 0.02, 168.0) == pytest.approx(0.04)


def test_a_change_must_gain_more_than_it_did_where_nothing_had_changed() -> None:
    known = Drift({}, 42.0, {"co2_drift": 20.0, "lamp_heat": 1.0}, least_gain=9.0)
    assert known.needed_gain("co2_drift", DEFAULT) > 20.0
    assert known.needed_gain("lamp_heat", DEFAULT) == known.needed_gain("rain_cooling", DEFAULT) == 9.0


def test_a_stored_drift_is_read_back(tmp_path: Path) -> None:
    known = Drift({"rain_cooling": 0.1}, 42.0, {"co2_drift": 20.0}, 9.0, {"command": "x"})
    drift.write_drift(tmp_path / "drift.json", known)
    assert drift.read_drift(tmp_path / "drift.json") == known
