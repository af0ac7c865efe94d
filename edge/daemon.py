"""The daemon's life: start without waiting for anybody, one cycle after the other, reload, stop at safe setpoints."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
from collections.abc import Coroutine, Iterator
from datetime import UTC, datetime
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge.configuration import Configuration, load_configuration
from igrow.edge.cycle import CycleResult, StopReport
from igrow.edge.journal import Journal
from igrow.edge.notify import Notifier
from igrow.edge.ports import Plan, Snapshot
from igrow.edge.state_lock import sole_use
from igrow.edge.wiring import Control, Services, build_control, carry_over, open_services, remember

STOP_SECONDS = 5.0
"""Longest time that the safe setpoints may take on the way out."""
LOCKSTEP_WAIT = 900.0
"""Longest time, by the wall clock, that a lock-step plant is kept waiting for a plan or an update."""

log = logging.getLogger("igrow.edge")


class Daemon:
    """Runs control for one site until it is told to stop."""

    def __init__(
        self, configuration: Configuration, services: Services | None = None, notifier: Notifier | None = None
    ):
        """`services` and `notifier` replace the real ones in tests."""
        self.configuration = configuration
        self.services = services or open_services(configuration)
        self._notifier = notifier or Notifier()
        self._journal = Journal(self.services.store)
        self._control: Control | None = None
        self._stopping = asyncio.Event()
        self._reload = False
        self._configuration_problem = ""
        self._plan: Plan | None = None
        self.cycles = 0
        self.last: CycleResult | None = None

    def stop(self) -> None:
        """End after the present cycle."""
        self._stopping.set()

    def reload(self) -> None:
        """Read the configuration again before the next cycle."""
        self._reload = True

    async def run(self) -> None:
        """Control until `stop`; then write the safe setpoints and close everything."""
        self._control = self._begin(None)
        await self.services.status.start()
        self._notifier.ready()
        self._journal.event("started", site=self.configuration.site.name)
        try:
            remembered = False
            while await self._due():
                if not remembered:
                    remember(self._control, self.services.store)
                    remembered = True
                if self._reload:
                    await self._reload_now()
                await self._cycle()
        finally:
            await self._end()

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

    async def _cycle(self) -> None:
        control = self._control
        assert control is not None
        result = await control.cycle.run()
        self.last = result
        self.cycles += 1
        image = result.image
        with self._contained("climate alarms"):
            control.climate_alarms.tick(image, self._journal.alarm)
        with self._contained("updates"):
            self.services.updates.tick(image.true_time)
            if control.lockstep and self.services.updates.busy:
                await self._unless_stopped(self.services.updates.wait(LOCKSTEP_WAIT))
        with self._contained("exchange"):
            if self.services.exchange is not None:
                self.services.exchange.tick(image.true_time)
        with self._contained("planning"):
            await self._plan_ahead(control, result)
        with self._contained("status"):
            self.services.status.publish(self._snapshot(control, result))
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
        asked = await schedule.tick(result.image, self.services.updates.active())
        if asked and control.lockstep:
            await self._unless_stopped(planning.wait(LOCKSTEP_WAIT))
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
                leaves_range=plan.leaves_range,
                note=plan.note,
            )

    def _begin(self, before: Control | None) -> Control:
        control = build_control(
            self.configuration,
            self.services,
            self._journal,
            clock=before.clock if before else None,
            plc=before.plc if before and _same_registers(before.configuration, self.configuration) else None,
        )
        if before is not None:
            carry_over(control, before)
        if before is None or control.plc is not before.plc:
            control.plc.start()
        return control

    async def _reload_now(self) -> None:
        self._reload = False
        before = self._control
        assert before is not None
        self._notifier.reloading()
        try:
            configuration = load_configuration(self.configuration.path)
            _refuse_what_needs_a_restart(self.configuration, configuration)
        except (IgrowError, OSError) as error:
            self._configuration_problem = f"the new configuration is not used: {error}"
            self._journal.event("reload_refused", reason=str(error))
        else:
            self.configuration = configuration
            self._configuration_problem = ""
            self._control = self._begin(before)
            if self._control.plc is not before.plc:
                await before.plc.close()
            self._journal.event("reloaded", path=str(configuration.path))
        self._notifier.ready()

    async def _end(self) -> None:
        self._notifier.stopping()
        control = self._control
        assert control is not None
        try:
            report = await asyncio.wait_for(control.cycle.stop(), STOP_SECONDS)
        except TimeoutError:
            report = None
        try:
            self._journal.event("stopped", setpoints=_left(report))
        finally:
            await control.plc.close()
            await self.services.status.close()
            await asyncio.to_thread(self.services.close)
            self._notifier.close()

    def _snapshot(self, control: Control, result: CycleResult) -> Snapshot:
        image, services, schedule = result.image, self.services, control.schedule
        problems = [
            services.store.health,
            services.planning.health if services.planning is not None else "",
            schedule.problem if schedule is not None else "",
            services.exchange.health if services.exchange is not None else "",
            services.status.health,
            self._configuration_problem,
        ]
        rules, points = control.configuration.guard_rules.points, control.cycle.state.points
        return Snapshot(
            site=control.configuration.site.name,
            time=image.true_time,
            monotonic=image.monotonic,
            clock_ok=image.true_time is not None,
            cycle=self.cycles,
            cycle_seconds=result.seconds,
            link_ok=image.link_ok,
            source=result.decision.source,
            why=result.decision.why,
            values=image.values,
            setpoints=result.setpoints,
            clamps=tuple(self._journal.clamps),
            alarms=self._journal.alarms.active,
            plan=control.keeper.plan,
            bundle=services.updates.describe(),
            problems=tuple(filter(None, problems)),
            writes_left={
                name: rule.daily_budget - len(points[name].budget)
                for name, rule in rules.items()
                if rule.daily_budget is not None and name in points
            },
        )


def _left(report: StopReport | None) -> str:
    """Return in words how the setpoints were left."""
    if report is None or not report.reached:
        return "the PLC does not answer, so its own safe setpoints rule after its timeout"
    if report.manual:
        return "nothing was written, as somebody operates the PLC by hand"
    if report.by_hand:
        return f"the safe setpoints were written, but for {', '.join(report.by_hand)}, which a hand has set"
    return "the safe setpoints were written"


def _same_registers(old: Configuration, new: Configuration) -> bool:
    return old.register_map == new.register_map


def _refuse_what_needs_a_restart(old: Configuration, new: Configuration) -> None:
    """Raise IgrowError for a change that a running daemon cannot take."""
    for what, before, after in (
        ("the site's name", old.site.name, new.site.name),
        ("state", old.state_folder, new.state_folder),
        ("exchange", old.exchange, new.exchange),
        ("transfer", old.file.transfer, new.file.transfer),
        ("status.port", old.file.status.port, new.file.status.port),
        ("cycle.clock", old.file.cycle.clock, new.file.cycle.clock),
    ):
        if before != after:
            raise IgrowError(f"{new.path}: {what} changed from {before} to {after}, which needs a restart")


async def run_daemon(path: Path) -> None:
    """Run until SIGTERM or SIGINT; SIGHUP reads the configuration again.

    Raises IgrowError for a bad configuration, and where another daemon has the same state folder.
    """
    configuration = load_configuration(path)
    with sole_use(configuration.state_folder):
        daemon = Daemon(configuration)
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):
            loop.add_signal_handler(number, daemon.stop)
        loop.add_signal_handler(signal.SIGHUP, daemon.reload)
        await daemon.run()
