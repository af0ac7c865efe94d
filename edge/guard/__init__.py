"""The guard: the only way to a write. A pure core that decides, and one writer that carries it out."""

from igrow.edge.guard.core import guard
from igrow.edge.guard.findings import Finding, Hand, Outcome
from igrow.edge.guard.interlocks import DEFAULT_INTERLOCKS, Bound, Force, Interlock
from igrow.edge.guard.readback import Readback
from igrow.edge.guard.rules import GuardRules, PointRule
from igrow.edge.guard.state import Clamp, GuardState, PointState, Request, Verdict, Write
from igrow.edge.guard.writer import GuardedWriter, WriteOutcome

__all__ = [
    "DEFAULT_INTERLOCKS",
    "Bound",
    "Clamp",
    "Finding",
    "Force",
    "GuardRules",
    "GuardState",
    "GuardedWriter",
    "Hand",
    "Interlock",
    "Outcome",
    "PointRule",
    "PointState",
    "Readback",
    "Request",
    "Verdict",
    "Write",
    "WriteOutcome",
    "guard",
]
