"""What the daemon does and why: a page, health, metrics, and the state that `igrow-edge status` prints.

Read-only, on localhost, without a framework: the cycle publishes one snapshot, and it is rendered when somebody
asks. To look at it from elsewhere, forward the port: `ssh -L 8420:localhost:8420 gateway`.
"""

from igrow.edge.status.server import StatusServer

__all__ = ["StatusServer"]
