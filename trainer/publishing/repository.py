"""The signed repository of bundles (The Update Framework), written so that a reader always sees a whole one.

Each site has one target, `<site>.tar`, whose content changes with each publication; versions of the metadata
only grow, which is what protects gateways from being given an older one. Files are written in the order
target, targets, snapshot, timestamp: whoever reads in between still sees the state before.
"""

from __future__ import annotations

import io
import tarfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from tuf.api.exceptions import RepositoryError
from tuf.api.metadata import (  # type: ignore[attr-defined]  # the documented place; it does not list them
    Metadata,
    MetaFile,
    Root,
    Snapshot,
    TargetFile,
    Targets,
    Timestamp,
)
from tuf.api.serialization import DeserializationError
from tuf.api.serialization.json import JSONSerializer

from igrow.core.bundle import Bundle, read_bundle, self_test
from igrow.core.whole_files import write_whole
from igrow.trainer.publishing.keys import ROLES, PublishingError, load_signer

_SERIALIZER = JSONSerializer(compact=False)


@dataclass(frozen=True)
class Lifetimes:
    """How long signed metadata holds; a gateway that sees no newer ones then stops to accept updates."""

    root: timedelta = timedelta(days=3650)
    targets: timedelta = timedelta(days=365)
    snapshot: timedelta = timedelta(days=60)
    timestamp: timedelta = timedelta(days=60)


def initialise(
    repository: Path, keys: Path, *, now: datetime | None = None, lifetimes: Lifetimes | None = None
) -> Path:
    """Create an empty signed repository; returns its `1.root.json`, which each gateway gets installed.

    `now` is the time that lifetimes are counted from. Raises PublishingError where there is one already.
    """
    metadata = repository / "metadata"
    path = metadata / "1.root.json"
    if path.exists():
        raise PublishingError(f"{path}: the repository exists already")
    metadata.mkdir(parents=True, exist_ok=True)
    (repository / "targets").mkdir(exist_ok=True)
    now, lifetimes = now or datetime.now(UTC), lifetimes or Lifetimes()
    root = Root(expires=_expiry(now, lifetimes.root))
    for role in ROLES:
        root.add_key(load_signer(keys, role).public_key, role)
    _sign_and_write(Metadata(root), keys, "root", path)
    _write_chain(repository, keys, Targets(expires=_expiry(now, lifetimes.targets)), None, now, lifetimes)
    return path


def publish(
    bundle: Path, repository: Path, keys: Path, *, now: datetime | None = None, lifetimes: Lifetimes | None = None
) -> Bundle:
    """Test, pack, sign and publish a bundle for the site that its manifest names.

    Raises BundleError where the bundle fails its self-test and PublishingError where the repository cannot be
    read.
    """
    read = read_bundle(bundle)
    self_test(read)
    site = read.manifest.site
    now, lifetimes = now or datetime.now(UTC), lifetimes or Lifetimes()
    targets: Targets = _load(repository, "targets")
    content = _pack(read)
    name = f"{site}.tar"
    target = TargetFile.from_data(name, content)
    target.unrecognized_fields["custom"] = {"identity": read.identity, "label": read.label}
    write_whole(repository / "targets" / f"{target.hashes['sha256']}.{name}", content)
    targets.targets[name] = target
    targets.version += 1
    targets.expires = _expiry(now, lifetimes.targets)
    _write_chain(repository, keys, targets, _load(repository, "snapshot"), now, lifetimes)
    _forget_old_targets(repository, targets)
    return read


def refresh(repository: Path, keys: Path, *, now: datetime | None = None, lifetimes: Lifetimes | None = None) -> None:
    """Sign snapshot and timestamp again with a new expiry; needs these two keys only.

    Raises PublishingError.
    """
    now, lifetimes = now or datetime.now(UTC), lifetimes or Lifetimes()
    _write_chain(repository, keys, None, _load(repository, "snapshot"), now, lifetimes)


def _write_chain(
    repository: Path,
    keys: Path,
    targets: Targets | None,
    snapshot: Snapshot | None,
    now: datetime,
    lifetimes: Lifetimes,
) -> None:
    """Write targets (where given), then a snapshot that names it, then a timestamp that names the snapshot."""
    metadata = repository / "metadata"
    version = 1 if snapshot is None else snapshot.version + 1
    meta: Mapping[str, MetaFile] = {} if snapshot is None else snapshot.meta
    if targets is not None:
        _sign_and_write(Metadata(targets), keys, "targets", metadata / f"{targets.version}.targets.json")
        meta = {"targets.json": MetaFile(targets.version)}
    fresh = Snapshot(version, expires=_expiry(now, lifetimes.snapshot), meta=dict(meta))
    _sign_and_write(Metadata(fresh), keys, "snapshot", metadata / f"{version}.snapshot.json")
    timestamp = Timestamp(version, expires=_expiry(now, lifetimes.timestamp), snapshot_meta=MetaFile(version))
    _sign_and_write(Metadata(timestamp), keys, "timestamp", metadata / "timestamp.json")


def _load(repository: Path, role: str) -> Any:
    """Return the newest signed content of targets or snapshot."""
    metadata = repository / "metadata"
    versions = sorted(int(path.name.split(".")[0]) for path in metadata.glob(f"*.{role}.json"))
    if not versions:
        raise PublishingError(f"{repository}: no repository of bundles here; create it first")
    path = metadata / f"{versions[-1]}.{role}.json"
    try:
        return Metadata.from_file(str(path)).signed
    except (RepositoryError, DeserializationError, OSError):
        raise PublishingError(f"{path}: damaged; put it back from a copy of the exchange") from None


def _sign_and_write(metadata: Metadata[Any], keys: Path, role: str, path: Path) -> None:
    metadata.sign(load_signer(keys, role))
    write_whole(path, metadata.to_bytes(_SERIALIZER))


def _forget_old_targets(repository: Path, targets: Targets) -> None:
    """Delete the packed bundles that the metadata no longer names, once they are older than a day.

    A gateway that has just read the metadata before may still be fetching one.
    """
    named = {f"{t.hashes['sha256']}.{name}" for name, t in targets.targets.items()}
    for path in (repository / "targets").glob("*.tar"):
        age = datetime.now(UTC).timestamp() - path.stat().st_mtime
        if path.name not in named and age > 86_400:
            path.unlink(missing_ok=True)


def _pack(bundle: Bundle) -> bytes:
    """Return the bundle as a tar archive; equal bundles give equal archives."""
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w", format=tarfile.USTAR_FORMAT) as archive:
        for path in sorted(bundle.folder.iterdir()):
            member = tarfile.TarInfo(path.name)
            member.size = path.stat().st_size
            with path.open("rb") as content:
                archive.addfile(member, content)
    return stream.getvalue()


def _expiry(now: datetime, lifetime: timedelta) -> datetime:
    return (now + lifetime).astimezone(UTC).replace(microsecond=0)
