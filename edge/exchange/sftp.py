"""An SFTP server as a place, through the system's own `sftp` program (OpenSSH): nothing to install on the gateway.

The server's key is pinned: the one in `known_hosts` or none. Nobody is asked anything; a password is never tried. An
upload that was cut off goes on where it stopped. Each call is one connection, ended after `timeout` seconds.
"""

from __future__ import annotations

import posixpath
import re
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from igrow.core.exchange.address import Address
from igrow.core.exchange.errors import ExchangeError
from igrow.core.exchange.place import Entry

# -rw-r--r--    ? 1000  1000   48213 Nov 22 09:58 name
_LINE = re.compile(r"-\S{9,10}\s+\S+\s+\S+\s+\S+\s+(\d+)\s+\S+\s+\S+\s+\S+\s(.+)")


class SftpPlace:
    """Implements `igrow.core.exchange.Place`."""

    def __init__(self, address: Address, *, known_hosts: Path, identity: Path | None, timeout: float = 120.0) -> None:
        """`known_hosts` holds the server's key, `identity` our private key (None: the user's own)."""
        self._address = address
        self._timeout = timeout
        if not known_hosts.is_file():
            raise ExchangeError(
                f"{known_hosts}: no such file; it must hold the key of {address.host}, as `{address.keyscan}` "
                "prints it (compare the fingerprint with the server's owner)"
            )
        if identity is not None and not identity.is_file():
            raise ExchangeError(f"{identity}: no such file; it must hold our private key")
        options = [
            "BatchMode=yes",
            "LogLevel=ERROR",
            "StrictHostKeyChecking=yes",
            f"UserKnownHostsFile={known_hosts}",
            "GlobalKnownHostsFile=/dev/null",
            "UpdateHostKeys=no",
            "ConnectTimeout=20",
            "ServerAliveInterval=10",
            "ServerAliveCountMax=3",
            "PasswordAuthentication=no",
            *([f"IdentityFile={identity}", "IdentitiesOnly=yes"] if identity else []),
        ]
        user = f"{address.user}@" if address.user else ""
        self._command = ["sftp", "-F", "/dev/null", "-b", "-", "-P", str(address.port)]
        self._command += [word for option in options for word in ("-o", option)]
        self._command += ["--", user + address.host]

    def entries(self, folder: str) -> list[Entry]:
        """Return the files directly in `folder`, by name."""
        return [entry for entry in self._listing(folder) if not entry.name.startswith(".")]

    def get(self, path: str, largest: int) -> bytes | None:
        """Return a file's content, or None."""
        folder, name = posixpath.split(path)
        size = next((entry.size for entry in self._listing(folder) if entry.name == name), None)
        if size is None:
            return None
        if size > largest:
            raise ExchangeError(f"{self._address}/{path}: more than {largest} bytes")
        with tempfile.TemporaryDirectory() as scratch:
            target = Path(scratch) / "file"
            self._run([f"get {_quoted(self._remote(path))} {_quoted(str(target))}"])
            # The size was the server's own word.
            with target.open("rb") as file:
                content = file.read(largest + 1)
        if len(content) > largest:
            raise ExchangeError(f"{self._address}/{path}: more than {largest} bytes")
        return content

    def put(self, path: str, content: bytes) -> None:
        """Write a file, going on where an earlier attempt was cut off."""
        folder, name = posixpath.split(path)
        part = self._remote(posixpath.join(folder, f".{name}.part"))
        begun = next((entry.size for entry in self._listing(folder) if entry.name == f".{name}.part"), None)
        with tempfile.TemporaryDirectory() as scratch:
            source = Path(scratch) / "file"
            source.write_bytes(content)
            # Only a file whose name holds its digest can be gone on with: any other may have changed since.
            resumes = begun is not None and begun < len(content) and re.search("[0-9a-f]{64}", name)
            commands = [f"{'reput' if resumes else 'put'} {_quoted(str(source))} {_quoted(part)}"]
            if begun is None:
                commands = [f"-mkdir {_quoted(self._remote(one))}" for one in _parents(folder)] + commands
            self._run([*commands, f"rename {_quoted(part)} {_quoted(self._remote(path))}"])

    def delete(self, path: str) -> None:
        """Delete a file."""
        self._run([f"-rm {_quoted(self._remote(path))}"])

    def _listing(self, folder: str) -> list[Entry]:
        """Return all files in a folder, those of unfinished uploads too."""
        # The dash before `ls`: a folder that is not there is an empty one.
        text = self._run([f"-ls -lan {_quoted(self._remote(folder))}"])
        found = [match for match in map(_LINE.fullmatch, text.splitlines()) if match]
        return sorted((Entry(posixpath.basename(m[2]), int(m[1])) for m in found), key=lambda entry: entry.name)

    def _remote(self, path: str) -> str:
        return posixpath.join(self._address.path, path)

    def _run(self, commands: Sequence[str]) -> str:
        try:
            done = subprocess.run(
                self._command,
                input="\n".join(commands) + "\n",
                capture_output=True,
                text=True,
                errors="replace",
                timeout=self._timeout,
                check=False,
            )
        except FileNotFoundError:
            raise ExchangeError("no program `sftp` on this machine: install the package openssh-client") from None
        except subprocess.TimeoutExpired:
            raise ExchangeError(f"{self._address}: no end within {self._timeout:g} s") from None
        if done.returncode != 0:
            raise ExchangeError(f"{self._address}: {_reason(done.stderr)}")
        return done.stdout


def _parents(folder: str) -> list[str]:
    parts = folder.split("/")
    return ["/".join(parts[: number + 1]) for number in range(len(parts))] if folder else []


def _quoted(path: str) -> str:
    """Return a path as one word of a batch file; wildcards in it are plain letters."""
    if "\n" in path:
        raise ExchangeError(f"{path!r}: a line break in a file's name")
    return '"' + re.sub(r'([\\"*?\[\]])', r"\\\1", path) + '"'


def _reason(output: str) -> str:
    """Say in one line what OpenSSH said."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    for words, meaning in (
        ("host key is known for", "the file of known hosts lacks the server's key, or has it for another port"),
        ("Host key verification failed", "the server's key is not the pinned one: somebody may be listening in"),
        ("REMOTE HOST IDENTIFICATION", "the server's key is not the pinned one: somebody may be listening in"),
        ("bad permissions", "others may read our private key, which SSH then does not use: chmod 600"),
        ("Load key", "our private key cannot be read: one of OpenSSH without a passphrase is needed"),
        ("Permission denied (publickey", "the server does not know our key"),
        ("No space left", "the server's disk is full"),
    ):
        if any(words in line for line in lines):
            return meaning
    noise = ("Connection closed", "subsystem request", "Couldn't canonicalize", "mkdir", "remote mkdir")
    told = [line for line in lines if not line.startswith(noise)] or lines
    return told[-1][:160] if told else "the connection ended"
