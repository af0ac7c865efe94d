"""One message to one service, in a process of its own: no answer can take the machine's memory, or never end.

What a server answers is read by Apprise and the libraries behind it, all of it and in one piece, whatever it is.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys

from igrow.edge.alarm_levels import Level
from igrow.edge.notifications.message import Message

MOST_BYTES = 128 * 2**20
"""Data of the process. With Apprise it has less than a third of that; no service has as much to say."""
SEND_SECONDS = 60.0
"""A service that takes longer is given up; the message may have got through."""


def send_aside(address: str, message: Message) -> bool:
    """Send to an Apprise address; return whether the service took it. Raises TimeoutError and OSError."""
    # An address may hold a password, so it is no argument of a command.
    order = json.dumps({"address": address, "title": message.title, "body": message.body, "level": message.level})
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    try:
        done = subprocess.run(
            [sys.executable, "-m", "igrow.edge.notifications.sending"],
            input=order.encode(), env=environment, timeout=SEND_SECONDS, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise TimeoutError(f"no end within {SEND_SECONDS:.0f} s") from None
    return done.returncode == 0


def main() -> int:
    """Send what stands on standard input; return 0 where the service took it."""
    resource.setrlimit(resource.RLIMIT_DATA, (MOST_BYTES, MOST_BYTES))
    from apprise import Apprise, NotifyType  # noqa: PLC0415 - an extra, and its memory counts

    order = json.load(sys.stdin)
    kinds = {Level.NOTICE: NotifyType.INFO, Level.WARNING: NotifyType.WARNING, Level.CRITICAL: NotifyType.FAILURE}
    target = Apprise()
    target.add(order["address"])
    level = Level(order["level"])
    taken = target.notify(body=order["body"], title=order["title"], notify_type=kinds[level])
    return 0 if taken else 1


if __name__ == "__main__":
    sys.exit(main())
