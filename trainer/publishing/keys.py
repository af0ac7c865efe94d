"""Signing keys: one Ed25519 key for each role of The Update Framework, as PEM files in a private folder."""

from __future__ import annotations

import os
from pathlib import Path

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from securesystemslib.signer import CryptoSigner  # type: ignore[attr-defined]  # the documented place; it lacks __all__

from igrow.core.errors import IgrowError

ROLES = ("root", "targets", "snapshot", "timestamp")
"""Root says who may sign; targets which bundles there are; snapshot and timestamp that these are the newest."""


class PublishingError(IgrowError):
    """Keys or a repository that cannot be used, and why."""


def create_keys(folder: Path) -> None:
    """Create the four keys in `folder`, readable by their owner only.

    Raises PublishingError where one exists: a lost root key can never be made again.
    """
    for role in ROLES:
        if _path(folder, role).exists():
            raise PublishingError(f"{_path(folder, role)}: exists already; a signing key is never overwritten")
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    for role in ROLES:
        pem = CryptoSigner.generate_ed25519().private_bytes
        descriptor = os.open(_path(folder, role), os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(pem)


def load_signer(folder: Path, role: str) -> CryptoSigner:
    """Return the signer of one role; raises PublishingError where its key cannot be read."""
    path = _path(folder, role)
    try:
        key = load_pem_private_key(path.read_bytes(), password=None)
    except OSError as error:
        raise PublishingError(f"{path}: {error.strerror}; the {role} key is needed to sign") from None
    except (ValueError, TypeError, UnsupportedAlgorithm):
        raise PublishingError(f"{path}: no unencrypted private key in PEM form") from None
    if not isinstance(key, Ed25519PrivateKey):
        raise PublishingError(f"{path}: expected an Ed25519 key")
    return CryptoSigner(key)


def _path(folder: Path, role: str) -> Path:
    return folder / f"{role}.pem"
