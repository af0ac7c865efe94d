"""Buckets and servers through fsspec, an extra: `igrow[s3]` on a gateway, `igrow[exchange]` at the trainer."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from igrow.core.errors import first_line
from igrow.core.exchange.address import Address, parse_address
from igrow.core.exchange.errors import ExchangeError
from igrow.core.exchange.place import Entry, FolderPlace

TIMEOUT_SECONDS = 60


class RemotePlace:
    """A folder of an fsspec file system; implements `igrow.core.exchange.Place`."""

    def __init__(self, system: Any, root: str, name: str, *, renames: bool) -> None:
        """`renames` where a file shows before it is whole, so that it must be written under another name first."""
        self._system = system
        self._root = root.rstrip("/")
        self._name = name
        self._renames = renames

    def __str__(self) -> str:
        return self._name

    def entries(self, folder: str) -> list[Entry]:
        """Return the files directly in `folder`, by name."""
        found = self._listing(f"{self._root}/{folder}")
        entries = [Entry(_last(one["name"]), int(one["size"] or 0)) for one in found if one["type"] == "file"]
        return sorted((one for one in entries if one.name and not one.name.startswith(".")), key=lambda one: one.name)

    def folders(self) -> list[str]:
        """Return the names of the folders directly in it."""
        names = {_last(one["name"]) for one in self._listing(self._root) if one["type"] == "directory"}
        return sorted(name for name in names if name and not name.startswith("."))

    def _listing(self, folder: str) -> list[Any]:
        try:
            self._system.invalidate_cache()
            return list(self._system.ls(folder, detail=True))
        except FileNotFoundError:
            return []
        except Exception as error:
            raise self._failed(error) from None

    def get(self, path: str, largest: int) -> bytes | None:
        """Return a file's content, or None."""
        try:
            with self._system.open(f"{self._root}/{path}", "rb") as stream:
                content: bytes = stream.read(largest + 1)
        except FileNotFoundError:
            return None
        except Exception as error:
            raise self._failed(error) from None
        if len(content) > largest:
            raise ExchangeError(f"{self._name}/{path}: more than {largest} bytes")
        return content

    def put(self, path: str, content: bytes) -> None:
        """Write a file; it appears whole or not at all."""
        folder, _, name = f"{self._root}/{path}".rpartition("/")
        try:
            if not self._renames:
                self._system.pipe_file(f"{folder}/{name}", content)
                return
            self._system.makedirs(folder, exist_ok=True)
            part = f"{folder}/.{name}.part"
            with self._system.open(part, "wb") as stream:
                stream.write(content)
            self._system.mv(part, f"{folder}/{name}")
        except Exception as error:
            raise self._failed(error) from None

    def delete(self, path: str) -> None:
        """Delete a file."""
        try:
            self._system.rm_file(f"{self._root}/{path}")
        except FileNotFoundError:
            return
        except Exception as error:
            raise self._failed(error) from None

    def _failed(self, error: Exception) -> ExchangeError:
        # What libraries of this kind raise is known to nobody: their own errors, their transports', the system's.
        return ExchangeError(f"{self._name}: {first_line(error)[:200]}")


def _last(path: str) -> str:
    return path.rstrip("/").rsplit("/", 1)[-1]


def open_place(
    text: str, *, base: Path | None = None, known_hosts: str | None = None, identity: str | None = None
) -> FolderPlace | RemotePlace:
    """Return the place at an address: a folder, below `base` where it is relative, or a server. Raises IgrowError."""
    address = parse_address(text, base)
    if address.scheme == "file":
        return FolderPlace(Path(address.path))
    return open_remote(
        address,
        known_hosts=Path(known_hosts) if known_hosts else None,
        identity=Path(identity) if identity else None,
    )


def open_remote(address: Address, *, known_hosts: Path | None = None, identity: Path | None = None) -> RemotePlace:
    """Return the place at an sftp or s3 address; connects to sftp at once.

    `known_hosts` holds the SFTP server's key and `identity` our private key; S3 takes its credentials as the tools of
    its maker do, from the environment or `~/.aws`. Raises ExchangeError.
    """
    if address.scheme == "s3":
        options: dict[str, Any] = {"connect_timeout": 20, "read_timeout": TIMEOUT_SECONDS}
        client = {"endpoint_url": address.endpoint} if address.endpoint else {}
        system = _package("s3fs", "s3").S3FileSystem(
            client_kwargs=client, config_kwargs=options, use_listings_cache=False
        )
        return RemotePlace(system, f"{address.host}/{address.path}".rstrip("/"), str(address), renames=False)
    try:
        system = _pinned_sftp(address, known_hosts, identity)
    except ExchangeError:
        raise
    except Exception as error:
        raise ExchangeError(f"{address}: {first_line(error)[:200]}") from None
    return RemotePlace(system, address.path, str(address), renames=True)


def _pinned_sftp(address: Address, known_hosts: Path | None, identity: Path | None) -> Any:
    """Return fsspec's SFTP file system over a connection to the server with the pinned key, and to no other."""
    paramiko = _package("paramiko", "exchange")
    sftp = _package("fsspec.implementations.sftp", "exchange")
    pinned = known_hosts or Path.home() / ".ssh" / "known_hosts"
    if not pinned.is_file():
        raise ExchangeError(
            f"{pinned}: no such file; it must hold the key of {address.host}, as `{address.keyscan}` prints it "
            "(compare the fingerprint with the server's owner); another file: --known-hosts"
        )
    if identity is not None and not identity.is_file():
        raise ExchangeError(f"{identity}: no such file; it must hold our private key")

    base: Any = sftp.SFTPFileSystem

    class PinnedSftp(base):  # type: ignore[misc]  # the package has no types
        """The same, which does not take any key that a server shows."""

        cachable = False

        def _connect(self) -> None:
            self.client = paramiko.SSHClient()
            self.client.load_host_keys(str(pinned))
            self.client.set_missing_host_key_policy(paramiko.RejectPolicy())
            self.client.connect(
                address.host,
                port=address.port,
                username=address.user or None,
                key_filename=str(identity) if identity else None,
                look_for_keys=identity is None,
                allow_agent=identity is None,
                timeout=20,
                banner_timeout=20,
                auth_timeout=20,
            )
            self.ftp = self.client.open_sftp()
            self.ftp.get_channel().settimeout(TIMEOUT_SECONDS)

        def mv(self, old: str, new: str) -> None:
            """Rename over an earlier file."""
            self.ftp.posix_rename(old, new)

    try:
        return PinnedSftp(address.host)
    except paramiko.BadHostKeyException:
        raise ExchangeError(
            f"{address}: the server's key is not the pinned one: somebody may be listening in"
        ) from None
    except paramiko.PasswordRequiredException:
        raise ExchangeError(f"{address}: our private key has a passphrase: one without is needed") from None
    except paramiko.AuthenticationException:
        raise ExchangeError(f"{address}: the server does not know our key") from None
    except paramiko.SSHException as error:
        if "authentication methods" not in str(error):
            raise
        raise ExchangeError(f"{address}: there is no private key to show: name its file with --identity") from None


def _package(name: str, extra: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        raise ExchangeError(f"this address needs the package {name}: install igrow[{extra}]") from None
