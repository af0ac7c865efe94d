"""The nights in which the clocks change, as the daemon lives through them: its day programme, and an older plan."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from igrow.core.site import Site
from igrow.edge.ports import Plan, PlanRequest
from igrow.edge.store import StoreError, read_telemetry
from tests.control.daemon_bench import Plant, control_of, free_port, plan_at_once, running, until, write_files
from tests.service.running_daemon import RunningDaemon

HOUR = np.timedelta64(3600, "s")
NIGHTS = {
    # When the night begins, by UTC, and what is right in the hours from then on: 02:00 comes never, or twice.
    "spring": (np.datetime64("2026-03-29T00:00", "s"), [0.1, 0.5, 0.2, 0.2]),
    "autumn": (np.datetime64("2026-10-24T23:00", "s"), [0.1, 0.3, 0.3, 0.5, 0.2]),
}
PROGRAMME = ((0, 0.1), (2, 0.3), (3, 0.5), (4, 0.2))
"""From which hour of the wall clock on, what."""


def programme(setpoint: str, value: Callable[[float], float]) -> str:
    periods = ", ".join(f"{{at: {hour:02d}:00, value: {value(share):g}}}" for hour, share in PROGRAMME)
    return f"  {setpoint}: [{periods}]\n"


def seconds(time: np.datetime64) -> float:
    return float(time.astype("datetime64[s]").astype(float))


def stood(state: Path, name: str, begin: np.datetime64, hours: int) -> list[set[float]]:
    """Return what the PLC showed in each hour, but for the first quarter of it."""
    log = read_telemetry(state / "store", seconds(begin), seconds(begin + hours * HOUR))
    into = log.time - begin
    return [
        {round(float(value), 3) for value in log[name][(into >= hour * HOUR + HOUR // 4) & (into < (hour + 1) * HOUR)]}
        for hour in range(hours)
    ]


def is_logged(state: Path, end: np.datetime64) -> bool:
    try:
        return len(read_telemetry(state / "store", seconds(end), 8e9)) > 0
    except StoreError:
        return False


@pytest.mark.parametrize("night", list(NIGHTS))
def test_the_day_programme_follows_the_wall_clock_through_the_night_in_which_it_changes(
    tmp_path: Path, night: str
) -> None:
    """The daemon as a process, on a machine whose own zone changes in that night."""
    begin, right = NIGHTS[night]
    extra = "bundle: null\nplanning: {enabled: false}\nrecipe:\n" + programme("irrigation_on", lambda share: share)
    plant = RunningDaemon(tmp_path, days=1, extra=extra, begin=str(begin - 2 * HOUR))
    try:
        plant.start(TZ="Europe/Amsterdam")
        plant.wait_for(lambda: is_logged(plant.state, begin + len(right) * HOUR))
        assert stood(plant.state, "irrigation_on", begin, len(right)) == [{value} for value in right]
        assert plant.stop() == 0
    finally:
        plant.close()


class PlannerBeforehand:
    """Makes the plans that it is asked for: heating a little more in each hour, CO2 by the grower's programme."""

    health, busy = "", False

    def __init__(self, site: Site) -> None:
        self.site = site
        self.plan: Plan | None = None

    def request(self, prepare: Callable[[], PlanRequest | None]) -> None:
        asked = prepare()
        if asked is None or self.plan is not None:
            return
        heating = tuple(16.0 + 0.25 * step for step in range(24))
        setpoints = {"heating_setpoint": heating, "co2_setpoint": asked.recipe["co2_setpoint"]}
        self.plan = Plan(asked.time, asked.time, asked.step_seconds, setpoints, asked.time + 86_400.0, "test")

    def latest(self) -> Plan | None:
        return self.plan

    async def wait(self, timeout: float) -> None:  # noqa: ASYNC109 - as the real one's
        return None

    def close(self) -> None:
        pass


@pytest.mark.parametrize("night", list(NIGHTS))
async def test_a_plan_is_followed_hour_by_hour_through_the_night_in_which_the_clock_changes(
    tmp_path: Path, night: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each hour of the plan is followed for an hour, and the programme that it contains by the wall clock."""
    begin, right = NIGHTS[night]
    start, port = begin - 2 * HOUR, free_port()
    path = write_files(tmp_path, port)
    text = path.read_text()
    path.write_text(text[: text.index("  co2_setpoint")] + programme("co2_setpoint", lambda share: 400 + 1000 * share))
    site = tmp_path / "site.yaml"
    free = "low: 12, high: 28, safe: 18, slew: null, minimum_interval: 0 s}\n"
    site.write_text(site.read_text() + f"  heating_setpoint: {{{free}time_zone: Europe/Amsterdam\n")
    plant = Plant(tmp_path, port, start=str(start))
    await plant.up()
    async with running(path) as daemon:
        await until(lambda: daemon.cycles >= 1)
        planner = PlannerBeforehand(daemon.configuration.site)
        await plan_at_once(daemon, planner, tmp_path)
        # A day of log is asked for before a first plan; this test has two hours of it.
        monkeypatch.setattr("igrow.edge.planning_schedule.LEAST_HISTORY", 0.0)
        control_of(daemon).keeper._latest = planner.latest
        await until(lambda: is_logged(tmp_path / "state", begin + len(right) * HOUR))
    await plant.down()
    co2 = stood(tmp_path / "state", "co2_setpoint", begin, len(right))
    assert co2 == [{round(400 + 1000 * share, 3)} for share in right]
    assert planner.plan is not None
    first = round((seconds(begin) - planner.plan.start) / 3600.0)
    heating = stood(tmp_path / "state", "heating_setpoint", begin, len(right))
    for hour, values in enumerate(heating):
        planned = 16.0 + 0.25 * (first + hour)
        # The crop's limits let it follow by thirds of an hour's step; the hour before, or after, is 0.25 away.
        assert values
        assert all(abs(value - planned) < 0.12 for value in values), f"{values} in hour {hour}, planned {planned}"
