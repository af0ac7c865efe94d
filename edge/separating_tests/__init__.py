"""Separating tests at the plant: who approved one, whether this site can run it, and its run."""

from igrow.edge.separating_tests.approval import Approval, approval_file, approve, read_approval, withdraw
from igrow.edge.separating_tests.possible import obstacles, possible
from igrow.edge.separating_tests.runner import SeparatingTests

__all__ = [
    "Approval",
    "SeparatingTests",
    "approval_file",
    "approve",
    "obstacles",
    "possible",
    "read_approval",
    "withdraw",
]
