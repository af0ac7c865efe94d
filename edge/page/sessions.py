"""Who is signed in, and how often one may try. All of it in memory: a restart signs everybody out."""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field

MOST_SESSIONS = 32
MOST_ADDRESSES = 1024
"""Addresses that are remembered for their failures."""
TRIES = 5
"""Failures of one address that cost nothing; each further try waits."""
TRY_SECONDS = 60.0
"""After the first failures an address may try once in so many seconds."""
ALL_TRIES = 30
"""Tries of all addresses together in `TRY_SECONDS`: each costs processor time."""


@dataclass
class Session:
    """One browser that is signed in."""

    who: str
    password: bytes
    """Digest of the password that it signed in with: a new password ends it."""
    ends: float
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))
    """Stands in each form; a page of another site does not know it."""
    said: tuple[str, bool] = ("", True)
    """What the last action did, to be shown once, and whether it was done."""

    def take_said(self) -> tuple[str, bool]:
        """Return what the last action did, and forget it."""
        said, self.said = self.said, ("", True)
        return said


class Sessions:
    """Signs in and knows again. Safe to use from one thread."""

    def __init__(self, seconds: float, monotonic: Callable[[], float] = time.monotonic) -> None:
        """`seconds` is how long a sign-in lasts."""
        self._seconds = seconds
        self._monotonic = monotonic
        self._sessions: OrderedDict[bytes, Session] = OrderedDict()

    def begin(self, who: str, password: bytes) -> str:
        """Return the secret of a new session, for the cookie; only its hash is kept."""
        while len(self._sessions) >= MOST_SESSIONS:
            self._sessions.popitem(last=False)
        secret = secrets.token_urlsafe(32)
        self._sessions[_key(secret)] = Session(who, password, self._monotonic() + self._seconds)
        return secret

    def find(self, secret: str | None, password: bytes | None) -> Session | None:
        """Return the session of a cookie, if it runs and the password is still that of its beginning."""
        if secret is None or password is None:
            return None
        session = self._sessions.get(_key(secret))
        if session is None:
            return None
        if session.ends <= self._monotonic() or not hmac.compare_digest(session.password, password):
            del self._sessions[_key(secret)]
            return None
        return session

    def end(self, secret: str | None) -> None:
        """Forget a session."""
        if secret is not None:
            self._sessions.pop(_key(secret), None)


class Tries:
    """Slows guessing down: for each address, and for all together. Bounded, whoever asks. For one thread."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._monotonic = monotonic
        self._failures: OrderedDict[str, tuple[int, float]] = OrderedDict()
        self._window, self._in_window = monotonic(), 0

    def wait(self, address: str) -> float:
        """Return the seconds until this address may try; 0 counts as a try."""
        now = self._monotonic()
        if now - self._window >= TRY_SECONDS:
            self._window, self._in_window = now, 0
        count, last = self._failures.get(group(address), (0, 0.0))
        left = last + TRY_SECONDS - now if count >= TRIES else 0.0
        if self._in_window >= ALL_TRIES:
            left = max(left, self._window + TRY_SECONDS - now)
        if left <= 0.0:
            self._in_window += 1
        return max(0.0, left)

    def failed(self, address: str) -> None:
        """Count a failure; what failed longest ago is forgotten first."""
        key = group(address)
        count, _ = self._failures.pop(key, (0, 0.0))
        while len(self._failures) >= MOST_ADDRESSES:
            self._failures.popitem(last=False)
        self._failures[key] = (count + 1, self._monotonic())

    def succeeded(self, address: str) -> None:
        """Forget an address's failures."""
        self._failures.pop(group(address), None)


def group(address: str) -> str:
    """Return an address, or the /64 net of an IPv6 one: that is what one visitor has."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if parsed.version == 6:
        return str(ipaddress.ip_network((parsed, 64), strict=False))
    return str(parsed)


def _key(secret: str) -> bytes:
    return hashlib.sha256(secret.encode()).digest()
