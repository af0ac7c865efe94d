"""What the daemon does and why, for programs: health, metrics, and the state that `igrow-edge status` prints.

Read-only, on localhost, without a framework: the cycle publishes one snapshot, and it is put into words when somebody
asks. People look at the page (`igrow.edge.page`), which is a process of its own and asks here too.
"""

from igrow.edge.status.server import StatusServer

__all__ = ["StatusServer"]
