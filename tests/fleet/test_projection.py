"""The projection's arithmetic: what a site takes, and which bound is reached first."""

from __future__ import annotations

import pytest

from benchmarks.projection import Cluster, Costs, bounds, core_seconds, report

ONE = Costs(collecting=1.0, looking=0.1, requests=6.0, diagnosing=7.0, megabytes=500.0, showing=0.001)


def test_a_site_takes_its_rounds_and_a_seventh_of_its_diagnosis() -> None:
    assert core_seconds(ONE) == pytest.approx(1.0 + 2.3 + 1.0)


def test_the_smallest_number_comes_first_and_memory_bounds_what_runs_at_once() -> None:
    wide, narrow = bounds(ONE, Cluster(32, 128.0, 0.05)), bounds(ONE, Cluster(32, 2.0, 0.05))
    assert [number for number, _ in wide] == sorted(number for number, _ in wide)
    assert "SFTP server" in wide[0][1]
    assert any(what.startswith("processors: 4 tasks at once") for _, what in narrow)


def test_a_hundred_thousand_sites_take_their_seconds_in_hours() -> None:
    assert "119 core-hours a day" in report(ONE, Cluster(32, 128.0, 0.05), 100_000)[1]
