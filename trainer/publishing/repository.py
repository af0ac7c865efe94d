"""The signed repository of a site's bundles (The Update Framework), written so that a reader always sees a whole one.

It lies in the exchange, `<site>/bundles`, so that a site sees its own bundle and no other's, and what it fetches does
not grow with the number of sites. There is one target, `<site>.tar`, whose content changes with each publication;
versions of the metadata only grow, which is what protects gateways from being given an older one. Files are written in
the order target, targets, snapshot, timestamp: whoever reads in between still sees the state before.

Who can write to the exchange cannot make us sign for them: of what is read from there only version numbers are used,
and for a refresh what our present key has signed.
"""

from __future__ import annotations

import io
import tarfile
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from tuf.api.exceptions import RepositoryError
from tuf.api.metadata import (  # type: ignore[attr-defined]  # the documented place; it does not list them
    Metadata,
    MetaFile,
    Snapshot,
    TargetFile,
    Targets,
    Timestamp,
)
from tuf.api.serialization import DeserializationError

from igrow.core.bundle import Bundle, read_bundle, self_test
from igrow.core.exchange import ExchangeError, FolderPlace, Place
from igrow.core.exchange.documents import LARGEST_DOCUMENT
from igrow.core.exchange.signed_files import signed_files
from igrow.trainer.publishing.keys import SERIALIZER, PublishingError, load_root, load_signer, root_versions

KEPT_VERSIONS = 8
"""Old versions of targets and snapshot that stay for gateways that are reading them."""
LIFETIMES = {"targets": timedelta(days=365), "snapshot": timedelta(days=60), "timestamp": timedelta(days=60)}
"""How long signed metadata holds; a gateway that sees no newer ones then stops to accept updates."""


def initialise(repository: Place | Path, keys: Path, *, now: datetime | None = None) -> None:
    """Create an empty signed repository. Raises PublishingError where there is one already."""
    place = _place(repository)
    if place.get("metadata/timestamp.json", LARGEST_DOCUMENT) is not None:
        raise PublishingError(f"{repository}: the repository exists already")
    now = now or datetime.now(UTC)
    _write_roots(place, keys)
    _sign_and_write(Metadata(Targets(expires=_expiry(now, "targets"))), place, keys, "targets", "1.targets.json")
    _write_chain(place, keys, 1, now)


def publish_in(bundle: Path, repository: Place | Path, keys: Path, *, now: datetime | None = None) -> Bundle:
    """Test, pack, sign and publish a bundle for the site that its manifest names; a missing repository is made.

    Raises BundleError where the bundle fails its self-test and PublishingError where the repository cannot be
    read.
    """
    read = read_bundle(bundle)
    self_test(read)
    place = _place(repository)
    now = now or datetime.now(UTC)
    if place.get("metadata/timestamp.json", LARGEST_DOCUMENT) is None:
        initialise(place, keys, now=now)
    _write_roots(place, keys)
    content = _pack(read)
    name = f"{read.manifest.site}.tar"
    target = TargetFile.from_data(name, content)
    target.unrecognized_fields["custom"] = {"identity": read.identity, "label": read.label}
    before = _named(place, keys)
    place.put(f"targets/{target.hashes['sha256']}.{name}", content)
    # Nothing of the targets before goes into these but their number: whoever wrote them, we sign what we publish.
    version = _newest_version(place, "targets") + 1
    targets = Targets(version, expires=_expiry(now, "targets"), targets={name: target})
    _sign_and_write(Metadata(targets), place, keys, "targets", f"{version}.targets.json")
    _write_chain(place, keys, version, now)
    _forget_old(place, {f"{target.hashes['sha256']}.{name}", *before})
    return read


def refresh(repository: Place | Path, keys: Path, *, now: datetime | None = None) -> datetime:
    """Sign snapshot and timestamp again with a new expiry; needs these two keys only.

    Returns until when gateways take all that is signed: what names the bundle holds as long as it did.

    Raises PublishingError where the present key did not sign the newest bundle, or signed it too long ago: it must be
    published again.
    """
    place = _place(repository)
    now = now or datetime.now(UTC)
    _write_roots(place, keys)
    targets, root = _load_targets(place, keys), load_root(keys).signed
    if root.expires <= now:
        name = f"{keys}/{root.version}.root.json"
        raise PublishingError(f"{name}: has expired, and gateways take nothing: `igrow-trainer keys renew {keys}`")
    if targets.expires <= now:
        raise PublishingError(
            f"{place}/metadata/{targets.version}.targets.json: has expired on {targets.expires:%Y-%m-%d}, and only "
            "publishing the bundle again renews it"
        )
    _write_chain(place, keys, targets.version, now)
    return min(targets.expires, root.expires, _expiry(now, "timestamp"))


def targets_hold_until(repository: Place | Path, keys: Path) -> datetime:
    """Return until when what names a site's bundle holds, which no refresh prolongs; raises PublishingError."""
    return _load_targets(_place(repository), keys).expires


def lacks_root(repository: Place | Path, keys: Path) -> bool:
    """Tell whether keys were replaced or the root was renewed since a repository was signed."""
    newest = max(root_versions(keys), default=0)
    return bool(newest) and _place(repository).get(f"metadata/{newest}.root.json", LARGEST_DOCUMENT) is None


def _write_roots(place: Place, keys: Path) -> None:
    """Write the versions of the root metadata that the repository lacks.

    Gateways follow those that are there. Raises PublishingError where that leads them to other keys than these.
    """
    ours = root_versions(keys)
    for version, path in sorted(ours.items()):
        name, content = f"metadata/{version}.root.json", path.read_bytes()
        there = place.get(name, LARGEST_DOCUMENT)
        if there is None:
            place.put(name, content)
        elif there != content:
            raise PublishingError(
                f"{place}/{name}: is of other keys than {keys}, and gateways take nothing that these sign: publish "
                f"with those; where they are lost, delete {place} and install {keys}/1.root.json on the gateway"
            )
    name = f"metadata/{max(ours, default=0) + 1}.root.json"
    if ours and place.get(name, LARGEST_DOCUMENT) is not None:
        raise PublishingError(f"{place}/{name}: is newer than {keys}, whose keys were replaced: take the newest copy")


def _write_chain(place: Place, keys: Path, targets: int, now: datetime) -> None:
    """Write a snapshot that names this version of targets, then a timestamp that names the snapshot."""
    version = _newest_version(place, "snapshot") + 1
    meta = {"targets.json": MetaFile(targets)}
    snapshot = Snapshot(version, expires=_expiry(now, "snapshot"), meta=meta)
    _sign_and_write(Metadata(snapshot), place, keys, "snapshot", f"{version}.snapshot.json")
    timestamp = Timestamp(version, expires=_expiry(now, "timestamp"), snapshot_meta=MetaFile(version))
    _sign_and_write(Metadata(timestamp), place, keys, "timestamp", "timestamp.json")


def _newest_version(place: Place, role: str) -> int:
    """Return the newest version of targets or snapshot that is there, 0 where there is none.

    What the present timestamp leads to counts too: a listing may show a part, and no version may be given twice.
    """
    names = [entry.name.split(".")[0] for entry in place.entries("metadata") if entry.name.endswith(f".{role}.json")]
    numbers = [int(number) for number in names if number.isdigit() and len(number) < 10]
    stamp = place.get("metadata/timestamp.json", LARGEST_DOCUMENT)
    if stamp is not None:
        with suppress(ExchangeError):
            signed = signed_files(place, stamp)
            numbers.append(signed.targets if role == "targets" else signed.snapshot)
    return max(numbers, default=0)


def _load_targets(place: Place, keys: Path) -> Targets:
    """Return the newest targets, which must be signed by the key that signs today; raises PublishingError."""
    version = _newest_version(place, "targets")
    if not version:
        raise PublishingError(f"{place}: no repository of bundles here; publish a bundle first")
    name = f"metadata/{version}.targets.json"
    try:
        metadata: Metadata[Targets] = Metadata[Targets].from_bytes(place.get(name, LARGEST_DOCUMENT) or b"")
    except (RepositoryError, DeserializationError):
        raise PublishingError(f"{place}/{name}: damaged; publish the bundle again") from None
    try:
        load_root(keys).signed.verify_delegate("targets", metadata.signed_bytes, metadata.signatures)
    except (RepositoryError, ValueError):
        raise PublishingError(
            f"{place}/{name}: not signed by our present key: the key was replaced, or somebody else wrote it; publish "
            "the bundle again"
        ) from None
    return metadata.signed


def _named(place: Place, keys: Path) -> set[str]:
    """Return the archives that the newest targets name; none where they are not ours."""
    try:
        return {f"{target.hashes['sha256']}.{path}" for path, target in _load_targets(place, keys).targets.items()}
    except PublishingError:
        return set()


def _sign_and_write(metadata: Metadata[Any], place: Place, keys: Path, role: str, name: str) -> None:
    metadata.sign(load_signer(keys / f"{role}.pem"))
    place.put(f"metadata/{name}", metadata.to_bytes(SERIALIZER))


def _forget_old(place: Place, named: set[str]) -> None:
    """Delete packed bundles and metadata that nothing newer names.

    Those of the publication before stay: a gateway that has just read it may still be fetching.
    """
    for entry in place.entries("targets"):
        if entry.name.endswith(".tar") and entry.name not in named:
            place.delete(f"targets/{entry.name}")
    names = [entry.name for entry in place.entries("metadata")]
    for role in ("targets", "snapshot"):
        mine = sorted(
            (name for name in names if name.endswith(f".{role}.json") and name.split(".")[0].isdigit()),
            key=lambda name: int(name.split(".")[0]),
        )
        for name in mine[:-KEPT_VERSIONS]:
            place.delete(f"metadata/{name}")


def _place(repository: Place | Path) -> Place:
    return FolderPlace(repository) if isinstance(repository, Path) else repository


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


def _expiry(now: datetime, role: str) -> datetime:
    return (now + LIFETIMES[role]).astimezone(UTC).replace(microsecond=0)
