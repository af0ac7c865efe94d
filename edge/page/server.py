"""The server of the page: bounded in connections, bytes, time and threads, so that no visitor costs much."""

from __future__ import annotations

import asyncio
import hmac
import logging
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from igrow.core.errors import IgrowError
from igrow.edge.listening import Listener
from igrow.edge.page.http import (
    HEAD_BYTES,
    Request,
    RequestRefusedError,
    Response,
    own_name,
    plain,
    read_request,
    same_origin,
    see,
)
from igrow.edge.page.pages import Pages
from igrow.edge.page.sessions import Session, Sessions, Tries

_log = logging.getLogger("igrow.edge.page")
MOST_CONNECTIONS = 64
"""At once; more are hung up on without a word."""
MOST_OF_ONE = 24
"""Connections of one address at once, so that no visitor shuts out all others."""
MOST_AT_WORK = 8
"""Requests that are worked on at once; more are told to come back."""
REQUEST_SECONDS = 5.0
WORK_SECONDS = 30.0
"""Longest time for a page: the first look at a month of log on a slow card takes some seconds."""
SEND_SECONDS = 20.0
T = TypeVar("T")


class PageServer:
    """Answers visitors; what reads or writes a disk, or asks the daemon, runs in a few threads of its own."""

    def __init__(self, pages: Pages) -> None:
        self._pages = pages
        self._sessions = Sessions(pages.configuration().file.page.session.total_seconds())
        self._tries = Tries()
        self._threads = ThreadPoolExecutor(4, "page")
        # Apart, so that guesses at the password cannot hold up who only looks.
        self._scrypt = ThreadPoolExecutor(1, "password")
        self._at_work = 0
        self._visits: set[asyncio.Task[None]] = set()
        self._of_one: Counter[str] = Counter()
        self._listener: Listener | None = None
        self.port = 0
        """The port that is listened to."""

    async def start(self, address: str, port: int) -> None:
        """Begin to listen. Raises IgrowError where the port cannot be had."""
        try:
            self._listener = Listener(address, port, self._serve, limit=HEAD_BYTES)
        except OSError as error:
            raise IgrowError(f"page: port {port} of {address}: {error.strerror or error}") from None
        self.port = self._listener.port

    @property
    def _cookie(self) -> str:
        """Its name is the compartment's, as a browser keeps the cookies of all ports of a machine together."""
        return f"igrow-page-{self._pages.configuration().site.name}"

    async def close(self) -> None:
        """Stop listening and turn visitors away."""
        if self._listener is not None:
            self._listener.close()
        for threads in (self._threads, self._scrypt):
            threads.shutdown(wait=False, cancel_futures=True)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        visit = asyncio.current_task()
        assert visit is not None
        peer = writer.get_extra_info("peername")
        address = str(peer[0]) if peer else ""
        try:
            if len(self._visits) >= MOST_CONNECTIONS or self._of_one[address] >= MOST_OF_ONE:
                return
            self._visits.add(visit)
            self._of_one[address] += 1
            try:
                await self._visit(reader, writer, address)
            finally:
                self._visits.discard(visit)
                self._of_one[address] -= 1
                self._of_one += Counter()  # forgets who has none
        except (OSError, TimeoutError, asyncio.IncompleteReadError):
            pass  # the visitor is gone, slow, or no browser
        finally:
            # Not closed in good order: a visitor who does not read would have to be waited for.
            writer.transport.abort()

    async def _visit(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, address: str) -> None:
        try:
            async with asyncio.timeout(REQUEST_SECONDS):
                request = await read_request(reader, address)
        except RequestRefusedError as refused:
            response, head_only = plain(refused.status, str(refused)), False
        else:
            response, head_only = await self._answer_any(request), request.method == "HEAD"
        async with asyncio.timeout(SEND_SECONDS):
            writer.write(response.bytes(head_only=head_only))
            await writer.drain()
            writer.close()
            await writer.wait_closed()

    async def _answer_any(self, request: Request) -> Response:
        """Answer whatever happens."""
        try:
            return await self._answer(request)
        except RequestRefusedError as refused:
            return plain(refused.status, str(refused))
        except TimeoutError:
            return plain("503 Service Unavailable", "a disk, or the daemon, takes too long; try again")
        except Exception:
            _log.exception("a page could not be made")
            return plain("500 Internal Server Error", "the page could not be made; the journal says why")

    async def _answer(self, request: Request) -> Response:
        configuration, say = self._pages.configuration(), self._pages.words(request)
        if not own_name(request.headers.get("host"), configuration.file.page.names):
            raise RequestRefusedError(
                "421 Misdirected Request", "this page is for its own names: localhost, or page.names"
            )
        if request.method == "POST":
            return await self._post(request)
        found = self._pages.file(request.path)
        if found is not None:
            return found
        password = await self._aside(self._pages.password)
        session = self._sessions.find(request.cookie(self._cookie), None if password is None else password.digest)
        if request.path == "/sign-in":
            return self._pages.sign_in(say, has_password=password is not None)
        if request.path != "/":
            raise RequestRefusedError("404 Not Found", "there is only /")
        # The flash is taken here, in the one thread that sessions belong to.
        said = session.take_said() if session is not None and request.method == "GET" else ("", True)
        span = request.query.get("span", "day")

        def make() -> Response:
            made = self._pages.page(say, span, session, said, has_password=password is not None)
            return made.packed() if request.takes_gzip else made

        return await self._aside(make)

    async def _post(self, request: Request) -> Response:
        if not same_origin(request):
            raise RequestRefusedError("403 Forbidden", "the form is of another page")
        if request.path == "/sign-in":
            return await self._sign_in(request)
        password = await self._aside(self._pages.password)
        secret = request.cookie(self._cookie)
        session = self._sessions.find(secret, None if password is None else password.digest)
        if session is None:
            return see("/sign-in")
        if not hmac.compare_digest(request.form.get("token", "").encode(), session.token.encode()):
            raise RequestRefusedError("403 Forbidden", "the form is not of this session: load the page again")
        if request.path == "/sign-out":
            self._sessions.end(secret)
            return see("/", {"Set-Cookie": f"{self._cookie}=; Max-Age=0; Path=/; HttpOnly; SameSite=Strict"})
        if request.path != "/act":
            raise RequestRefusedError("404 Not Found", "there is nothing to do there")
        return await self._act(request, session)

    async def _act(self, request: Request, session: Session) -> Response:
        form, who, say = request.form, session.who, self._pages.words(request)
        try:
            said = await self._aside(lambda: self._pages.act(form, who, say))
        except IgrowError as error:
            session.said = (str(error), False)
        else:
            session.said = (said, True)
            _log.info("%s: %s (%s)", who, said, request.address)
        return see("/")

    async def _sign_in(self, request: Request) -> Response:
        form, say = request.form, self._pages.words(request)
        who = " ".join("".join(c for c in form.get("who", "") if c.isprintable()).split())[:40]
        password = await self._aside(self._pages.password)
        if password is None:
            return self._pages.sign_in(say, has_password=False)
        if not who:
            missing = say.text("Your name is missing: it is written down.")
            return self._pages.sign_in(say, has_password=True, problem=missing)
        wait = self._tries.wait(request.address)
        if wait > 0.0:
            refusal = self._pages.sign_in(
                say,
                has_password=True,
                who=who,
                problem=say.text("Too many tries: again in {seconds} s.", seconds=f"{wait:.0f}"),
                status="429 Too Many Requests",
            )
            return Response(refusal.status, refusal.kind, refusal.body, {"Retry-After": f"{wait + 1:.0f}"})
        word = form.get("password", "")[:1024]
        fits = await self._run(self._scrypt, lambda: password.fits(word))
        if not fits:
            self._tries.failed(request.address)
            _log.warning("a password for the page did not fit (%s)", request.address)
            return self._pages.sign_in(
                say, has_password=True, who=who, problem=say.text("That is not the password."), status="403 Forbidden"
            )
        self._tries.succeeded(request.address)
        _log.info("%s has signed in (%s)", who, request.address)
        secret = self._sessions.begin(who, password.digest)
        age = int(self._pages.configuration().file.page.session.total_seconds())
        return see("/", {"Set-Cookie": f"{self._cookie}={secret}; Max-Age={age}; Path=/; HttpOnly; SameSite=Strict"})

    async def _aside(self, work: Callable[[], T]) -> T:
        return await self._run(self._threads, work)

    async def _run(self, threads: ThreadPoolExecutor, work: Callable[[], T]) -> T:
        """Return what `work` returns. Raises TimeoutError where it takes too long; it is then left to its thread."""
        if self._at_work >= MOST_AT_WORK:
            raise RequestRefusedError("503 Service Unavailable", "too many visitors; try again")
        self._at_work += 1
        future = asyncio.get_running_loop().run_in_executor(threads, work)
        future.add_done_callback(self._worked)
        async with asyncio.timeout(WORK_SECONDS):
            return await asyncio.shield(future)

    def _worked(self, future: asyncio.Future[Any]) -> None:
        self._at_work -= 1
        if not future.cancelled():
            future.exception()  # whoever waited has it; nobody else needs to hear of it
