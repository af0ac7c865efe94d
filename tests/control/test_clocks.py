"""Clocks: wrong dates, jumps, and a plant's own clock."""

import time
from datetime import UTC, datetime

import pytest

from igrow.edge.clock import PlcClock, SystemClock, TrustedTime

NOW = datetime(2026, 3, 1, tzinfo=UTC).timestamp()


class Machine:
    def __init__(self, wall: float) -> None:
        self.monotonic, self.wall = 1000.0, wall
        self.clock = SystemClock(lambda: self.monotonic, lambda: self.wall)

    def run(self, seconds: float) -> float | None:
        self.monotonic += seconds
        self.wall += seconds
        return self.clock.true_time()


def test_a_plausible_clock_is_trusted_at_once():
    assert Machine(NOW).run(1.0) == NOW + 1.0


def test_a_clock_of_1970_is_not_trusted_and_its_correction_is_taken_at_once():
    machine = Machine(0.0)
    assert machine.run(100.0) is None
    machine.wall = NOW
    assert machine.run(1.0) == NOW + 1.0


def test_while_the_machine_sleeps_time_passes_and_its_date_has_not_jumped(monkeypatch):
    """A hand or an override ends in time, no plan is followed that was for the hours before, old values are old."""
    real, slept = time.clock_gettime, [0.0]
    monkeypatch.setattr(time, "clock_gettime", lambda one: real(one) + slept[0] * (one == time.CLOCK_BOOTTIME))
    clock = SystemClock(wall=lambda: NOW + real(time.CLOCK_MONOTONIC) + slept[0])
    before = clock.monotonic()
    assert clock.true_time() is not None
    slept[0] = 6 * 3600.0
    assert clock.monotonic() - before >= 6 * 3600.0
    assert clock.true_time() is not None
    assert clock.doubt == ""


def test_a_jump_costs_trust_until_the_clock_has_run_evenly_again():
    machine = Machine(NOW)
    machine.run(10.0)
    machine.wall += 7200.0
    assert machine.run(1.0) is None
    assert machine.run(30.0) is None
    assert machine.run(30.0) is not None


def test_a_jump_never_moves_monotonic_time():
    machine = Machine(NOW)
    before = machine.clock.monotonic()
    machine.wall -= 1e7
    machine.run(5.0)
    assert machine.clock.monotonic() == before + 5.0


def test_small_corrections_of_a_time_service_cost_no_trust():
    machine = Machine(NOW)
    for _ in range(100):
        machine.wall += 0.5
        assert machine.run(10.0) is not None


@pytest.mark.parametrize("pace", [0.0, 0.3, -1.0, 5.0])
def test_a_clock_that_stands_still_or_runs_at_a_pace_of_its_own_is_not_trusted(pace):
    machine = Machine(NOW)
    machine.run(10.0)
    for _ in range(3):
        machine.wall += 10.0 * (pace - 1.0)
        machine.run(10.0)
    assert "does not run evenly" in machine.clock.doubt
    for _ in range(100):
        machine.wall += 10.0 * (pace - 1.0)
        assert machine.run(10.0) is None
    for _ in range(7):
        machine.run(10.0)
    assert machine.clock.doubt == ""


@pytest.mark.parametrize("step", [-90.0, -3.0, 3.0, 90.0])
def test_a_step_of_a_time_service_costs_no_trust(step):
    machine = Machine(NOW)
    machine.run(10.0)
    machine.wall += step
    for _ in range(20):
        assert machine.run(1.0) is not None


def test_readings_in_quick_succession_say_nothing_of_the_pace():
    machine = Machine(NOW)
    for _ in range(100):
        machine.wall += 0.01  # the process was set aside between reading one clock and the other
        machine.run(0.001)
        machine.wall -= 0.01
        assert machine.run(0.001) is not None


def test_a_year_far_in_the_future_is_not_trusted():
    assert TrustedTime().judge(0.0, 9e9) is None


def test_a_followed_clock_counts_the_registers_growth():
    clock = PlcClock()
    assert clock.true_time() is None
    assert clock.follow(NOW)
    assert not clock.follow(NOW)
    assert clock.follow(NOW + 300.0)
    assert (clock.monotonic(), clock.true_time()) == (300.0, NOW + 300.0)


def test_a_register_that_goes_back_adds_nothing_and_takes_nothing():
    clock = PlcClock()
    clock.follow(NOW)
    clock.follow(NOW + 300.0)
    clock.follow(NOW - 1e6)
    clock.follow(NOW - 1e6 + 300.0)
    assert clock.monotonic() == 600.0


def test_a_register_in_1970_gives_no_date():
    clock = PlcClock()
    clock.follow(3600.0)
    assert clock.true_time() is None
