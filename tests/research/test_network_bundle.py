"""The network variant's graph of a day gives what numpy and torch give, hour by hour, over a whole season."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from numpy.typing import NDArray

from igrow.core.bundle import Bundle, BundleError, open_session, self_test
from igrow.core.errors import IgrowError
from igrow.core.simulator.hindcast import SimulatorSettings
from igrow.core.simulator.leaf_picking import LeafPicking
from igrow.core.simulator.network import HOURS, LightFormula, NetworkSimulator, Stage
from igrow.core.simulator.network_run import Carried, begin, free_run, known_inputs, run_harvest, run_hour
from igrow.trainer.data import prepare_log
from igrow.trainer.research.network.checkpoint import load_simulator
from igrow.trainer.research.network.export import CARRIED, NEXT, hourly_outputs, write_network_bundle
from igrow.trainer.research.network.simulator import CLIMATE, GROWTH, HARVEST, daily_data, derived, hourly_data
from igrow.trainer.scoring.bundles import BY_SETPOINTS, score_bundle
from igrow.trainer.training.stage import run_stage, untrained
from tests.virtual_log import SITE, virtual_log

DAYS, RUNS = 165, 3
LENGTH = DAYS * HOURS + 1
HOUR = np.arange(LENGTH, dtype=np.float64) % float(HOURS)
Columns = dict[str, NDArray[np.float64]]


def columns() -> Columns:
    """Seasons whose climate and crop wander within plausible bounds: enough to scale the networks by."""
    generator = np.random.default_rng(1)
    day = np.maximum(np.sin((HOUR - 6) / 12 * np.pi), 0.0)

    def wander(middle: float, width: float) -> NDArray[np.float64]:
        return middle + width * np.repeat(generator.uniform(-1, 1, (RUNS, DAYS + 1)), HOURS, axis=1)[:, :LENGTH]

    rising = np.linspace(0.0, 1.0, LENGTH)[None] * generator.uniform(0.8, 1.2, (RUNS, 1))
    return {
        "global_radiation": wander(300, 200) * day, "outdoor_temperature": wander(9, 5) + 3 * day,
        "outdoor_humidity": wander(75, 15), "wind_speed": wander(5, 3), "sky_temperature": wander(-2, 6),
        "heating_setpoint": wander(19, 3), "co2_setpoint": wander(700, 200), "lamp_on": (HOUR < 6) + wander(0, 0),
        "irrigation_on": wander(0.5, 0.5), "air_temperature": wander(19, 4) + 3 * day, "air_humidity": wander(78, 8),
        "air_co2": wander(700, 150), "par": wander(300, 100) * day, "leaf_area_index": 3.2 + wander(0, 0.5),
        "plant_load": 300 * rising, "net_growth": 4 * rising, "fruit_fresh_weight": 12 * rising,
    }  # fmt: skip


def calm(stage: Stage) -> Stage:
    """Return the stage with a pull of its states towards their mean, as a trained one has, so that runs stay sane."""
    last = stage.matrices[-1] * np.float32(0.2)
    first = stage.matrices[0].copy()
    for column in range(len(stage.states)):
        row = first.shape[0] - len(stage.states) + column
        first[row], first[row, column], last[column] = 0.0, 1.0, 0.0
        last[column, column] = -0.5
    return replace(stage, matrices=(first, *stage.matrices[1:-1], last))


@pytest.fixture(scope="module")
def simulator() -> NetworkSimulator:
    full, valid = derived(columns()), np.ones(LENGTH, dtype=bool)
    stages = []
    for layout in (replace(CLIMATE, hidden=(24,)), replace(GROWTH, hidden=(16,))):
        stages.append(calm(untrained(layout, hourly_data(layout, full, HOUR, valid), 1)))
    harvest = untrained(replace(HARVEST, hidden=(8,)), daily_data(HARVEST, full), 1)
    ready, share = np.array([0, 300, 500], dtype=np.float32), np.array([0.1, 0.2, 0.3], dtype=np.float32)
    picking = LeafPicking(12.0, 2.5, 4.0, ready, share, certain=80.0, faded=120.0)
    return NetworkSimulator(stages[0], stages[1], harvest, LightFormula(2.0, 150.0, 10.0), picking)


@pytest.fixture(scope="module")
def bundle(simulator: NetworkSimulator, tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    ranges = {name: (float(values.min()), float(values.max())) for name, values in columns().items()}
    folder = tmp_path_factory.mktemp("network") / "bundle"
    return write_network_bundle(folder, simulator, site="here", created=datetime.now(UTC), training_range=ranges)


def run_graph_by_days(
    session: onnxruntime.InferenceSession, simulator: NetworkSimulator, known: Columns
) -> tuple[Columns, NDArray[np.float64]]:
    """Run all days from the first hour: name -> (runs, hours after the first), and the harvest (runs, days)."""
    carried: Carried = begin(simulator, known)
    feed = {name: getattr(carried, name) for name in CARRIED}
    rows = np.stack([known[name] for name in known_inputs(simulator)], axis=-1).astype(np.float32)
    hours, days = [], []
    for day in range(DAYS):
        part = slice(1 + day * HOURS, 1 + (day + 1) * HOURS)
        feed |= {"known": np.ascontiguousarray(rows[:, part].transpose(1, 0, 2))}
        feed |= {"hour": HOUR[part, None].astype(np.float32)}
        names = ["hourly", "daily", *(NEXT + name for name in CARRIED)]
        out = dict(zip(names, session.run(names, feed), strict=True))
        feed = {name: out[NEXT + name] for name in CARRIED}
        hours.append(out["hourly"])
        days.append(out["daily"][:, 0])
    hourly = np.concatenate(hours)
    return (
        {name: hourly[..., row].T for row, name in enumerate(hourly_outputs(simulator))},
        np.stack(days, axis=1),
    )


@pytest.fixture(scope="module")
def season(bundle: Bundle, simulator: NetworkSimulator) -> tuple[Columns, NDArray[np.float64]]:
    return run_graph_by_days(open_session(bundle.graph("simulator")), simulator, columns())


@pytest.mark.slow
def test_the_graph_by_days_gives_the_free_run_of_a_season(simulator: NetworkSimulator, season) -> None:
    free = free_run(simulator, columns(), HOUR)
    for stage in (simulator.climate, simulator.growth):
        for name, scale in zip(stage.states, stage.state_scale, strict=True):
            np.testing.assert_allclose(season[0][name], free[name][:, 1:], atol=1e-4 * scale, rtol=0, err_msg=name)
    picked = np.diff(season[0]["leaf_area_index"]) < -0.2
    assert picked.any(axis=1).all(), "no leaves were picked, so that the rule was not tested"


def test_torch_gives_the_season_that_the_graph_gives(simulator: NetworkSimulator, season) -> None:
    known = columns()
    run = {name: np.concatenate([known[name][:, :1], values], axis=1)
           for name, values in season[0].items() if name in known}  # fmt: skip
    stage = simulator.climate
    data = hourly_data(stage, {**known, "leaf_area_index": run["leaf_area_index"]}, HOUR, np.ones(LENGTH, dtype=bool))
    torch_run = run_stage(stage, data.drivers, HOUR, data.states[:, 0])
    for column, name in enumerate(stage.states):
        miss = np.abs(torch_run[..., column] - run[name]).max() / stage.state_scale[column]
        assert miss < 1e-4, (name, miss)


def test_the_harvest_of_the_graph_is_that_of_numpy(simulator: NetworkSimulator, season) -> None:
    known = columns()
    carried = begin(simulator, known)
    rows = {name: known[name].astype(np.float32) for name in known_inputs(simulator)}
    for day in range(5):
        part = slice(1 + day * HOURS, 1 + (day + 1) * HOURS)
        hours = []
        for row in range(part.start, part.stop):
            hour = np.full((RUNS, 1), HOUR[row], dtype=np.float32)
            now = {name: values[:, row : row + 1] for name, values in rows.items()}
            carried, values = run_hour(np, simulator, carried, now, hour)
            hours.append(values)
        stage = simulator.harvest
        means = {name: np.mean([values[name] for values in hours], axis=0) for name in stage.drivers}
        harvest, memory = run_harvest(np, stage, carried.harvest, carried.harvest_memory, means)
        carried = replace(carried, harvest=harvest, harvest_memory=memory)
        np.testing.assert_allclose(season[1][:, day], carried.harvest[:, 0], rtol=1e-4)


def test_the_bundle_proves_itself_and_brings_its_networks(bundle: Bundle, simulator: NetworkSimulator) -> None:
    assert {one.graph for one in self_test(bundle)} == {"simulator", "optimizer"}
    again = load_simulator(bundle.folder)
    np.testing.assert_array_equal(again.climate.matrices[0], simulator.climate.matrices[0])
    assert again.picking is not None and simulator.picking is not None and again.light == simulator.light
    for name, value in vars(simulator.picking).items():
        np.testing.assert_array_equal(getattr(again.picking, name), value)


def test_the_daemon_refuses_to_plan_with_it_in_one_line(bundle: Bundle) -> None:
    with pytest.raises(BundleError, match="missing"):
        SimulatorSettings.of(bundle)


def test_a_bundle_is_no_place_for_another(bundle: Bundle, simulator: NetworkSimulator) -> None:
    with pytest.raises(BundleError, match="exists already"):
        write_network_bundle(bundle.folder, simulator, site="here", created=datetime.now(UTC), training_range={
            name: (float(values.min()), float(values.max())) for name, values in columns().items()})  # fmt: skip


def test_a_folder_without_networks_is_refused(tmp_path: Path) -> None:
    with pytest.raises(IgrowError, match=r"network\.npz"):
        load_simulator(tmp_path)


def test_a_network_bundle_is_scored_on_a_measured_log(simulator: NetworkSimulator, tmp_path: Path) -> None:
    """One that predicts that nothing changes has, an hour ahead, the error of persistence."""
    still = simulator.climate
    last = np.zeros_like(still.matrices[-1])
    climate = replace(
        still, matrices=(*still.matrices[:-1], last), biases=(*still.biases[:-1], np.zeros_like(still.biases[-1]))
    )
    ranges = {name: (float(values.min()), float(values.max())) for name, values in columns().items()}
    frozen = write_network_bundle(
        tmp_path / "bundle",
        replace(simulator, climate=climate),
        site=SITE.name,
        created=datetime.now(UTC),
        training_range=ranges,
    )
    found = score_bundle(prepare_log(virtual_log(5, seed=2, step=900.0), SITE), frozen, ("1_h", "24_h"))
    assert set(found) == {BY_SETPOINTS}
    for quantity in climate.states:
        assert found[BY_SETPOINTS][quantity]["1_h"].mae == pytest.approx(
            found[BY_SETPOINTS][quantity]["1_h"].persistence, rel=1e-4
        )
        assert found[BY_SETPOINTS][quantity]["24_h"].runs > 10
