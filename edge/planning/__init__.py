"""Planning in a process of its own, so that a plan that hangs, crashes or grows costs the control cycle nothing.

`PlanningProcess` starts `python -m igrow.edge.planning.worker`, hands it one request at a time and takes the plan
back; it ends a process that takes too long and lets an idle one end by itself, so that no memory is held
between plans. `make_plan` is what the process runs: forecast, present state, optimiser, plan.
"""

from igrow.edge.planning.forecast import persistence
from igrow.edge.planning.process import PlanningProcess, ProcessLimits

__all__ = ["PlanningProcess", "ProcessLimits", "persistence"]
