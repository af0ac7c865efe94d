"""Planning in a process of its own, so that a plan that hangs, crashes or grows costs the control cycle nothing.

`GraphProcess` starts `python -m igrow.edge.planning.worker`, the one process in which graphs run; it ends a process
that takes too long and lets an idle one end by itself, so that no memory is held between calls. `PlanningProcess` asks
it for plans. `make_plan` is what the process runs for a plan: forecast, present state, optimiser, plan.
"""

from igrow.edge.planning.forecast import persistence
from igrow.edge.planning.graph_process import GraphProcess, NotCalledError, ProcessError, ProcessLimits
from igrow.edge.planning.process import PlanningProcess

__all__ = ["GraphProcess", "NotCalledError", "PlanningProcess", "ProcessError", "ProcessLimits", "persistence"]
