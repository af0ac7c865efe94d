"""Messages between the daemon and its planning process: a length and a pickle, over pipes that only they hold.

Neither side waits for ever: the other one may have been stopped, or be swapping.
"""

from __future__ import annotations

import os
import pickle
import select
import struct
import time
from typing import Any

LARGEST = 256 * 2**20
_LENGTH = struct.Struct("<Q")


class MessageError(Exception):
    """The other side is gone, too slow, or sends what is no message."""


class EndedError(MessageError):
    """The other side has ended."""


def send(descriptor: int, message: object, timeout: float) -> None:
    """Write one message; raises MessageError after `timeout` seconds, or when the other side is gone."""
    body = pickle.dumps(message, protocol=5)
    view = memoryview(_LENGTH.pack(len(body)) + body)
    until = time.monotonic() + timeout
    os.set_blocking(descriptor, False)
    try:
        while view:
            _wait(descriptor, select.POLLOUT, until)
            view = view[os.write(descriptor, view) :]
    except OSError as error:
        raise EndedError(f"the process is gone ({error.strerror})") from None


def receive(descriptor: int, timeout: float) -> Any:
    """Read one message; raises MessageError after `timeout` seconds, or when the other side is gone."""
    until = time.monotonic() + timeout
    (length,) = _LENGTH.unpack(_read(descriptor, _LENGTH.size, until))
    if length > LARGEST:
        raise MessageError("it sent something that is no message")
    return pickle.loads(_read(descriptor, length, until))


def _read(descriptor: int, count: int, until: float) -> bytes:
    chunks = []
    while count:
        _wait(descriptor, select.POLLIN, until)
        chunk = os.read(descriptor, min(count, 1 << 20))
        if not chunk:
            raise EndedError("it ended")
        chunks.append(chunk)
        count -= len(chunk)
    return b"".join(chunks)


def _wait(descriptor: int, events: int, until: float) -> None:
    """Wait until the pipe can be read or written; raises MessageError when it is too late."""
    poll = select.poll()
    poll.register(descriptor, events)
    if not poll.poll(max(0.0, until - time.monotonic()) * 1000.0):
        raise MessageError("it took too long")
