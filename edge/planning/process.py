"""The daemon's side of planning: `igrow.edge.ports.PlanningService`."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Future

from igrow.core.errors import IgrowError
from igrow.core.site import Site
from igrow.edge.hand_off import HandOff, settled
from igrow.edge.planning.graph_process import GraphProcess
from igrow.edge.ports import Plan, PlanRequest

CLOSE_SECONDS = 2.0
"""How long a plan that is being made is waited for at the stop, after its process was ended."""

_log = logging.getLogger("igrow.edge.planning")


class PlanningProcess:
    """Makes plans aside, in the process for graphs; never raises, `health` tells."""

    def __init__(
        self,
        site: Site,
        graphs: GraphProcess,
        *,
        seconds: float = 600.0,
        planner: str = "igrow.edge.planning.make_plan:make_plan",
    ) -> None:
        """`planner` names the function (site, request) -> Plan that is called; it may take so many `seconds`."""
        self.site = site
        """For which the next plan is made; a reload may change it."""
        self._graphs = graphs
        self._seconds = seconds
        self._planner = planner
        self._aside = HandOff("planning")
        self._task: Future[None] | None = None
        self._latest: Plan | None = None
        self._problem = ""
        self._closed = False

    def request(self, prepare: Callable[[], PlanRequest | None]) -> None:
        """Start to make a plan; when one is being made already, do nothing. Never blocks."""
        if not self.busy and not self._closed:
            self._task = self._aside.post(lambda: self._make(prepare))

    def latest(self) -> Plan | None:
        """Return the newest finished plan, or None."""
        return self._latest

    @property
    def busy(self) -> bool:
        """A plan is being made."""
        return self._task is not None and not self._task.done()

    @property
    def health(self) -> str:
        """Empty when all is well, else one line."""
        return self._problem

    async def wait(self, timeout: float) -> None:  # noqa: ASYNC109  # the signature is igrow.edge.ports.PlanningService's
        """Return when no plan is being made any more, or after `timeout` seconds of wall clock."""
        if self._task is not None:
            await settled(self._task, timeout)

    def close(self) -> None:
        """End the process and its thread; a thread that hangs is left behind."""
        self._closed = True
        self._graphs.close()
        self._aside.close(CLOSE_SECONDS)

    def _make(self, prepare: Callable[[], PlanRequest | None]) -> None:
        """Gather what a plan is made from, and ask the process for it (in the thread)."""
        try:
            request = prepare()
            if request is not None:
                self._latest = self._graphs.call(self._planner, self.site, request, seconds=self._seconds)
        except (IgrowError, OSError) as error:
            if self._closed:
                return
            self._problem = f"planning: no plan was made: {error}"
            _log.warning("%s", self._problem)
        except Exception as error:
            self._problem = f"planning: no plan was made: {type(error).__name__}: {error}"
            _log.exception("%s", self._problem)
        else:
            self._problem = ""
