"""Training of the network stages: what torch trains is what numpy runs, and seasons are run freely and stay sane."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from igrow.core.errors import IgrowError
from igrow.core.simulator.network import advance, initial_memory
from igrow.core.simulator.network_run import day_ends, free_run
from igrow.trainer.research.network.checkpoint import FILE_NAME, load_simulator, simulator_to_bytes
from igrow.trainer.research.network.ensemble import merge
from igrow.trainer.research.network.simulator import CLIMATE, GROWTH, HARVEST, Layouts, train_simulator
from igrow.trainer.training.stage import (
    StageData,
    StageLayout,
    TrainingPlan,
    run_stage,
    run_windows,
    train_stage,
    untrained,
)
from igrow.trainer.training.stage_file import stages_to_bytes
from tests.made_once import made_once

HOURS = 600


def seasons(count: int, seed: int = 0) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.float64]]:
    """Greenhouses that warm towards their setpoint and the sun, with a crop that grows with light."""
    generator = np.random.default_rng(seed)
    hour = np.arange(HOURS, dtype=np.float64) % 24.0
    sun = np.maximum(0.0, np.sin((hour - 6) / 12 * np.pi)) * 500 * (0.5 + generator.random((1, HOURS)))
    sun = np.repeat(sun, count, axis=0)
    days = HOURS // 24
    setpoint = 18 + 4 * np.repeat(generator.random((count, days)), 24, axis=1) + 2 * (hour > 8)
    dose = 500 + 400 * np.repeat(generator.random((count, days)), 24, axis=1)
    lamp = (hour < 6) * np.ones((count, 1))
    air, co2, humidity = (np.zeros((count, HOURS)) for _ in range(3))
    air[:, 0], co2[:, 0], humidity[:, 0] = 18, 600, 70
    for t in range(1, HOURS):
        air[:, t] = air[:, t - 1] + 0.5 * (setpoint[:, t] + sun[:, t] / 100 - air[:, t - 1])
        co2[:, t] = co2[:, t - 1] + 0.4 * (dose[:, t] - sun[:, t] / 5 - co2[:, t - 1])
        humidity[:, t] = humidity[:, t - 1] + 0.3 * (95 - air[:, t] - humidity[:, t - 1])
    par = 2.0 * sun + 150 * lamp + 10
    net_growth = np.cumsum(1e-6 * par * (co2 / 700), axis=1)
    columns = {
        "global_radiation": sun, "outdoor_temperature": 8 + 0 * sun, "outdoor_humidity": 80 + 0 * sun,
        "wind_speed": 3 + 0 * sun, "sky_temperature": 0 * sun, "heating_setpoint": setpoint, "co2_setpoint": dose,
        "lamp_on": lamp, "irrigation_on": 1 + 0 * sun, "air_temperature": air, "air_humidity": humidity,
        "air_co2": co2, "par": par, "leaf_area_index": 0.2 + 3 * (1 - np.exp(-net_growth)),
        "plant_load": 300 * net_growth, "net_growth": net_growth,
        "fruit_fresh_weight": 3.0 * np.maximum(net_growth - 0.05, 0.0),
    }  # fmt: skip
    return columns, hour


SMALL = Layouts(
    climate=replace(CLIMATE, hidden=(24,)),
    growth=replace(GROWTH, hidden=(16,)),
    harvest=replace(HARVEST, hidden=(8,)),
    climate_plan=TrainingPlan(updates=((4, 400), (24, 60)), batch=64, learning_rate=1e-2),
    growth_plan=TrainingPlan(updates=((4, 300), (24, 40)), batch=64, learning_rate=1e-2),
    harvest_plan=TrainingPlan(updates=((4, 200), (10, 60)), batch=64, learning_rate=1e-2),
)

AIR = StageLayout("air", ("air_temperature",), ("heating_setpoint",), (3.0,), (8,), clock=True)


@pytest.fixture(scope="module")
@made_once
def trained():
    columns, hour = seasons(6)
    training = {name: values[:4] for name, values in columns.items()}
    held_out = {name: values[4:] for name, values in columns.items()}
    return train_simulator(training, hour, np.ones(HOURS, dtype=bool), SMALL), held_out, hour


@pytest.mark.slow
def test_two_workers_train_the_networks_of_one_to_the_last_digit() -> None:
    columns, hour = seasons(3)
    short = TrainingPlan(updates=((4, 20), (10, 5)), batch=16, learning_rate=1e-2)
    few = replace(SMALL, climate_plan=short, growth_plan=short, harvest_plan=short, members=2)
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        one, two = (
            train_simulator(columns, hour, np.ones(HOURS, dtype=bool), few, workers=workers) for workers in (1, 2)
        )
    finally:
        torch.set_num_threads(before)
    assert simulator_to_bytes(one) == simulator_to_bytes(two)


@pytest.mark.slow
def test_a_held_out_season_run_freely_follows_the_truth(trained) -> None:
    simulator, held_out, hour = trained
    run = free_run(simulator, held_out, hour)
    for name, least in (("air_temperature", 0.9), ("air_co2", 0.9), ("air_humidity", 0.9), ("net_growth", 0.95)):
        miss = ((run[name] - held_out[name]) ** 2).sum() / ((held_out[name] - held_out[name].mean()) ** 2).sum()
        assert 1 - miss > least, (name, 1 - miss)


def test_the_harvest_never_falls_and_all_stay_in_range(trained) -> None:
    simulator, held_out, hour = trained
    run = free_run(simulator, {**held_out, "global_radiation": 40 * held_out["global_radiation"]}, hour)
    assert (np.diff(run["fruit_fresh_weight"]) >= 0).all()
    assert run["air_humidity"].max() <= 100 and run["leaf_area_index"].min() >= 0
    assert all(np.isfinite(values).all() for values in run.values())


def test_a_run_reads_no_later_state_than_the_first(trained) -> None:
    simulator, held_out, hour = trained
    blind = {name: values.copy() for name, values in held_out.items()}
    for name in (*simulator.climate.states, *simulator.growth.states, *simulator.harvest.states):
        blind[name][:, 1:] = np.nan
    seen, unseen = free_run(simulator, held_out, hour), free_run(simulator, blind, hour)
    for name, values in seen.items():
        np.testing.assert_array_equal(values, unseen[name], err_msg=name)


def test_torch_and_numpy_give_the_same_run(trained) -> None:
    simulator, held_out, hour = trained
    stage = simulator.climate
    drivers = np.stack([held_out[name] for name in stage.drivers], axis=-1)
    start = np.stack([held_out[name][:, 0] for name in stage.states], axis=-1)
    torch_run = run_stage(stage, drivers, hour, start)
    state, memory = start.astype(np.float32), initial_memory(np, stage, drivers[:, 0].astype(np.float32))
    for t in range(1, HOURS):
        now = np.full((len(start), 1), hour[t], dtype=np.float32)
        state, memory = advance(np, stage, state, drivers[:, t].astype(np.float32), memory, now)
        assert np.abs((state - torch_run[:, t]) / stage.state_scale).max() < 1e-4


def test_steps_made_by_hand_are_added_and_not_learned() -> None:
    columns, hour = seasons(2)
    drivers, states = columns["heating_setpoint"][..., None], columns["air_temperature"][..., None]
    valid = np.ones(states.shape[:2], dtype=bool)
    jumps = np.zeros_like(states)
    jumps[:, 100::50] = -7.0
    fallen = states + np.cumsum(jumps, axis=1)
    plain = StageData(drivers, states, hour, valid)
    by_hand = StageData(drivers, fallen, hour, valid, jumps=jumps)
    np.testing.assert_allclose(untrained(AIR, by_hand, 1).increment_scale, untrained(AIR, plain, 1).increment_scale)
    start = replace(untrained(AIR, by_hand, 1), low=np.array([-1e3], dtype=np.float32))
    idle = replace(start, matrices=(start.matrices[0], 0 * start.matrices[1]))
    plan = TrainingPlan(updates=((4, 1),), batch=16, learning_rate=0.0)
    lines: list[str] = []
    still = np.cumsum(jumps, axis=1) + 20.0
    train_stage(idle, StageData(drivers, still, hour, valid, jumps=jumps), plan, lines.append)
    assert lines[0].endswith("loss 0"), "steps that are known must cost a network that stands still nothing"


def test_windows_start_where_they_are_told_with_filters_that_know_the_past(trained) -> None:
    simulator, held_out, hour = trained
    stage = simulator.climate
    drivers = np.stack([held_out[name] for name in stage.drivers], axis=-1)
    whole = run_stage(stage, drivers, hour, np.stack([held_out[name][:, 0] for name in stage.states], axis=-1))
    data = StageData(drivers, whole, hour, np.ones(whole.shape[:2], dtype=bool))
    part = run_windows(stage, data, np.array([[1, 100]]), 24)
    np.testing.assert_allclose(part[0], whole[1, 101:125], rtol=1e-4)


def test_the_same_seed_gives_the_same_weights_and_another_does_not() -> None:
    columns, hour = seasons(2)
    drivers, states = columns["heating_setpoint"][..., None], columns["air_temperature"][..., None]
    data = StageData(drivers, states, hour, np.ones(states.shape[:2], dtype=bool))
    plan = TrainingPlan(updates=((4, 30),), batch=16)
    one, two = (train_stage(untrained(AIR, data, 1), data, plan) for _ in range(2))
    other = train_stage(untrained(AIR, data, 1), data, replace(plan, seed=5))
    np.testing.assert_array_equal(one.matrices[0], two.matrices[0])
    assert not np.array_equal(one.matrices[0], other.matrices[0])


def test_hours_that_are_not_valid_teach_nothing() -> None:
    columns, hour = seasons(2)
    drivers, states = columns["heating_setpoint"][..., None], columns["air_temperature"][..., None]
    valid = np.ones(states.shape[:2], dtype=bool)
    valid[:, 200:260] = False
    wrong = states.copy()
    wrong[:, 201:259] = 55.0
    start = untrained(AIR, StageData(drivers, states, hour, valid), 1)
    plan = TrainingPlan(updates=((4, 30),), batch=16)
    with_gap, with_nonsense = (
        train_stage(start, StageData(drivers, values, hour, valid), plan) for values in (states, wrong)
    )
    np.testing.assert_array_equal(with_gap.matrices[0], with_nonsense.matrices[0])


def test_windows_longer_than_any_run_are_refused() -> None:
    columns, hour = seasons(1)
    states = columns["air_temperature"][..., None]
    data = StageData(states, states, hour, np.ones(states.shape[:2], dtype=bool))
    with pytest.raises(ValueError, match="601 steps"):
        train_stage(untrained(AIR, data, 0), data, TrainingPlan(updates=((601, 1),)))


def test_a_saved_simulator_comes_back_as_it_was(trained, tmp_path: Path) -> None:
    simulator, held_out, hour = trained
    (tmp_path / FILE_NAME).write_bytes(simulator_to_bytes(simulator))
    again = free_run(load_simulator(tmp_path), held_out, hour)
    for name, values in free_run(simulator, held_out, hour).items():
        np.testing.assert_array_equal(values, again[name])


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 but no more", b"weights: pickled"])
def test_a_damaged_file_of_weights_is_refused_in_one_line(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "network.npz"
    file.write_bytes(content)
    with pytest.raises(IgrowError, match=r"network\.npz: holds no network stages"):
        load_simulator(file)


def test_a_file_of_a_crop_alone_is_no_simulator(trained, tmp_path: Path) -> None:
    file = tmp_path / "crop.npz"
    file.write_bytes(stages_to_bytes({"growth": trained[0].growth, "harvest": trained[0].harvest}))
    with pytest.raises(IgrowError, match=r"crop\.npz: holds no network simulator"):
        load_simulator(file)


def test_the_last_day_of_a_run_may_be_short() -> None:
    assert day_ends(50).tolist() == [23, 47, 49]


def test_merged_networks_give_the_mean_of_their_increments(trained) -> None:
    simulator, held_out, hour = trained
    one = simulator.climate
    two = replace(one, matrices=tuple(matrix * 0.9 for matrix in one.matrices))
    state = np.stack([held_out[name][:, 5] for name in one.states], axis=-1).astype(np.float32)
    drivers = np.stack([held_out[name][:, 6] for name in one.drivers], axis=-1).astype(np.float32)
    memory, now = initial_memory(np, one, drivers), np.full((len(state), 1), hour[6], dtype=np.float32)
    alone = [advance(np, stage, state, drivers, memory, now)[0] for stage in (one, two)]
    together = advance(np, merge([one, two]), state, drivers, memory, now)[0]
    np.testing.assert_allclose(together, np.mean(alone, axis=0), rtol=1e-4)


def test_networks_of_different_scales_are_not_merged(trained) -> None:
    climate = trained[0].climate
    with pytest.raises(ValueError, match="differ in more than their weights"):
        merge([climate, replace(climate, state_scale=2 * climate.state_scale)])
