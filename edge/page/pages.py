"""From what is on the disk and what the daemon says to the bytes of a page."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from igrow.core.errors import IgrowError
from igrow.core.language import LANGUAGES
from igrow.edge.configuration import Configuration, load_configuration
from igrow.edge.daemon_file import ClockSource
from igrow.edge.notifications.acknowledged import ACKNOWLEDGED_FILE, read_acknowledged
from igrow.edge.overriding import override_file
from igrow.edge.page.actions import Actions
from igrow.edge.page.history import SPANS, History
from igrow.edge.page.http import HTML, Request, Response
from igrow.edge.page.password import Password, read_password
from igrow.edge.page.sessions import Session
from igrow.edge.page.state import Daemon
from igrow.edge.page.view import Known, compose, said_by
from igrow.edge.page.words import Words
from igrow.edge.separating_tests import approval_file, read_approval
from igrow.edge.sources.override import read_leases
from igrow.edge.status.client import STATUS_FILE
from igrow.edge.store import StoreError

LOOK_SECONDS = 10.0
"""Between two looks at whether the configuration has changed."""
KINDS = {".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}


@cache
def templates() -> Environment:
    """Return the templates; what they are given is escaped."""
    loader = PackageLoader("igrow.edge.page", "templates")
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)


def render(name: str, content: Mapping[str, Any], status: str = "200 OK") -> Response:
    """Return a template filled with content."""
    return Response(status, HTML, templates().get_template(name).render(content).encode())


class Configured:
    """The configuration as it stands in its files; while they hold a mistake, the last one without."""

    def __init__(self, path: Path) -> None:
        """Raise IgrowError where the files hold a mistake."""
        self._path = path
        self._lock = threading.Lock()
        self.now = load_configuration(path)
        self._stamp = self._stamps()
        self._looked_at = time.monotonic()

    def look(self) -> Configuration:
        """Return the configuration, read again where a file has changed."""
        with self._lock:
            if time.monotonic() - self._looked_at >= LOOK_SECONDS:
                self._looked_at = time.monotonic()
                stamp = self._stamps()
                if stamp != self._stamp:
                    self._stamp = stamp
                    self._read()
            return self.now

    def _read(self) -> None:
        # With a mistake in it the daemon keeps its last good one too, and says so.
        with contextlib.suppress(IgrowError, OSError):
            self.now = load_configuration(self._path)

    def _stamps(self) -> list[int]:
        folder = self._path.parent
        paths = (self._path, folder / self.now.file.site, folder / self.now.file.register_map)
        try:
            return [path.stat().st_mtime_ns for path in paths]
        except OSError:
            return []


class Pages:
    """Makes pages and does what forms ask for. Safe to call from several threads."""

    def __init__(self, path: Path, daemon: Daemon | None = None) -> None:
        """`path` is the daemon's file. Raises IgrowError where it holds a mistake."""
        self._configured = Configured(path)
        configuration = self._configured.now
        self._daemon = daemon or Daemon(
            configuration.file.status.port,
            configuration.state_folder / STATUS_FILE,
            late_after=max(60.0, 3.0 * configuration.file.cycle.interval.total_seconds()),
        )
        self._history = History(configuration.store_folder)

    def configuration(self) -> Configuration:
        """Return the configuration, as it was last read; reads nothing."""
        return self._configured.now

    def password(self) -> Password | None:
        """Return the page's password, or None."""
        return read_password(self.configuration().state_folder)

    def file(self, path: str) -> Response | None:
        """Return one of the page's own files, or None."""
        found = own_files().get(path)
        if found is None:
            return None
        kind, content = found
        return Response("200 OK", f"{kind}; charset=utf-8", content, {"Cache-Control": "no-cache"})

    def words(self, request: Request) -> Words:
        """Return the language of a visitor: the configured one, else what the browser asks for."""
        configuration = self.configuration()
        return Words.of(configuration.site, configuration.file.page.language or request.language(LANGUAGES))

    def sign_in(
        self, say: Words, *, has_password: bool, who: str = "", problem: str = "", status: str = "200 OK"
    ) -> Response:
        """Return the page on which one signs in; `problem` is a text that is told in the visitor's language."""
        site = self.configuration().site.name
        content = {"site": site, "has_password": has_password, "who": who, "problem": problem, **said_by(say)}
        return render("sign_in.html", content, status)

    def page(
        self, say: Words, span: str, session: Session | None, said: tuple[str, bool], *, has_password: bool
    ) -> Response:
        """Return the page over a span of `SPANS`; another one is a day."""
        known = self._known(span if span in SPANS else "day", say.language.code, has_password=has_password)
        text, well = said
        return render("page.html", {**compose(known), "session": session, "said": text, "said_well": well})

    def act(self, form: Mapping[str, str], who: str, say: Words) -> str:
        """Do what a form asks for; returns one line. Raises IgrowError, its line in the visitor's language."""
        state = self._daemon.hear().state
        active = [] if state is None else [str(alarm["name"]) for alarm in state["alarms"]]
        try:
            return Actions(self._configured.look(), active, say).do(form, who)
        except IgrowError as error:
            raise IgrowError(say.told(str(error), time.time())) from None

    def _known(self, span: str, language: str, *, has_password: bool) -> Known:
        configuration, heard = self._configured.look(), self._daemon.hear()
        told = None if heard.state is None else heard.state["time"]
        # A real plant's time goes on while nobody tells it.
        own = heard.silence and configuration.file.cycle.clock is ClockSource.SYSTEM
        now = time.time() if told is None or own else float(told)
        problem, courses, day = "", {}, {}
        try:
            day = self._history.courses(SPANS["day"], now)
            courses = day if span == "day" else self._history.courses(SPANS[span], now)
        except StoreError as error:
            problem = str(error)
        state = configuration.state_folder
        return Known(
            configuration, heard, now, span, courses, day, problem,
            read_leases(override_file(state)), read_acknowledged(state / ACKNOWLEDGED_FILE), has_password, language,
            read_approval(approval_file(state)),
        )  # fmt: skip


@cache
def own_files() -> dict[str, tuple[str, bytes]]:
    """Return style, script and picture of the page by their path, with their kind."""
    folder = files("igrow.edge.page") / "templates"
    return {
        f"/{entry.name}": (KINDS[Path(entry.name).suffix], entry.read_bytes())
        for entry in folder.iterdir()
        if Path(entry.name).suffix in KINDS
    }
