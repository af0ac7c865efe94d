"""The page's password: kept as an scrypt hash in the state folder, so that nobody who reads it knows the word."""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
from dataclasses import dataclass
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge.state_file import read_state, write_state

PASSWORD_FILE = "page-password.json"
LEAST_LENGTH = 10
MOST_LENGTH = 256
N, R, P = 2**15, 8, 1
"""Cost of scrypt (RFC 7914): 32 MB and some 0.1 s a try, which is what makes guessing slow."""


@dataclass(frozen=True)
class Password:
    """A hash with what it was made by."""

    salt: bytes
    digest: bytes
    n: int = N
    r: int = R
    p: int = P

    def fits(self, word: str) -> bool:
        """Tell whether it is the hash of `word`; takes some 0.1 s whatever the answer."""
        return hmac.compare_digest(_scrypt(word, self.salt, self.n, self.r, self.p), self.digest)


def hashed(word: str) -> Password:
    """Return the hash of a new password. Raises IgrowError for one that is too short or too long."""
    if not LEAST_LENGTH <= len(word) <= MOST_LENGTH:
        raise IgrowError(f"a password of {len(word)} characters: {LEAST_LENGTH} to {MOST_LENGTH} are right")
    salt = secrets.token_bytes(16)
    return Password(salt, _scrypt(word, salt, N, R, P))


def _scrypt(word: str, salt: bytes, n: int, r: int, p: int) -> bytes:
    return hashlib.scrypt(word.encode(), salt=salt, n=n, r=r, p=p, maxmem=256 * n * r, dklen=32)


def read_password(state_folder: Path) -> Password | None:
    """Return the password of the page; None where there is none, or its file makes no sense."""
    kept = read_state(state_folder / PASSWORD_FILE)
    try:
        costs = [int(str(kept[key])) for key in ("n", "r", "p")]
        found = Password(bytes.fromhex(str(kept["salt"])), bytes.fromhex(str(kept["digest"])), *costs)
    except (KeyError, ValueError):
        return None
    sane = found.n.bit_count() == 1 and 2**14 <= found.n <= 2**18 and 0 < found.r <= 16 and 0 < found.p <= 4
    return found if sane and len(found.digest) == 32 else None


def write_password(state_folder: Path, password: Password) -> None:
    """Keep the password, readable for the folder's owner alone. Raises IgrowError."""
    if not state_folder.is_dir():
        # Made by root, it would shut out the service's own user.
        raise IgrowError(f"{state_folder}: is not there; the daemon makes it when it first starts, set a password then")
    path = state_folder / PASSWORD_FILE
    content = {
        "scheme": "scrypt", "salt": password.salt.hex(), "digest": password.digest.hex(),
        "n": password.n, "r": password.r, "p": password.p,
    }  # fmt: skip
    mask = os.umask(0o177)
    try:
        problem = write_state(path, content)
    finally:
        os.umask(mask)
    if problem:
        raise IgrowError(problem)
    owner = state_folder.stat()
    if os.geteuid() == 0 and owner.st_uid != 0:
        os.chown(path, owner.st_uid, owner.st_gid)


def remove_password(state_folder: Path) -> bool:
    """Forget the password, so that the page only shows; tell whether there was one."""
    path = state_folder / PASSWORD_FILE
    there = path.exists()
    path.unlink(missing_ok=True)
    return there
