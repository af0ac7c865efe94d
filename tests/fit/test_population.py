"""What is learned from several greenhouses: where they lie together and how much they scatter, known beforehand."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from igrow.core.errors import IgrowError
from igrow.trainer.fit.climate import site_prior
from igrow.trainer.fit.gaussian import Gaussian
from igrow.trainer.fit.population import Learned, Population, learn_population, learned_of, read_population
from tests.virtual_log import SITE

DESCRIBED = site_prior(SITE)
NAME = "leakage_wind"
SPREAD = DESCRIBED.deviations[NAME]


def posterior(shift: float, noise: float) -> Gaussian:
    """The posterior of a fit that saw one parameter at `shift` with `noise`, both in the description's deviations."""
    left = 1.0 / (1.0 + noise**-2)
    mean, deviation = dict(DESCRIBED.values), dict(DESCRIBED.deviations)
    mean[NAME] += SPREAD * shift * left / noise**2
    deviation[NAME] *= left**0.5
    return Gaussian.independent(mean, deviation)


def test_the_prior_of_a_fit_is_divided_out_again() -> None:
    learned = learned_of(DESCRIBED, posterior(0.8, 0.5))
    assert learned.shift == {NAME: pytest.approx(0.8)}, "what no log saw is left out"
    assert learned.variance[NAME] == pytest.approx(0.25)


@pytest.mark.parametrize("noise", [0.1, 0.5])
def test_many_greenhouses_tell_where_they_lie_and_how_much_they_scatter(noise: float) -> None:
    rng = np.random.default_rng(3)
    true = rng.normal(1.2, 0.3, 200)
    sites = [Learned({NAME: float(one)}, {NAME: noise**2}) for one in true + noise * rng.normal(size=200)]
    found = learn_population(sites)
    assert found.sites == 200
    assert found.mean[NAME] == pytest.approx(1.2, abs=0.1)
    assert found.deviation[NAME] == pytest.approx(0.3, abs=0.1), "the scatter of the fits is no scatter of greenhouses"


def test_a_new_greenhouse_is_held_by_nine_intervals_of_ten() -> None:
    rng, held = np.random.default_rng(4), []
    for _ in range(400):
        centre, scatter = rng.normal(), rng.uniform(0.2, 1.0)
        true, noise = rng.normal(centre, scatter, 7), rng.uniform(0.1, 0.6, 7)
        seen = true + noise * rng.normal(size=7)
        found = learn_population(
            [Learned({NAME: float(one)}, {NAME: float(how**2)}) for one, how in zip(seen[1:], noise[1:], strict=True)]
        )
        held.append(abs(true[0] - found.mean[NAME]) <= 1.645 * found.deviation[NAME])
    assert 0.87 <= np.mean(held) <= 0.97


def test_few_greenhouses_move_the_description_little_and_never_make_it_wider() -> None:
    three = learn_population([Learned({NAME: 2.0}, {NAME: 0.1})] * 3)
    assert 0.5 < three.mean[NAME] < 2.0
    wild = learn_population([Learned({NAME: one}, {NAME: 0.1}) for one in (-4.0, 0.0, 4.0)])
    assert wild.deviation[NAME] == 1.0
    prior = wild.prior(SITE)
    assert prior.deviations[NAME] == pytest.approx(SPREAD)
    assert prior.values["transmissivity"] == DESCRIBED.values["transmissivity"], (
        "of what nobody saw the description holds"
    )


def test_two_are_too_few() -> None:
    with pytest.raises(IgrowError, match="2 sites have shared what they learned; 3 are needed"):
        learn_population([Learned({}, {})] * 2)


def test_it_is_read_as_it_was_written(tmp_path: Path) -> None:
    population = Population({NAME: 0.3}, {NAME: 0.8}, 5)
    population.write(tmp_path / "population.json")
    assert read_population(tmp_path / "population.json") == population


@pytest.mark.parametrize(
    "text", ["[]", "{", "{}", json.dumps({"sites": 3, "mean": {"x": "high"}, "deviation": {}}),
             json.dumps({"sites": 3, "mean": {}, "deviation": {"x": 0.0}})]
)  # fmt: skip
def test_another_file_is_refused_in_one_line(tmp_path: Path, text: str) -> None:
    path = tmp_path / "population.json"
    path.write_text(text)
    with pytest.raises(IgrowError, match=r"population\.json: [^\n]+$"):
        read_population(path)
    with pytest.raises(IgrowError, match="fleet learn"):
        read_population(tmp_path / "none.json")
