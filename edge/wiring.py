"""Puts together what controls a site, which a reload replaces; what outlives it, `igrow.edge.services`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

from igrow.core.agronomy import Place
from igrow.core.sun import position
from igrow.edge.bus.plc import RegisterPlc
from igrow.edge.climate_alarms import ClimateAlarms, usual_climate_alarms
from igrow.edge.clock import Clock, PlcClock, SystemClock
from igrow.edge.configuration import Configuration
from igrow.edge.cycle import ControlCycle
from igrow.edge.daemon_file import ClockSource
from igrow.edge.guard import GuardedWriter, Readback
from igrow.edge.guard.heartbeat import HEARTBEAT
from igrow.edge.guard.point_memory import PointMemory
from igrow.edge.journal import Journal
from igrow.edge.moment import this_boot
from igrow.edge.notifications.acknowledged import ACKNOWLEDGED_FILE, AcknowledgementWatch
from igrow.edge.overriding import override_file
from igrow.edge.pace import FollowedPlant, Pace, TickPace
from igrow.edge.planning_schedule import PlanningRules, PlanningSchedule
from igrow.edge.point_rules import highest_beat
from igrow.edge.ports import Plan
from igrow.edge.registers.look_alikes import look_alikes
from igrow.edge.registers.model import TWIN_SUFFIX
from igrow.edge.remembering import StateNotes, registers_of
from igrow.edge.sensors import ImageBuilder, TwinSensors
from igrow.edge.separating_tests import SeparatingTests, approval_file, possible
from igrow.edge.separating_tests.possible import conditions_of
from igrow.edge.services import Services
from igrow.edge.sources import (
    FreshPlan,
    GrowerOverride,
    HandsOff,
    LastValidPlan,
    PlanKeeper,
    RecipeSource,
    WantedRecipe,
)
from igrow.edge.state_file import StateFile

TWIN_TOLERANCE = {
    "air_temperature": 1.5,
    "air_humidity": 8.0,
    "air_co2": 100.0,
    "outdoor_temperature": 2.0,
    "outdoor_humidity": 10.0,
    "wind_speed": 5.0,
}
"""Largest difference of two working sensors of one quantity, in its unit."""
FALLBACK_CYCLES = 3.0
"""A PLC's heartbeat timeout is longer than this many cycles (docs/commissioning.md)."""


@dataclass
class Control:
    """What a reload replaces."""

    configuration: Configuration
    plc: RegisterPlc
    clock: Clock
    pace: Pace
    cycle: ControlCycle
    keeper: PlanKeeper
    schedule: PlanningSchedule | None
    notes: StateNotes
    boot: str
    """Names this start of the machine; empty where the plant's clock and not the machine's is followed."""
    climate_alarms: ClimateAlarms
    acknowledged: AcknowledgementWatch
    override: GrowerOverride
    separating_tests: SeparatingTests
    left_out: dict[str, tuple[str, PointMemory]] = field(default_factory=dict)
    """What is known of points that a reload has left out, with the register of each: another may bring them back."""

    @property
    def lockstep(self) -> bool:
        """The plant waits for us, so we may wait for plans and updates."""
        return self.configuration.file.cycle.clock is ClockSource.LOCKSTEP


def build_control(
    configuration: Configuration,
    services: Services,
    journal: Journal,
    *,
    clock: Clock | None = None,
    plc: RegisterPlc | None = None,
) -> Control:
    """Build what runs the cycles; connects nothing yet.

    `clock` and, where the registers are the same, `plc` come from before a reload.
    """
    file, site, rules = configuration.file, configuration.site, configuration.guard_rules
    register_map = configuration.register_map
    interval = file.cycle.interval.total_seconds()
    respect_hand = file.cycle.respect_hand.total_seconds()
    plc = plc or RegisterPlc(register_map, others_asked=True)
    readable: RegisterPlc | FollowedPlant = plc
    pace: Pace
    if file.cycle.clock is ClockSource.SYSTEM:
        clock = clock or SystemClock()
        pace = TickPace(interval)
    else:
        # A reload must not begin the plant's time again, as the guard's memory is dated by it.
        clock = clock if isinstance(clock, PlcClock) else PlcClock()
        lockstep = file.cycle.clock is ClockSource.LOCKSTEP
        readable = pace = FollowedPlant(plc, clock, names=register_map.points, interval=interval, lockstep=lockstep)
    keeper = PlanKeeper(services.planning.latest if services.planning is not None else _no_plan)
    every = site.planning.replan_every.total_seconds()
    units = {name: point.device for name, point in register_map.points.items()}
    boot = this_boot() if isinstance(clock, SystemClock) else ""
    remembered = [name for name in (*rules.points, HEARTBEAT) if name in register_map.points]
    notes = StateNotes(services.store, boot, registers_of(register_map, remembered))
    heartbeat = register_map.points.get(HEARTBEAT)
    override = GrowerOverride(
        StateFile(override_file(configuration.state_folder), services.state_files), boot, journal.event
    )
    tests = _separating_tests(configuration, services, boot, journal)
    recipe = RecipeSource(file.recipe, configuration.zone)
    hands_off = HandsOff({name: rules.points[name].safe for name in configuration.setpoints})
    cycle = ControlCycle(
        readable,
        clock,
        ImageBuilder(
            configuration.sensor_rules, _twins(configuration), sun_elevation(site.latitude, site.longitude), units
        ),
        [
            override,
            tests,
            WantedRecipe(override, recipe, hands_off),
            FreshPlan(keeper, fresh_for=1.5 * every),
            LastValidPlan(keeper),
            recipe,
            hands_off,
        ],
        rules,
        Readback(
            rules.points,
            confirm_within=max(file.cycle.confirm_within.total_seconds(), 3.0 * interval),
            respect_hand=respect_hand,
            silence=FALLBACK_CYCLES * interval,
            units=units,
            look_alikes=look_alikes(register_map, configuration.setpoints),
        ),
        GuardedWriter(
            plc, has_heartbeat=heartbeat is not None, highest_beat=highest_beat(heartbeat) if heartbeat else 1
        ),
        journal,
        setpoints=configuration.setpoints,
        respect_hand=respect_hand,
        marks_tests=file.separating_tests.permitted,
        keep=notes.keep,
        interval=interval,
    )
    return Control(
        configuration, plc, clock, pace, cycle, keeper, _schedule(configuration, services), notes, boot,
        ClimateAlarms(usual_climate_alarms(site.crop) if file.climate_alarms is None else file.climate_alarms),
        AcknowledgementWatch(
            StateFile(configuration.state_folder / ACKNOWLEDGED_FILE, services.state_files), journal.event
        ),
        override,
        tests,
    )  # fmt: skip


def _separating_tests(configuration: Configuration, services: Services, boot: str, journal: Journal) -> SeparatingTests:
    found = possible(configuration)
    return SeparatingTests(
        StateFile(approval_file(configuration.state_folder), services.state_files),
        found,
        {name: conditions_of(test, configuration.site) for name, test in found.items()},
        configuration.setpoints,
        Place.of(configuration.site),
        boot,
        journal.event,
    )


def _schedule(configuration: Configuration, services: Services) -> PlanningSchedule | None:
    if services.planning is None:
        return None
    settings, site = configuration.file.planning, configuration.site
    rules = PlanningRules(
        every=min(site.planning.replan_every, site.planning.horizon).total_seconds(),
        horizon=site.planning.horizon.total_seconds(),
        step=settings.step.total_seconds(),
        history=settings.history.total_seconds(),
        seed=settings.seed,
        forecast=configuration.forecast_file,
    )
    return PlanningSchedule(rules, services.planning, services.store, configuration.file.recipe, configuration.zone)


def _twins(configuration: Configuration) -> list[TwinSensors]:
    points = configuration.register_map.points
    return [
        TwinSensors(name, name + TWIN_SUFFIX, tolerance)
        for name, tolerance in TWIN_TOLERANCE.items()
        if name in points and name + TWIN_SUFFIX in points
    ]


def sun_elevation(latitude: float, longitude: float) -> Callable[[float], float]:
    """Return a function from seconds since 1970 UTC to the sun's elevation in degrees."""
    return lambda time: float(position(math, time, latitude, longitude)[0])


def _no_plan() -> Plan | None:
    return None
