"""Signing keys: Ed25519, as PEM files in a private folder, and the root metadata that says who may sign what.

    root-1.pem, root-2.pem, ...   say who may sign; needed when that changes, and once in ten years. Keep them offline.
    targets.pem                   signs which bundle a site gets; needed to publish
    snapshot.pem, timestamp.pem   sign that this is the newest; needed to publish, and every few weeks to refresh
    1.root.json, 2.root.json, ... what gateways trust; not secret. The first one is installed on each gateway.

A change of a key is a new root version, signed by as many root keys as the one before asks for (its threshold), so that
gateways follow it by themselves. A key that is lost or stolen is replaced so; only the root keys themselves cannot be,
once fewer are left than the threshold.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from securesystemslib.signer import CryptoSigner  # type: ignore[attr-defined]  # the documented place; it lacks __all__
from tuf.api.exceptions import RepositoryError
from tuf.api.metadata import Metadata, Root  # type: ignore[attr-defined]  # the documented place; it lacks __all__
from tuf.api.serialization import DeserializationError
from tuf.api.serialization.json import JSONSerializer

from igrow.core.errors import IgrowError
from igrow.core.whole_files import write_whole

ROLES = ("root", "targets", "snapshot", "timestamp")
"""Root says who may sign; targets which bundles there are; snapshot and timestamp that these are the newest."""
ROOT_LIFETIME = timedelta(days=3650)
SERIALIZER = JSONSerializer(compact=False)
_ROOT_FILE = re.compile(r"(\d+)\.root\.json")


class PublishingError(IgrowError):
    """Keys or a repository that cannot be used, and why."""


@dataclass(frozen=True)
class RoleStatus:
    """One role, for people."""

    role: str
    threshold: int
    keys: int
    present: int
    """Private keys of it that lie in the folder."""


def create_keys(folder: Path, *, root_keys: int = 1, threshold: int = 1) -> Path:
    """Create the keys in `folder`, readable by their owner only; returns the root metadata that gateways get.

    Raises PublishingError where one exists: a lost root key can never be made again.
    """
    if not 1 <= threshold <= root_keys <= 9:
        raise PublishingError(f"{threshold} of {root_keys} root keys: from 1 of 1 to 9 of 9 is right")
    names = [*(f"root-{number}" for number in range(1, root_keys + 1)), *ROLES[1:]]
    for path in [*(folder / f"{name}.pem" for name in names), folder / "1.root.json"]:
        if path.exists():
            raise PublishingError(f"{path}: exists already; a signing key is never overwritten")
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    root = Root(expires=_expiry())
    for name in names:
        role = name.split("-")[0]
        root.add_key(_create(folder / f"{name}.pem").public_key, role)
    root.roles["root"].threshold = threshold
    return _sign_root(root, None, [folder], folder)


def replace_key(role: str, folder: Path, root_folders: Sequence[Path]) -> Path:
    """Replace the key of `role` (not root) by a new one; returns the new root metadata.

    `root_folders` hold root keys, as many as the threshold asks for. Raises PublishingError.
    """
    before = load_root(folder)
    if role not in ROLES[1:]:
        needed = before.signed.roles["root"].threshold
        raise PublishingError(
            f"{role}: targets, snapshot or timestamp can be replaced; root keys are what gateways trust. While "
            f"{needed} of them are safe they sign; else make new keys, and install their 1.root.json on each gateway"
        )
    root = _next(before)
    path = folder / f"{role}.pem"
    fresh = folder / f".{role}.new.pem"
    fresh.unlink(missing_ok=True)
    key = _create(fresh).public_key
    for old in list(root.roles[role].keyids):
        root.revoke_key(old, role)
    root.add_key(key, role)
    written = _sign_root(root, before, root_folders, folder)
    fresh.replace(path)
    return written


def renew_root(folder: Path, root_folders: Sequence[Path]) -> Path:
    """Give the root metadata another ten years; returns the new file. Raises PublishingError."""
    before = load_root(folder)
    return _sign_root(_next(before), before, root_folders, folder)


def take_offline(folder: Path, target: Path) -> list[Path]:
    """Move the root keys to `target`, such as a stick that lies in a safe; returns where they are now.

    Each is copied, read back and only then deleted here. Raises PublishingError and OSError.
    """
    keys = _root_files(folder)
    if not keys:
        raise PublishingError(f"{folder}: no root keys here; they are offline already")
    target.mkdir(parents=True, exist_ok=True, mode=0o700)
    moved = []
    for path in keys:
        copy = target / path.name
        content = path.read_bytes()
        if copy.exists() and copy.read_bytes() != content:
            raise PublishingError(f"{copy}: another key is there")
        if not copy.exists():
            _write_private(copy, content)
        if copy.read_bytes() != content:
            raise PublishingError(f"{copy}: is not what was written; the key stays in {folder}")
        moved.append(copy)
    for path in keys:
        path.unlink()
    return moved


def status(folder: Path) -> tuple[list[RoleStatus], datetime, int]:
    """Return the roles, when the root metadata expires, and its version; raises PublishingError."""
    root = load_root(folder).signed
    mine = {load_signer(path).public_key.keyid for path in sorted(folder.glob("*.pem"))}
    roles = [
        RoleStatus(
            name, root.roles[name].threshold, len(root.roles[name].keyids), len(mine & {*root.roles[name].keyids})
        )
        for name in ROLES
    ]
    return roles, root.expires, root.version


def load_root(folder: Path) -> Metadata[Root]:
    """Return the newest root metadata of a folder of keys; raises PublishingError."""
    versions = root_versions(folder)
    if not versions:
        raise PublishingError(f"{folder}: no root metadata here: `igrow-trainer keys create {folder}` makes keys")
    path = versions[max(versions)]
    try:
        return Metadata[Root].from_file(str(path))
    except (RepositoryError, DeserializationError, OSError):
        raise PublishingError(f"{path}: damaged; put it back from a copy") from None


def root_versions(folder: Path) -> dict[int, Path]:
    """Return the root metadata in a folder of keys: version -> file."""
    found = {path: _ROOT_FILE.fullmatch(path.name) for path in folder.glob("*.root.json")}
    return {int(match[1]): path for path, match in found.items() if match}


def load_signer(path: Path) -> CryptoSigner:
    """Return the signer of one key; raises PublishingError."""
    try:
        key = load_pem_private_key(path.read_bytes(), password=None)
    except OSError as error:
        raise PublishingError(
            f"{path}: {error.strerror}; it is needed to sign (lost: `igrow-trainer keys replace` makes another)"
        ) from None
    except (ValueError, TypeError, UnsupportedAlgorithm):
        raise PublishingError(f"{path}: no unencrypted private key in PEM form") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise PublishingError(f"{path}: expected an Ed25519 key")
    return CryptoSigner(key)


def _next(before: Metadata[Root]) -> Root:
    root = Root.from_dict(before.signed.to_dict())
    root.version += 1
    root.expires = _expiry()
    return root


def _sign_root(root: Root, before: Metadata[Root] | None, folders: Sequence[Path], target: Path) -> Path:
    """Sign a root version with the root keys in `folders` and write it; raises PublishingError for too few of them."""
    metadata: Metadata[Any] = Metadata(root)
    allowed = {*root.roles["root"].keyids, *(before.signed.roles["root"].keyids if before else ())}
    signed = 0
    for folder in folders:
        for path in _root_files(folder):
            signer = load_signer(path)
            if signer.public_key.keyid in allowed and signer.public_key.keyid not in metadata.signatures:
                metadata.sign(signer, append=True)
                signed += 1
    needed = max(root.roles["root"].threshold, before.signed.roles["root"].threshold if before else 0)
    if signed < needed:
        where = ", ".join(str(folder) for folder in folders)
        raise PublishingError(f"root keys in {where}: {signed}, needed to sign: {needed}; give each folder with --root")
    path = target / f"{root.version}.root.json"
    write_whole(path, metadata.to_bytes(SERIALIZER))
    return path


def _root_files(folder: Path) -> list[Path]:
    return sorted(folder.glob("root-*.pem"))


def _create(path: Path) -> CryptoSigner:
    signer = CryptoSigner.generate_ed25519()
    _write_private(path, signer.private_bytes)
    return signer


def _write_private(path: Path, content: bytes) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "wb") as stream:
        stream.write(content)
        stream.flush()
        os.fsync(stream.fileno())


def _expiry() -> datetime:
    return (datetime.now(UTC) + ROOT_LIFETIME).replace(microsecond=0)
