"""The guard: the only way to a write. A pure core that decides, and one writer that carries it out."""

from igrow.edge.guard.core import Clamp, GuardState, PointState, Request, Verdict, Write, guard
from igrow.edge.guard.interlocks import DEFAULT_INTERLOCKS, Bound, Interlock
from igrow.edge.guard.readback import Finding, Readback
from igrow.edge.guard.rules import GuardRules, PointRule
from igrow.edge.guard.writer import GuardedWriter, WriteOutcome

__all__ = [
    "DEFAULT_INTERLOCKS",
    "Bound",
    "Clamp",
    "Finding",
    "GuardRules",
    "GuardState",
    "GuardedWriter",
    "Interlock",
    "PointRule",
    "PointState",
    "Readback",
    "Request",
    "Verdict",
    "Write",
    "WriteOutcome",
    "guard",
]
