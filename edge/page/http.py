"""As much of HTTP as the page needs: one bounded request a connection, one answer, no second thought."""

from __future__ import annotations

import asyncio
import gzip
import ipaddress
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from http.cookies import CookieError, SimpleCookie
from operator import itemgetter
from urllib.parse import parse_qsl

HEAD_BYTES = 8192
BODY_BYTES = 4096
MOST_FIELDS = 32
LOCALHOST = ("localhost",)
CONTENT_SECURITY_POLICY = (
    "default-src 'none'; style-src 'self'; script-src 'self'; connect-src 'self'; img-src 'self'; "
    "form-action 'self'; base-uri 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Cache-Control": "no-store",
    "Connection": "close",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    # Not "no-referrer": a browser would then not say of which page a form is.
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
}
HTML = "text/html; charset=utf-8"
TEXT = "text/plain; charset=utf-8"


class RequestRefusedError(Exception):
    """A request that is not served: a status line, and one line of text."""

    def __init__(self, status: str, text: str) -> None:
        super().__init__(text)
        self.status = status


@dataclass(frozen=True)
class Request:
    """What a visitor asks for."""

    method: str
    path: str
    query: Mapping[str, str]
    headers: Mapping[str, str]
    """By name in small letters; none of those that matter comes twice."""
    body: bytes
    address: str
    """The visitor's."""

    @property
    def form(self) -> dict[str, str]:
        """The fields of a form. Raises RequestRefusedError for a body that is none."""
        kind = self.headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind != "application/x-www-form-urlencoded":
            raise RequestRefusedError("415 Unsupported Media Type", "a form is expected")
        return _fields(self.body.decode("latin-1"))

    @property
    def takes_gzip(self) -> bool:
        """Tell whether the visitor takes compressed answers."""
        wanted = (one.partition(";")[0].strip() for one in self.headers.get("accept-encoding", "").split(","))
        return "gzip" in wanted

    def language(self, known: Sequence[str]) -> str:
        """Return which of the known languages the visitor likes best, the first of them where he names none."""
        liked: list[tuple[float, str]] = []
        for one in self.headers.get("accept-language", "").split(",")[:MOST_FIELDS]:
            tag, _, weight = one.partition(";q=")
            try:
                liked.append((-float(weight or 1.0), tag.strip().lower().partition("-")[0]))
            except ValueError:
                continue
        return next(
            (code for weight, code in sorted(liked, key=itemgetter(0)) if code in known and weight < 0.0), known[0]
        )

    def cookie(self, name: str) -> str | None:
        """Return one cookie, or None."""
        try:
            found = SimpleCookie(self.headers.get("cookie", "")).get(name)
        except CookieError:
            return None
        return None if found is None else found.value


@dataclass(frozen=True)
class Response:
    """What is answered."""

    status: str
    kind: str
    body: bytes
    headers: Mapping[str, str] = field(default_factory=dict)

    def packed(self) -> Response:
        """Return it compressed, for a browser that takes that. Nothing in it is of a foreign page's choice (BREACH)."""
        return replace(self, body=gzip.compress(self.body, 5), headers={**self.headers, "Content-Encoding": "gzip"})

    def bytes(self, *, head_only: bool = False) -> bytes:
        """Return it as it goes out."""
        headers = {"Content-Type": self.kind, "Content-Length": str(len(self.body)), **HEADERS, **self.headers}
        head = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
        return f"HTTP/1.1 {self.status}\r\n{head}\r\n".encode("latin-1") + (b"" if head_only else self.body)


def plain(status: str, line: str, headers: Mapping[str, str] | None = None) -> Response:
    """Return a line of text as an answer."""
    return Response(status, TEXT, f"{line}\n".encode(), headers or {})


def see(path: str, headers: Mapping[str, str] | None = None) -> Response:
    """Return an answer that leads to another page."""
    return Response("303 See Other", TEXT, b"", {"Location": path, **(headers or {})})


async def read_request(reader: asyncio.StreamReader, address: str) -> Request:
    """Read one request. Raises RequestRefusedError; IncompleteReadError where the visitor hangs up before its end."""
    try:
        head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
    except asyncio.LimitOverrunError:
        raise RequestRefusedError(
            "431 Request Header Fields Too Large", f"at most {HEAD_BYTES} bytes are read"
        ) from None
    first, *lines = head.removesuffix("\r\n\r\n").split("\r\n")
    parts = first.split(" ")
    if len(parts) != 3 or not parts[2].startswith("HTTP/1.") or not parts[1].startswith("/"):
        raise RequestRefusedError("400 Bad Request", "no HTTP request")
    method, target, _ = parts
    if method not in ("GET", "HEAD", "POST"):
        raise RequestRefusedError("405 Method Not Allowed", "GET, HEAD and POST are answered")
    headers = _headers(lines)
    body = await _body(reader, headers) if method == "POST" else b""
    path, _, query = target.partition("?")
    return Request(method, path, _fields(query), headers, body, address)


def _headers(lines: Sequence[str]) -> dict[str, str]:
    headers: dict[str, str] = {}
    for line in lines:
        name, colon, value = line.partition(":")
        name = name.lower()
        if not colon or name != name.strip() or not name:
            raise RequestRefusedError("400 Bad Request", "no header")
        if name in headers and name in ("host", "content-length", "origin", "content-type", "cookie"):
            raise RequestRefusedError("400 Bad Request", f"{name} comes twice")
        headers[name] = value.strip()
    return headers


async def _body(reader: asyncio.StreamReader, headers: Mapping[str, str]) -> bytes:
    length = headers.get("content-length", "")
    if "transfer-encoding" in headers or not (length.isascii() and length.isdigit()):
        raise RequestRefusedError("411 Length Required", "a form with its length is expected")
    if len(length) > 6 or int(length) > BODY_BYTES:
        raise RequestRefusedError("413 Content Too Large", f"at most {BODY_BYTES} bytes are read")
    return await reader.readexactly(int(length))


def _fields(encoded: str) -> dict[str, str]:
    try:
        return dict(parse_qsl(encoded, keep_blank_values=True, max_num_fields=MOST_FIELDS))
    except ValueError:
        raise RequestRefusedError("400 Bad Request", "too many fields") from None


def own_name(host: str | None, names: Sequence[str]) -> bool:
    """Tell whether a Host header names this machine.

    A page of another site that had its own name point here (DNS rebinding) would say that name; an address cannot be
    made to point elsewhere.
    """
    if not host:
        return False
    name, port = _split_port(host.lower())
    if port is None:
        return False
    if name in LOCALHOST or name in (one.lower() for one in names):
        return True
    try:
        ipaddress.ip_address(name.removeprefix("[").removesuffix("]"))
    except ValueError:
        return False
    return True


def _split_port(host: str) -> tuple[str, str | None]:
    """Return name and port of a Host header; a port of None is nonsense."""
    name, colon, port = host.rpartition(":")
    if not colon or host.endswith("]"):
        return host, ""
    return name, port if port.isascii() and port.isdigit() else None


def same_origin(request: Request) -> bool:
    """Tell whether a form comes from this very page, as far as the browser says; every present one does."""
    origin = request.headers.get("origin")
    site = request.headers.get("sec-fetch-site")
    if site is not None and site not in ("same-origin", "none"):
        return False
    return origin is None or origin.partition("://")[2].lower() == request.headers.get("host", "").lower()
