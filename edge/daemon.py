"""The daemon's life: start without waiting for anybody, one cycle after the other, reload, stop at safe setpoints."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import Callable, Coroutine, Iterator
from concurrent.futures import Future
from datetime import UTC, datetime

from igrow.core.errors import IgrowError
from igrow.edge.alarm_levels import Level
from igrow.edge.carrying_over import carry_over, log_to_remember, remember
from igrow.edge.configuration import Configuration
from igrow.edge.cycle_result import CycleResult
from igrow.edge.earlier import Earlier
from igrow.edge.hand_off import PATIENCE, HandOff, LateError, settled
from igrow.edge.image import Quality
from igrow.edge.journal import Journal
from igrow.edge.ports import Plan
from igrow.edge.reloading import Reloading, refuse_what_needs_a_restart, same_registers
from igrow.edge.services import SIMULATED_PATIENCE, Services, open_services
from igrow.edge.snapshot import snapshot_of
from igrow.edge.state_lock import InUseError
from igrow.edge.stopping import STOP_SECONDS, StopReport
from igrow.edge.systemd_notify import SystemdNotifier
from igrow.edge.wiring import Control, build_control

LEAST_STOP = 5.0
"""Seconds that the safe setpoints get however long the cycle took to give way."""
LINE_SECONDS = 1.0
"""Longest time for a line, or the status page, to be closed."""
CLOSE_SECONDS = 15.0
"""Longest time for the services to be closed once the safe setpoints are written. What hangs is left behind."""
LOCKSTEP_WAIT = 900.0
"""Longest time, by the wall clock, that a lock-step plant is kept waiting for a plan or an update."""

log = logging.getLogger("igrow.edge")


class Daemon:
    """Runs control for one site until it is told to stop."""

    def __init__(
        self,
        configuration: Configuration,
        services: Services | None = None,
        notifier: SystemdNotifier | None = None,
        *,
        hold: Callable[[], None] = lambda: None,
    ):
        """`services` and `notifier` replace the real ones in tests.

        `hold` is called before anything is written: it raises InUseError where the state folder is another daemon's by
        now, and LateError where nobody can tell in time.
        """
        self.configuration = configuration
        self.services = services or open_services(configuration)
        self._notifier = notifier or SystemdNotifier()
        self._hold = hold
        self._journal = Journal(self.services.store)
        self._control: Control | None = None
        self._stopping = asyncio.Event()
        self._stop_by = math.inf
        self._reloading = Reloading(configuration.path)
        self._configuration_problem = ""
        self._earlier: Future[Earlier] | None = None
        self._plan: Plan | None = None
        self.cycles = 0
        self.last: CycleResult | None = None

    def stop(self) -> None:
        """End now: a cycle that is under way gives way to the safe setpoints."""
        if not self._stopping.is_set():
            self._stop_by = time.monotonic() + STOP_SECONDS
            self._stopping.set()

    def reload(self) -> None:
        """Read the configuration again; control goes on by the last good one until it is there."""
        if self._reloading.start():
            self._notifier.reloading()

    async def run(self) -> None:
        """Control until `stop`; then write the safe setpoints and close everything.

        Raises InUseError where another daemon has come by the state folder, and then the PLC and the log are its own.
        """
        self._control = self._begin(None)
        self._earlier = self.services.store.earlier(log_to_remember(self._control))
        await self.services.status.start()
        self._notifier.ready()
        self._journal.event("started", site=self.configuration.site.name)
        try:
            while await self._due():
                self._look_for_another()
                await self._unless_stopped(self._remember())
                await self._take_over_configuration()
                await self._until_told_to_stop()
        finally:
            await self._end()

    def _look_for_another(self) -> None:
        """Raise InUseError where the state folder, and so the PLC, is another daemon's by now."""
        try:
            self._hold()
        except LateError:
            pass  # its disk hangs: control comes first
        except InUseError:
            raise InUseError(
                f"{self.configuration.state_folder}: it was taken away, and another daemon has what is there now: this "
                "one ends, and leaves the PLC to the other as it stands"
            ) from None

    async def _due(self) -> bool:
        """Wait for the next cycle; tell whether there is one."""
        assert self._control is not None
        return await self._unless_stopped(self._control.pace.wait(self._notifier))

    async def _unless_stopped(self, work: Coroutine[None, None, None]) -> bool:
        """Await `work`, but not beyond a stop; tell whether it was awaited to its end."""
        task = asyncio.ensure_future(work)
        stop = asyncio.ensure_future(self._stopping.wait())
        try:
            await asyncio.wait((task, stop), return_when=asyncio.FIRST_COMPLETED)
        finally:
            for one in (task, stop):
                if not one.done():
                    one.cancel()
                    with contextlib.suppress(asyncio.CancelledError):
                        await one
        if self._stopping.is_set():
            return False
        task.result()
        return True

    async def _until_told_to_stop(self) -> None:
        """Run a cycle; one that is under way when the stop comes gives way to it."""
        assert self._control is not None
        if self._stopping.is_set():
            return
        cycle = asyncio.ensure_future(self._cycle(self._control))
        stop = asyncio.ensure_future(self._stopping.wait())
        await asyncio.wait((cycle, stop), return_when=asyncio.FIRST_COMPLETED)
        stop.cancel()
        if not cycle.done():
            self._control.cycle.give_way()
            await asyncio.wait((cycle,))
        if not cycle.cancelled():
            cycle.result()

    async def _remember(self) -> None:
        """Carry over what a restart must not forget; while its disk hangs, leave all setpoints as they stand."""
        control, earlier = self._control, self._earlier
        assert control is not None
        if earlier is None:
            if control.clock.monotonic() >= control.cycle.unknown_until:
                self._journal.alarm("memory", "")
            return
        if self.cycles == 0:
            patience = SIMULATED_PATIENCE if control.lockstep else PATIENCE
            await settled(earlier, patience)
        if not earlier.done():
            text = "what was set by hand before the start cannot be read yet, so all setpoints are left as they stand"
            self._leave_all_alone(control, text)
            return
        self._earlier = None
        try:
            remember(control, earlier.result())
        except IgrowError as error:
            self._leave_all_alone(
                control,
                f"what was set by hand before the start cannot be read ({error}), so all setpoints are left as they "
                "stand",
            )
        except Exception:
            text = "what was noted before the start makes no sense, so all setpoints are left as they stand"
            log.exception("%s", text)
            self._leave_all_alone(control, text)
        else:
            control.cycle.unknown_until = -math.inf
            self._journal.alarm("memory", "")

    def _leave_all_alone(self, control: Control, text: str) -> None:
        """Keep all setpoints where they stand, for as long as a hand before the start may have to be respected."""
        if control.cycle.unknown_until == -math.inf:
            respected = control.configuration.file.cycle.respect_hand.total_seconds()
            control.cycle.unknown_until = control.clock.monotonic() + respected
        self._journal.alarm("memory", text)

    async def _cycle(self, control: Control) -> None:
        result = await control.cycle.run()
        self.last = result
        self.cycles += 1
        image = result.image
        other = image.value_of("plc_clock")
        if other.quality is Quality.GOOD and other.value is not None:
            control.clock.witness(other.value)
        self._journal.alarm("clock", control.clock.doubt)
        with self._contained("alarms"):
            control.climate_alarms.tick(image, self._journal.alarm)
            control.acknowledged.look()
        with self._contained("separating tests"):
            control.separating_tests.tick(result, self._journal.alarms.active)
        with self._contained("updates"):
            self.services.updates.tick(image.true_time)
            self._journal.alarm("simulator", self.services.updates.worsening, Level.NOTICE)
            if control.lockstep and self.services.updates.busy:
                await self._unless_stopped(self.services.updates.wait(LOCKSTEP_WAIT))
        with self._contained("exchange"):
            if self.services.exchange is not None:
                self.services.exchange.tick(image.true_time)
        with self._contained("planning"):
            await self._plan_ahead(control, result)
        with self._contained("status"):
            problems = (self._configuration_problem,)
            snapshot = snapshot_of(control, result, self.services, self._journal, self.cycles, problems)
            self.services.status.publish(snapshot)
        self._notifier.cycle_completed(f"{result.decision.source}: {result.decision.why}")

    @contextlib.contextmanager
    def _contained(self, service: str) -> Iterator[None]:
        """Keep a fault of ours in a service that control can do without from ending control."""
        try:
            yield
        except Exception as error:
            text = f"{service} failed: {type(error).__name__}: {error}"
            if all(alarm.name != f"service {service}" for alarm in self._journal.alarms.active):
                log.exception("%s", text)
            self._journal.alarm(f"service {service}", text)
        else:
            self._journal.alarm(f"service {service}", "")

    async def _plan_ahead(self, control: Control, result: CycleResult) -> None:
        planning, schedule = self.services.planning, control.schedule
        if planning is None or schedule is None:
            return
        asked = schedule.tick(result.image, self.services.updates.active())
        if asked and control.lockstep:
            await self._unless_stopped(planning.wait(LOCKSTEP_WAIT))
        self._journal.alarm("planning", planning.health, Level.NOTICE)
        if planning.health and not planning.busy:
            schedule.retry_soon(result.image.monotonic)
        plan = planning.latest()
        if plan is not None and plan is not self._plan:
            self._plan = plan
            self._journal.event(
                "plan",
                start=datetime.fromtimestamp(plan.start, UTC).isoformat(),
                bundle=plan.bundle,
                expected_profit=plan.expected_profit,
                recipe_profit=plan.recipe_profit,
                co2_before=plan.co2_before,
                leaves_range=plan.leaves_range,
                note=plan.note,
            )

    def _begin(self, before: Control | None) -> Control:
        control = build_control(
            self.configuration,
            self.services,
            self._journal,
            clock=before.clock if before else None,
            plc=before.plc if before and same_registers(before.configuration, self.configuration) else None,
        )
        if before is not None:
            carry_over(control, before)
        if before is None or control.plc is not before.plc:
            control.plc.start()
        return control

    async def _take_over_configuration(self) -> None:
        """Go on by a configuration that was read since the last cycle, if there is one."""
        before = self._control
        assert before is not None
        try:
            configuration = self._reloading.take()
            if configuration is None:
                return
            refuse_what_needs_a_restart(self.configuration, configuration)
        except (IgrowError, OSError) as error:
            self._configuration_problem = f"the new configuration is not used: {error}"
            self._journal.event("reload_refused", reason=str(error))
        else:
            self.configuration = configuration
            self._configuration_problem = ""
            self._control = self._begin(before)
            if self.services.planning is not None:
                self.services.planning.site = configuration.site
            if self._control.plc is not before.plc:
                await before.plc.close()
            self._journal.event("reloaded", path=str(configuration.path))
        self._notifier.ready()

    async def _end(self) -> None:
        """Write the safe setpoints, whatever hangs; then let go of everything, each in its time."""
        self._notifier.stopping()
        control = self._control
        assert control is not None
        try:
            self._look_for_another()
        except InUseError:
            # Neither the setpoints nor the files are ours any more.
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(control.plc.close(), LINE_SECONDS)
            self.services.graphs.close()
            raise
        report = StopReport(seen=False)
        try:
            control.plc.last_orders()
            report = await control.cycle.stop(min(max(LEAST_STOP, self._stop_by - time.monotonic()), STOP_SECONDS))
        finally:
            self._journal.event("stopped", setpoints=report.words())
            self._reloading.close()
            for closing in (control.plc.close(), self.services.status.close()):
                with contextlib.suppress(TimeoutError):
                    await asyncio.wait_for(closing, LINE_SECONDS)
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(HandOff("closing").run(self.services.close), CLOSE_SECONDS)
            self._notifier.close()
