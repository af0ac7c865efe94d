"""Asks a running daemon for its state, over its status port or from the file that it leaves."""

from __future__ import annotations

import http.client
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from igrow.core.errors import IgrowError
from igrow.core.exchange.documents import LARGEST_DOCUMENT, parse_object
from igrow.edge.state_file import read_state

STATUS_FILE = "status.json"
"""In the state folder."""
TIMEOUT = 5.0


def fetch(port: int) -> dict[str, Any]:
    """Return the daemon's state; raises IgrowError when nobody answers."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/state.json", timeout=TIMEOUT) as answer:
            state = parse_object(answer.read(LARGEST_DOCUMENT + 1), f"port {port} of this machine")
    except urllib.error.HTTPError as error:
        raise IgrowError(f"the daemon on port {port} says: {_text(error)}") from None
    except (OSError, ValueError):
        raise IgrowError(f"no daemon answers on port {port} of this machine; is igrow-edge running?") from None
    except http.client.HTTPException:
        raise IgrowError(f"port {port} of this machine: what answers there is no igrow-edge") from None
    if not isinstance(state.get("alarms"), list):
        raise IgrowError(f"port {port} of this machine: what answers there is no igrow-edge")
    return state


def _text(error: urllib.error.HTTPError) -> str:
    """Return what an error's page says, as far as it is short."""
    try:
        return error.read(300).decode(errors="replace").strip()
    except (OSError, http.client.HTTPException):
        return str(error)


def last_port(path: Path) -> int:
    """Return the port that a daemon has left in its file; 0, which nobody answers on, without one."""
    port = read_state(path).get("port")
    return port if isinstance(port, int) else 0


def last_state(path: Path) -> dict[str, Any] | None:
    """Return the state that a daemon has left in its file, or None."""
    left = read_state(path).get("state")
    return left if isinstance(left, dict) else None
