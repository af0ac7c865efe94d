"""The published tables computed again: readers, splits, scores and the predictors of the harvest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from igrow.core.errors import IgrowError
from igrow.core.site import Prices
from igrow.trainer.research.network.leaf_picking import smooth
from igrow.trainer.research.paper import (
    automatoes2020,
    figure3,
    harvests,
    incremental,
    liaoyang2020,
    pilot,
    seasons,
    table1,
)
from igrow.trainer.research.paper.compartments import Compartment, read_2019
from igrow.trainer.research.paper.scores import SCORED, r2, score
from igrow.trainer.research.paper.wur2020 import FAULTY_DAYS, TrajectoryFileError, read_seasons
from igrow.trainer.training.stage import StageData, TrainingPlan


def test_the_split_uses_every_season_once() -> None:
    split = table1.split_seasons(40, seed=3)
    assert sorted(np.concatenate([split.training, split.selection, split.test])) == list(range(40))
    assert [len(part) for part in (split.training, split.selection, split.test)] == [24, 6, 10]


def test_r2_is_one_for_the_truth_and_zero_for_its_mean() -> None:
    truth = np.array([[1.0, 2.0, 3.0, 4.0]])
    assert r2(truth, truth) == 1.0
    assert r2(truth, np.full((1, 4), 2.5)) == 0.0


def test_hours_left_out_do_not_count_and_the_harvest_is_scored_by_day() -> None:
    generator = np.random.default_rng(0)
    truth = {name: generator.random((2, 96)) for name in SCORED}
    predicted = {name: values.copy() for name, values in truth.items()}
    valid = np.ones(96, dtype=bool)
    valid[24:48] = False
    for name in set(SCORED) - {"leaf_area_index"}:
        predicted[name][:, 24:48] = 99.0
    predicted["fruit_fresh_weight"][:, 50] = 99.0
    assert all(value.mean == 1.0 for value in score(truth, predicted, valid).values())


def test_seasons_are_read_with_the_papers_preprocessing(data_folder: Path) -> None:
    seasons = read_seasons(data_folder / "wur2020")
    assert len(seasons.names) == 40 and seasons.time.size == 3983
    assert seasons.hour[0] == 1.0
    assert (~seasons.valid).sum() == 24 * len(FAULTY_DAYS)
    # In the dark the crop loses a little; over a season it gains kilograms.
    assert np.diff(seasons.columns["net_growth"]).min() > -1e-3
    assert (seasons.columns["net_growth"][:, -1] > 3.0).all()
    assert seasons.columns["leaf_area_index"].min() >= 0
    # The picking of leaves stands in the leaf area; the paper's smoothing takes it out where it is scored.
    assert np.diff(seasons.columns["leaf_area_index"]).min() < -0.5
    assert np.abs(np.diff(smooth(seasons.columns["leaf_area_index"]))).max() < 0.05


def test_the_settings_know_nothing_of_the_climate(data_folder: Path) -> None:
    """A setting that the networks read must be a function of the hour alone, or it could tell them the answer."""
    columns = read_seasons(data_folder / "wur2020").columns
    assert np.ptp(columns["air_temperature"], axis=0).max() > 10.0
    for name in table1.SETTINGS:
        assert np.ptp(columns[name], axis=0).max() < 1e-5, name


def test_a_file_that_lacks_a_column_is_refused_by_its_name(tmp_path: Path) -> None:
    file = tmp_path / "trajectories.parquet"
    pd.DataFrame({"trajectory": ["a"], "time": [np.datetime64("2020-01-01")]}).to_parquet(file)
    with pytest.raises(TrajectoryFileError, match="lacks the columns global_radiation"):
        read_seasons(file)


def test_a_folder_without_trajectories_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryFileError, match="no Parquet file"):
        read_seasons(tmp_path)


@pytest.mark.slow
def test_a_short_training_writes_a_bundle_that_evaluates_to_the_same_scores(data_folder: Path, tmp_path: Path) -> None:
    quick = replace(
        table1.LAYOUTS,
        climate=replace(table1.LAYOUTS.climate, hidden=(16,)),
        climate_plan=TrainingPlan(updates=((4, 150),), batch=128),
        growth_plan=TrainingPlan(updates=((4, 50),), batch=64),
        harvest_plan=TrainingPlan(updates=((4, 50),), batch=64),
    )
    few = tmp_path / "few.parquet"
    table = pd.read_parquet(data_folder / "wur2020" / "trajectories.parquet")
    table[table.trajectory.isin(sorted(table.trajectory.unique())[:5])].to_parquet(few)
    result = table1.run(few, tmp_path / "out", layouts=quick)
    assert set(result.scores) == set(SCORED)
    assert all(np.isfinite(value.mean) for value in result.scores.values())
    again = seasons.run(tmp_path / "out", few, tmp_path / "scores.json")
    names = sorted(table.trajectory.unique())[:5]
    row = names.index(result.held_out[0])
    assert again["air_temperature"].seasons[row] == pytest.approx(result.scores["air_temperature"].seasons[0], abs=1e-6)


def crop(name: str, yield_per_mol: float, days: int = 120) -> Compartment:
    light = 10 + 0.1 * np.arange(days, dtype=np.float64)
    harvest_day = np.arange(60, days, 5)
    since = np.cumsum(light) - np.cumsum(light)[50]
    harvested = yield_per_mol * np.maximum(since, 0)[harvest_day]
    return Compartment(
        name, np.arange(np.datetime64("2020-01-01"), np.datetime64("2020-01-01") + days),
        {"light_sum": light, "temperature": np.full(days, 20.0), "stem_density": np.full(days, 3.9)},
        harvest_day, harvested,
        {name: np.ones(days) for name in ("heat", "electricity_peak", "electricity_off_peak", "co2")},
        np.full(harvest_day.size, 8.0), 1.95,
    )  # fmt: skip


def test_light_use_finds_the_efficiency_it_was_given() -> None:
    others = [crop("a", 0.02), crop("b", 0.02)]
    predicted = harvests.light_use(others, crop("c", 0.02))
    np.testing.assert_allclose(predicted[others[0].harvest_day], others[0].harvested, atol=0.3)


@pytest.mark.slow
def test_no_predictor_reads_the_harvest_it_predicts() -> None:
    others, seen = [crop("a", 0.02), crop("b", 0.025)], crop("c", 0.02)
    changed = replace(seen, harvested=seen.harvested * 3)
    for name, predictor in harvests.PREDICTORS.items():
        np.testing.assert_array_equal(predictor(others, seen), predictor(others, changed), err_msg=name)


def test_the_champions_profit_reads_neither_his_harvest_nor_his_heat_and_co2() -> None:
    others, champion = [crop("a", 0.02), crop("b", 0.025)], crop("c", 0.02)
    resources = {**champion.resources, "heat": 9 * champion.resources["heat"], "co2": 9 * champion.resources["co2"]}
    changed = replace(champion, harvested=champion.harvested * 3, resources=resources, brix=champion.brix + 1)
    curve = np.linspace(0, 10, champion.day.size)
    np.testing.assert_array_equal(
        figure3.predicted_profit(champion, others, curve, Prices()),
        figure3.predicted_profit(changed, others, curve, Prices()),
    )


def test_wageningens_simulator_is_349_away_from_the_measured_profit(data_folder: Path) -> None:
    champion = automatoes2020.read(data_folder / "automatoes2020")
    assert np.abs(champion.simulated - 4.29 - champion.measured).sum() == pytest.approx(348.93, abs=0.01)


def test_a_folder_without_the_champions_books_is_refused(tmp_path: Path) -> None:
    with pytest.raises(IgrowError, match="are needed"):
        automatoes2020.read(tmp_path)


def test_compartments_hold_the_measured_totals(data_folder: Path) -> None:
    crops = {item.name: item for item in read_2019(data_folder / "agc2019")}
    assert len(crops) == 6
    assert crops["Automatoes"].harvested[-1] == pytest.approx(14.92, abs=0.01)
    assert crops["Reference"].harvested[-1] == pytest.approx(14.30, abs=0.01)
    assert crops["Automatoes"].cumulative()[-1] == pytest.approx(14.92, abs=0.01)
    assert crops["Reference"].resources["heat"].sum() == pytest.approx(471.56, abs=0.1)


def test_rehearsal_draws_the_share_it_is_told_from_the_real_run() -> None:
    shape = (3, 200, 1)
    virtual = StageData(np.zeros(shape), np.zeros(shape), np.zeros(200), np.ones(shape[:2], dtype=bool))
    valid = np.zeros((1, 200), dtype=bool)
    valid[:, :50] = True
    real = StageData(np.ones((1, 200, 1)), np.ones((1, 200, 1)), np.zeros(200), valid)
    both = incremental.joined(virtual, real, 0.4)
    drawn = both.weight * both.valid.sum(axis=1)
    assert drawn[-1] / drawn.sum() == pytest.approx(0.4)


def test_weeks_outside_those_named_are_not_seen() -> None:
    valid = np.ones((1, 10 * 168), dtype=bool)
    data = StageData(np.zeros((1, 1680, 1)), np.zeros((1, 1680, 1)), np.zeros(1680), valid)
    seen = incremental.only_weeks(data, 2, 5).valid[0]
    assert seen.sum() == 3 * 168 and seen[2 * 168] and not seen[5 * 168]


def test_the_second_pilot_is_read_per_square_metre(data_folder: Path) -> None:
    season = liaoyang2020.read(data_folder / "liaoyang2020")
    grown = {greenhouse: values.sum() for greenhouse, values in season.production.items()}
    assert set(grown) == set(liaoyang2020.GREENHOUSES)
    assert all(1.0 < total < 30.0 for total in grown.values())
    assert season.costs["gh01"]["labour"] == pytest.approx(1543.96 / 667)
    experiment, control = liaoyang2020.read_climate_pair(data_folder / "liaoyang2020", 3, 1)
    assert experiment["air_temperature"].size == control["air_temperature"].size > 100


def test_the_pilots_table_is_computed_again_with_its_spreads_and_tests(
    data_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = pilot.run(data_folder / "liaoyang2020", tmp_path)
    harvest, profit = lines["yield"], lines["net profit"]
    assert harvest.change == pytest.approx(10.15, abs=0.005)
    # The paper prints a tenth of these, and of each line the p-value of another test.
    assert (harvest.control_spread, harvest.experiment_spread) == pytest.approx((533.2, 454.2), abs=0.1)
    assert (harvest.p_one_sample, harvest.p_student, harvest.p_welch) == pytest.approx((7.7e-3, 0.063, 0.245), rel=0.02)
    assert (profit.control, profit.experiment) == pytest.approx((1498.56, 2887.70), abs=0.01)
    assert profit.p_student == pytest.approx(2.8e-4, rel=0.02)
    assert "as published" in capsys.readouterr().out
    figures = {path.stem for path in tmp_path.glob("*.svg")}
    assert figures == {"figure5", *(f"figureS{number}" for number in range(4, 14))}


@pytest.mark.slow
def test_figure_3_has_both_panels_and_every_curve(
    data_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = figure3.run(data_folder / "agc2019", data_folder / "automatoes2020", tmp_path)
    assert found["Wageningen's simulator"] == pytest.approx(349, abs=0.5)
    drawn = (tmp_path / "figure3.svg").read_text()
    assert "cumulative net profit" in drawn and "sum of absolute daily differences" in drawn
    assert all(name.replace("'", "&#x27;") in drawn or name in drawn for name in (*found, "measured"))
    assert capsys.readouterr().out.count("as published") == 3
