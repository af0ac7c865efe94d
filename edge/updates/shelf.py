"""The bundles on this gateway: unpacked with mistrust, checked, and no more of them than needed."""

from __future__ import annotations

import os
import re
import shutil
import tarfile
from pathlib import Path

from igrow.core.bundle import Bundle, BundleError, read_bundle, self_test
from igrow.core.quantities import QUANTITIES
from igrow.edge.updates.fetched import LARGEST_BUNDLE, BundleRefusedError, UpdateError

SPARE_BYTES = 16 * 2**20
"""Left free on the disk after unpacking, for the log."""


class Shelf:
    """A folder with one folder per bundle, named by the bundle's identity."""

    def __init__(self, folder: Path, *, site: str, igrow_version: str) -> None:
        self._folder = folder
        self._site = site
        self._version = igrow_version

    def path(self, identity: str) -> Path:
        """Return the folder of a bundle, whether it is there or not."""
        return self._folder / identity

    def get(self, identity: str) -> Bundle:
        """Read a bundle again; raises BundleError where it has been damaged since."""
        bundle = read_bundle(self.path(identity))
        if bundle.identity != identity:
            raise BundleError(f"{bundle.folder}: the manifest was changed since it was adopted")
        return bundle

    def put(self, archive: Path) -> Bundle:
        """Unpack and check an archive; returns the bundle in its place.

        Raises UpdateError or BundleError, leaving nothing behind.
        """
        partial = self._folder / ".partial"
        shutil.rmtree(partial, ignore_errors=True)
        try:
            partial.mkdir(parents=True)
            _unpack(archive, partial)
            return self._place(partial, own_site=True)
        except (OSError, tarfile.TarError) as error:
            raise UpdateError(f"{archive.name}: cannot be unpacked: {error}") from None
        finally:
            shutil.rmtree(partial, ignore_errors=True)

    def put_folder(self, folder: Path) -> Bundle:
        """Check a bundle that an operator gives as a folder, and copy it; raises like `put`.

        It may be made for another site: a gateway begins with a default bundle until it has one of its own.
        """
        partial = self._folder / ".partial"
        shutil.rmtree(partial, ignore_errors=True)
        try:
            read_bundle(folder)  # before copying: a wrong folder could be anything
            shutil.copytree(folder, partial)
            return self._place(partial, own_site=False)
        except OSError as error:
            raise UpdateError(f"{folder}: cannot be copied: {error}") from None
        finally:
            shutil.rmtree(partial, ignore_errors=True)

    def keep_only(self, identities: set[str]) -> None:
        """Delete all other bundles."""
        for path in self._folder.glob("*"):
            if path.is_dir() and path.name not in identities:
                shutil.rmtree(path, ignore_errors=True)

    def _place(self, partial: Path, *, own_site: bool) -> Bundle:
        bundle = read_bundle(partial)
        if own_site and bundle.manifest.site != self._site:
            raise BundleRefusedError(
                f"{bundle.label}: made for site {bundle.manifest.site}, this gateway is {self._site}"
            )
        self._check(bundle)
        self_test(bundle)
        final = self.path(bundle.identity)
        if final.exists():
            shutil.rmtree(final)
        partial.rename(final)
        return read_bundle(final)

    def _check(self, bundle: Bundle) -> None:
        """Refuse a bundle that is not meant for this gateway."""
        manifest = bundle.manifest
        if _version(manifest.igrow_version) > _version(self._version):
            raise BundleRefusedError(
                f"{bundle.label}: made by igrow {manifest.igrow_version}, newer than {self._version} here; "
                "update the gateway"
            )
        for graph, signature in manifest.graphs.items():
            for tensor in (*signature.inputs, *signature.outputs):
                for quantity, unit in zip(tensor.quantities, tensor.units, strict=True):
                    known = QUANTITIES.get(quantity)
                    if known is not None and known.unit != unit:
                        raise BundleRefusedError(
                            f"{bundle.label}: {graph}.{tensor.name}: {quantity} in {unit}, expected {known.unit}"
                        )


def _version(text: str) -> tuple[int, ...]:
    """Return major and minor: a patch never changes what a bundle means."""
    found = re.match(r"(\d+)\.(\d+)", text)
    if found is None:
        raise BundleRefusedError(f'"{text}" is no version such as 1.2.3')
    return int(found[1]), int(found[2])


def _unpack(archive: Path, folder: Path) -> None:
    """Extract plain files with plain names; anything else in a bundle is an attack or a fault."""
    total = 0
    with tarfile.open(archive, "r:") as source:
        for member in source:
            name = member.name
            if not member.isreg() or "/" in name or "\\" in name or name.startswith("."):
                raise BundleRefusedError(f"{archive.name}: {name!r} is not a plain file with a plain name")
            total += member.size
            if total > LARGEST_BUNDLE:
                raise BundleRefusedError(f"{archive.name}: more than {LARGEST_BUNDLE >> 20} MiB")
            if shutil.disk_usage(folder).free < member.size + SPARE_BYTES:
                raise UpdateError(f"{archive.name}: not enough space on the disk")
            content = source.extractfile(member)
            assert content is not None
            with (folder / name).open("xb") as target:
                shutil.copyfileobj(content, target)
                target.flush()
                os.fsync(target.fileno())
