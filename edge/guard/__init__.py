"""The guard: the only way to a write. A pure core that decides, and one writer that carries it out."""

from edge.guard.core import Clamp, GuardState, PointState, Request, Verdict, Write, guard
from edge.guard.interlocks import DEFAULT_INTERLOCKS, Bound, Interlock
from edge.guard.readback import Finding, Readback
from edge.guard.rules import GuardRules, PointRule
from edge.guard.writer import GuardedWriter, WriteOutcome

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
