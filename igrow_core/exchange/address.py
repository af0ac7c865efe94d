"""The address of an exchange: a folder, `sftp://user@host:port/folder` or `s3://bucket/folder?endpoint=https://host`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import parse_qs, unquote, urlsplit

from igrow.core.errors import IgrowError

FORMS = "a folder, sftp://user@host/folder or s3://bucket/folder?endpoint=https://host"


@dataclass(frozen=True)
class Address:
    """An address, taken apart. Passwords and keys never stand in it."""

    scheme: str
    """file, sftp or s3."""
    path: str
    """Folder on the disk or the server; below the bucket for s3, without slashes around it."""
    host: str = ""
    """Server for sftp, bucket for s3."""
    user: str = ""
    port: int = 22
    endpoint: str = ""
    """Web address of an S3-compatible service; empty for the default one."""

    @property
    def keyscan(self) -> str:
        """The command that prints an SFTP server's key."""
        return f"ssh-keyscan {self.host}" if self.port == 22 else f"ssh-keyscan -p {self.port} {self.host}"

    def __str__(self) -> str:
        if self.scheme == "file":
            return self.path
        if self.scheme == "sftp":
            port = "" if self.port == 22 else f":{self.port}"
            return f"sftp://{self.user + '@' if self.user else ''}{self.host}{port}/{self.path.lstrip('/')}"
        return f"s3://{self.host}/{self.path}" + (f"?endpoint={self.endpoint}" if self.endpoint else "")


def parse_address(text: str, base: Path | None = None) -> Address:
    """Return the address in `text`; a relative folder is below `base`. Raises IgrowError."""
    if "://" not in text:
        return Address("file", str((base or Path()) / text))
    parts = urlsplit(text)
    if parts.password:
        raise IgrowError(f"{parts.scheme}://...: a password has no place in an address; use a key")
    if parts.scheme == "file" and not parts.netloc:
        return Address("file", unquote(parts.path))
    try:
        port = parts.port or 22
    except ValueError:
        raise IgrowError(f"{text}: its port is no number from 1 to 65535") from None
    if parts.scheme == "sftp" and parts.hostname:
        if any(part.startswith("-") for part in (parts.hostname, parts.username or "")):
            raise IgrowError(f"{text}: no name of a user or a host begins with a dash")
        return Address("sftp", unquote(parts.path) or "/", parts.hostname, parts.username or "", port)
    if parts.scheme == "s3" and parts.netloc:
        endpoint = parse_qs(parts.query).get("endpoint", [""])[0]
        return Address("s3", unquote(parts.path).strip("/"), parts.netloc, endpoint=endpoint)
    raise IgrowError(f"{text}: no address of an exchange: {FORMS} is right")
