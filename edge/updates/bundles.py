"""The bundles of this gateway and what is remembered of them: which one rules, which one waits, which are refused.

Everything here runs in the updates' own thread, and every bundle is read and tried in the process for graphs. That one
is about to be tried is written down first: a bundle that takes the gateway down with it is not tried again.
"""

from __future__ import annotations

import contextlib
import hashlib
import threading
from collections.abc import Iterator
from pathlib import Path

from igrow.core.bundle import MANIFEST_FILE, Bundle, BundleError
from igrow.edge.updates.fetched import BundleRefusedError, Fetched, UpdateError
from igrow.edge.updates.rules import Graphs
from igrow.edge.updates.shelf import Shelf
from igrow.edge.updates.state import UpdateState, load_state, save_in_place, save_state
from igrow.edge.updates.telling import Teller, Verdict

TAKE_SECONDS = 300.0
"""Longest time for unpacking, checking and testing one bundle, on the slowest gateway."""
WENT_DOWN = "the gateway went down while it was being tried"
_JUDGING = "igrow.edge.updates.judging"


class Bundles:
    """The shelf, and the state beside it."""

    def __init__(self, state_file: Path, shelf: Shelf, graphs: Graphs, teller: Teller) -> None:
        """Nothing is read before `begin`."""
        self._state_file = state_file
        self._shelf = shelf
        self._graphs = graphs
        self._teller = teller
        self.lock = threading.Lock()
        """Guards `state` and `known` against readers in other threads."""
        self.state = UpdateState()
        self.known: dict[str, Bundle] = {}
        """By identity: those that the state names."""

    @property
    def active(self) -> Bundle | None:
        """The bundle in force."""
        return self.known.get(self.state.active or "")

    @property
    def previous(self) -> Bundle | None:
        """Its predecessor."""
        return self.known.get(self.state.previous or "")

    def begin(self) -> None:
        """Read the state and the bundles that it names; a damaged one is dropped, the active one replaced.

        Raises ProcessError where they cannot be read now, and nothing has changed.
        """
        with contextlib.suppress(OSError):
            self._state_file.parent.mkdir(parents=True, exist_ok=True)
        state = load_state(self._state_file)
        known: dict[str, Bundle] = {}
        damaged: list[tuple[str, str, str]] = []
        for role in ("previous", "candidate", "active"):
            identity = getattr(state, role)
            if identity is not None:
                try:
                    known[identity] = self._call("read_again", identity)
                except BundleError as error:
                    damaged.append((role, identity, str(error)))
        for role, identity, reason in damaged:
            self._drop(state, role, identity, reason)
        with self.lock:
            self.state, self.known = state, known

    def _drop(self, state: UpdateState, role: str, identity: str, reason: str) -> None:
        self._teller.event(None, "bundle_damaged", {"bundle": identity, "reason": reason})
        setattr(state, role, None)
        if role == "active" and state.previous is not None:
            state.active, state.previous, state.watch_since = state.previous, None, None
            self._teller.event(None, "bundle_went_back", {"bundle": identity, "reason": "it is damaged"})

    def install(self, folder: Path) -> None:
        """Take a bundle that an operator gives, into force; raises UpdateError, BundleError or ProcessError."""
        identity = _identity_of(folder)
        if identity == self.state.attempt or identity in self.state.rejected:
            raise BundleRefusedError(f"{folder}: {self.state.rejected.get(identity, WENT_DOWN)}")
        with self.attempt(identity):
            bundle: Bundle = self._call("take_folder", folder)
        with self.lock:
            self.known[bundle.identity] = bundle
            self.state.active = bundle.identity
            self.state.last_verdict = f"{bundle.label} installed by the configuration"
        self._teller.event(None, "bundle_installed", {"bundle": bundle.label})
        self.save()

    def take(self, fetched: Fetched) -> Bundle | None:
        """Unpack, check and test what was fetched; None for one that is in force or was refused before.

        Raises UpdateError, BundleError or ProcessError.
        """
        identity = identity_of(fetched)
        if identity in self.settled:
            return None
        with self.attempt(identity):
            bundle: Bundle = self._call("take", fetched.archive)
        # It may have been published again under another signature.
        return None if bundle.identity in self.settled else bundle

    @property
    def settled(self) -> set[str]:
        """Identities of the bundles of which nothing more is to be found out."""
        return {self.state.active or "", *self.state.rejected} - {""}

    @contextlib.contextmanager
    def attempt(self, identity: str) -> Iterator[None]:
        """Note that a bundle is being tried; raises UpdateError where that cannot be noted: it is not tried then.

        Whatever ends the trial while the daemon lives clears the note.
        """
        self.state.attempt = identity
        try:
            save_state(self._state_file, self.state)
        except OSError as error:
            self.state.attempt = None
            raise UpdateError(f"{self._state_file}: a trial cannot be noted: {error.strerror or error}") from None
        try:
            yield
        finally:
            self.state.attempt = None
            try:
                save_state(self._state_file, self.state)
            except OSError:
                # A note that stays would be held against the bundle at the next start, which is for good.
                with contextlib.suppress(OSError):
                    save_in_place(self._state_file, self.state)

    def shadow(self, bundle: Bundle, time: float) -> None:
        """Let a bundle predict beside the one in force from `time` on."""
        with self.lock:
            self.known[bundle.identity] = bundle
            self.state.candidate, self.state.candidate_since = bundle.identity, time

    def adopt(self, bundle: Bundle, time: float, reason: str, live_before: dict[str, float]) -> None:
        """Put a bundle into force, on probation where there is one to go back to."""
        state = self.state
        with self.lock:
            self.known[bundle.identity] = bundle
            state.watch_since = None if self.active is None else time
            state.previous, state.active, state.candidate = state.active, bundle.identity, None
            state.live_before = live_before
            state.last_verdict = f"{bundle.label} adopted: {reason}"
        self._tidy()

    def settle(self, identity: str) -> None:
        """Let a bundle rule without probation, and no other one wait for its place."""
        with self.lock:
            if self.state.active == identity:
                self.state.candidate, self.state.watch_since = None, None
        self._tidy()

    def go_back(self) -> None:
        """Put the predecessor into force again."""
        with self.lock:
            self.state.active, self.state.previous, self.state.watch_since = self.state.previous, None, None

    def reject(self, time: float, verdict: Verdict) -> None:
        """Mark a bundle as never to be tried again, and tell it."""
        with self.lock:
            self.state.rejected[verdict.identity] = verdict.reason
            self.state.last_verdict = f"{verdict.label} {verdict.verdict.replace('_', ' ')}: {verdict.reason}"
            if self.state.candidate == verdict.identity:
                self.state.candidate = None
        self._tidy()
        self.tell(time, verdict)

    def tell(self, time: float, verdict: Verdict) -> None:
        """Save first and tell then, so that no verdict is told twice."""
        self.save()
        self._teller.verdict(time, verdict)

    def save(self) -> None:
        """Write the state down, where the disk takes it."""
        with contextlib.suppress(OSError):
            save_state(self._state_file, self.state)

    def _tidy(self) -> None:
        """Keep the bundle in force and its predecessor (and a candidate) on the disk, no other."""
        state = self.state
        wanted = {identity for identity in (state.active, state.previous, state.candidate) if identity}
        with self.lock:
            self.known = {identity: bundle for identity, bundle in self.known.items() if identity in wanted}
        self._shelf.keep_only(wanted)

    def _call(self, function: str, given: str | Path) -> Bundle:
        bundle: Bundle = self._graphs.call(f"{_JUDGING}:{function}", self._shelf, given, seconds=TAKE_SECONDS)
        return bundle


def identity_of(fetched: Fetched) -> str:
    """Return the identity that the publisher signed, or a name of the archive's own where there is none."""
    if fetched.identity:
        return fetched.identity
    with fetched.archive.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()[:16]


def _identity_of(folder: Path) -> str:
    """Return the identity of the bundle in a folder, unread but for its manifest; raises UpdateError."""
    manifest = folder / MANIFEST_FILE
    try:
        if not manifest.is_file():
            raise UpdateError(f"{manifest}: no such file, or not a plain one")
        return hashlib.sha256(manifest.read_bytes()).hexdigest()[:16]
    except OSError as error:
        raise UpdateError(f"{manifest}: {error.strerror}") from None
