"""Asks a running daemon for its state, over its status port or from the file that it leaves."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.edge.state_file import read_state

STATUS_FILE = "status.json"
"""In the state folder."""
TIMEOUT = 5.0
_MOST_BYTES = 16 * 2**20


def fetch(port: int) -> dict[str, Any]:
    """Return the daemon's state; raises IgrowError when nobody answers."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/state.json", timeout=TIMEOUT) as answer:
            return dict(json.loads(answer.read(_MOST_BYTES)))
    except urllib.error.HTTPError as error:
        raise IgrowError(f"the daemon on port {port} says: {error.read().decode().strip()}") from None
    except (OSError, ValueError):
        raise IgrowError(f"no daemon answers on port {port} of this machine; is igrow-edge running?") from None


def last_port(path: Path) -> int:
    """Return the port that a daemon has left in its file; 0, which nobody answers on, without one."""
    port = read_state(path).get("port")
    return port if isinstance(port, int) else 0


def last_state(path: Path) -> dict[str, Any] | None:
    """Return the state that a daemon has left in its file, or None."""
    left = read_state(path).get("state")
    return left if isinstance(left, dict) else None
