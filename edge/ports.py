"""What the control cycle needs from the rest of the gateway, as Protocols, and what they hand over.

The cycle is written against this file alone (and `igrow.edge.bus.plc` for the PLC). The store, the planning process,
the bundle updates and the status page implement it; tests implement it with a few lines each.

Times: `time` is seconds since 1970 UTC, or None while the clock cannot be trusted (`clock_ok` is false); a record
without a time keeps its order. `monotonic` is seconds on the daemon's own clock. None of these calls may hold the
cycle, whatever disk, share, graph or network hangs behind it (`igrow.edge.hand_off`); LateError says that there is
nothing yet.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from igrow.core.co2_count import CO2Count
from igrow.core.site import Site
from igrow.core.telemetry import Telemetry
from igrow.edge.image import Value
from igrow.edge.records import AlarmRecord, WriteRecord

if TYPE_CHECKING:
    from igrow.core.planner.explain import Explanation
    from igrow.edge.earlier import Earlier

# --- store ----------------------------------------------------------------------------------------------------


class Store(Protocol):
    """The gateway's memory. It never raises for a full disk or a corrupt file: it reports itself by `health`."""

    def append(self, time: float, values: Mapping[str, Value]) -> None:
        """Add one row of telemetry (batched; at most the last batch is lost by a power cut)."""

    def record_event(self, time: float | None, kind: str, detail: Mapping[str, object]) -> None:
        """Add one event, durably, before returning."""

    def record_write(self, record: WriteRecord) -> None:
        """Add one row to the ledger of writes and clamps.

        Rows with outcome "written" are durable before this returns, as daily write budgets are counted from them.
        """

    def record_alarm(self, record: AlarmRecord) -> None:
        """Add one alarm row, durably, before returning."""

    def earlier(self, log_seconds: float) -> Future[Earlier]:
        """Begin to read what an earlier run has left, with so much of its log. Never blocks."""

    def record_state(self, time: float | None, content: Mapping[str, object]) -> None:
        """Add what control must know again after a restart, durably, before returning; the newest counts."""

    def telemetry(self, start: float, end: float) -> Telemetry:
        """Return the stored values with quality good in [start, end), seconds since 1970 UTC; others are NaN.

        Raises LateError and StoreError; it may take long, so this one is not for the control cycle.
        """

    def newest_event(self, kind: str) -> Mapping[str, Any] | None:
        """Return the detail of the newest event of one kind, None where there is none.

        Raises StoreError; it may take long, so this one is not for the control cycle.
        """

    @property
    def health(self) -> str:
        """Empty when all is well, else one line that says what is not."""

    def close(self) -> None:
        """Commit what is held and close."""


# --- planning -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PlanRequest:
    """Everything that a plan is made from."""

    time: float
    """Start of the plan, seconds since 1970 UTC."""
    step_seconds: float
    """Length of one step of the plan and of `recipe`."""
    telemetry: Telemetry
    """The log of the last days, up to now: `time` may lie a little ahead."""
    recipe: Mapping[str, tuple[float, ...]]
    """What the grower's recipe would command over the horizon, by setpoint: (steps,)."""
    bundle: Path
    """Folder of the bundle in force."""
    forecast: Path | None = None
    """File with the weather over the horizon; without one, or while it cannot be read, that of the last days."""
    seed: int = 0
    co2_counted: CO2Count | None = None
    """What the crop had had of CO2 when the plan before this one began; None before the first."""


@dataclass(frozen=True)
class Plan:
    """Setpoints over the horizon, and what they are expected to bring."""

    created: float
    """Seconds since 1970 UTC."""
    start: float
    """Seconds since 1970 UTC at which the first step begins."""
    step_seconds: float
    setpoints: Mapping[str, tuple[float, ...]]
    """By setpoint: (steps,) in the quantity's unit."""
    valid_until: float
    """Seconds since 1970 UTC after which nobody may follow this plan."""
    bundle: str
    """Name of the bundle whose simulator made it."""
    expected_profit: float = float("nan")
    """EUR m-2 over the horizon, by the bundle's simulator."""
    recipe_profit: float = float("nan")
    """EUR m-2 over the horizon if the recipe were followed, by the same simulator."""
    co2_before: float = 0.0
    """kg m-2 of CO2 that the crop has probably had when the plan begins, which decides on its price."""
    leaves_range: bool = False
    """The plan visits states or actions that the simulator was not trained on."""
    note: str = ""
    """For the grower: that it follows the recipe, which limits of the crop bind, what is not known of growth."""
    problem: str = ""
    """One line on what it had to be made without; empty when all was there."""
    predicted: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """By quantity: the expected course at the end of each step, (steps,)."""
    binding: Mapping[str, tuple[tuple[str, ...], ...]] = field(default_factory=dict)
    """By setpoint and step: the crop's limits that kept it from what the search asked for, (steps,)."""
    explanation: Explanation | None = None
    """What the plan is expected to bring over its horizon, and what each change is for."""
    season: tuple[str, ...] = ()
    """What the season says of the plan's day, in sentences; empty where the bundle carries none."""


class PlanningService(Protocol):
    """Planning in a process of its own: a plan that hangs, crashes or grows costs the cycle nothing."""

    site: Site
    """For which the next plan is made; a reload may change it."""

    def request(self, prepare: Callable[[], PlanRequest | None]) -> None:
        """Start to make a plan; when one is being made already, do nothing. Never blocks.

        `prepare` is called aside and may read disks; with None from it there is no plan to be made.
        """

    def latest(self) -> Plan | None:
        """Return the newest finished plan, or None."""

    @property
    def busy(self) -> bool:
        """A plan is being made."""

    @property
    def health(self) -> str:
        """Empty when all is well, else one line (the last plan timed out, crashed, ...)."""

    async def wait(self, timeout: float) -> None:  # noqa: ASYNC109 - it ends quietly, it does not cancel
        """Return when no plan is being made any more, or after `timeout` seconds of wall clock.

        Only for plants that wait for us (lock-step): a real greenhouse never waits for a plan.
        """

    def close(self) -> None:
        """End the process."""


# --- bundles --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ActiveBundle:
    """The bundle in force."""

    name: str
    folder: Path


class UpdateService(Protocol):
    """Fetches, verifies, shadows, adopts and takes back bundles."""

    def active(self) -> ActiveBundle | None:
        """Return the bundle in force; None when the gateway has none (the recipe then rules)."""

    def tick(self, time: float | None) -> None:
        """Do what is due at this time (called once in each cycle); long work runs in a thread. Never blocks.

        `time` None means that the clock cannot be trusted: nothing that expires may be accepted.
        """

    @property
    def health(self) -> str:
        """Empty when all is well, else one line."""

    @property
    def worsening(self) -> str:
        """Empty, or one line that says since when the bundle in force predicts worse than it did."""

    @property
    def busy(self) -> bool:
        """A check, a self-test or a shadow run is under way."""

    async def wait(self, timeout: float) -> None:  # noqa: ASYNC109 - it ends quietly, it does not cancel
        """Return when not busy, or after `timeout` seconds of wall clock; only for lock-step plants."""

    def describe(self) -> Mapping[str, object]:
        """Return what the status page and `igrow-edge status` show: bundle, candidate, live errors, last verdict."""

    def close(self) -> None:
        """Stop."""


class Exchange(Protocol):
    """Where finished day segments of telemetry go and where reports are left for the trainer."""

    def tick(self, time: float | None) -> None:
        """Publish the day segments that are complete at `time`; long work runs in a thread. Never blocks."""

    @property
    def health(self) -> str:
        """Empty when all is well, else one line (the folder cannot be written, ...)."""

    def close(self) -> None:
        """Publish what is left and stop."""


# --- status ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class SetpointStatus:
    """One setpoint as the page shows it."""

    requested: float | None
    applied: float | None
    """What we last wrote."""
    shown: float | None
    """What the PLC shows now."""
    source: str
    why: str
    held_until: float | None = None
    """Monotonic seconds until which a change by hand at the PLC is respected; None when there is none."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything the status page, the health endpoint and the metrics show; made once in each cycle, never changed."""

    site: str
    time: float | None
    monotonic: float
    clock_ok: bool
    cycle: int
    """Number of completed cycles since the start."""
    cycle_seconds: float
    """Wall-clock length of the last cycle's own work."""
    link_ok: bool
    source: str
    """The source that decides most setpoints now."""
    why: str
    """One line: why this source and not the one before it in the order."""
    values: Mapping[str, Value]
    setpoints: Mapping[str, SetpointStatus]
    clamps: Sequence[WriteRecord] = ()
    """The newest clamps, newest first."""
    alarms: Sequence[AlarmRecord] = ()
    """Alarms that are active now."""
    plan: Plan | None = None
    bundle: Mapping[str, object] = field(default_factory=dict)
    """From `UpdateService.describe`."""
    problems: Sequence[str] = ()
    """One line for each service that reports itself unwell (store, planning, exchange, configuration)."""
    separating_test: Mapping[str, object] = field(default_factory=dict)
    """The separating test that was approved last, and how it stands; from `SeparatingTests.describe`."""
    writes_left: Mapping[str, int] = field(default_factory=dict)
    """For each register with a daily budget: writes left in the running 24 h."""


class StatusService(Protocol):
    """The page, the health endpoint, the metrics and the state file on localhost."""

    @property
    def health(self) -> str:
        """Empty when all is well, else one line."""

    async def start(self) -> None:
        """Begin to listen; a port that is taken is a problem to report, not a reason to stop."""

    def publish(self, snapshot: Snapshot) -> None:
        """Take the newest snapshot. Never blocks; rendering happens when somebody asks."""

    async def close(self) -> None:
        """Stop listening."""
