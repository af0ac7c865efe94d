"""The site's newest bundle from the exchange, as The Update Framework lets it through.

The trust begins with `root.json`, which is installed on the gateway by hand. From there each file must be
signed by a role that the one before names, be no older than what this gateway has seen, and not have expired.
Expiry is judged by the machine's own clock; the caller asks only while that clock can be trusted.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from urllib.parse import quote, unquote, urlsplit

from tuf.api.exceptions import (
    BadVersionNumberError,
    DownloadError,
    DownloadHTTPError,
    ExpiredMetadataError,
    LengthOrHashMismatchError,
    RepositoryError,
    UnsignedMetadataError,
)
from tuf.ngclient.fetcher import FetcherInterface
from tuf.ngclient.updater import Updater

from igrow.edge.clock import EARLIEST_PLAUSIBLE
from igrow.edge.updates.fetched import LARGEST_BUNDLE, Fetched, UpdateError


class _FolderFetcher(FetcherInterface):
    """Reads files where the library expects a web server."""

    def _fetch(self, url: str) -> Iterator[bytes]:
        path = Path(unquote(urlsplit(url).path))
        # A pipe or a device would block or never end.
        if not path.is_file():
            raise DownloadHTTPError(f"no file {path}", 404)
        stream = path.open("rb")

        def chunks() -> Iterator[bytes]:
            with stream:
                while chunk := stream.read(65_536):
                    yield chunk

        return chunks()


class SignedSource:
    """Fetches packed bundles from a signed repository in a folder."""

    def __init__(
        self, repository: Path, state: Path, trusted_root: Path, wall: Callable[[], float] = time.time
    ) -> None:
        self._wall = wall
        self._repository = repository
        self._state = state
        """Where the versions seen so far are remembered; losing it loses the protection from older ones."""
        self._trusted_root = trusted_root

    def fetch(self, site: str, known: Collection[str]) -> Fetched | None:
        """Return the verified archive of the site's newest bundle.

        Returns None where there is none, or where its identity is one of `known`.
        Raises UpdateError in one line for every attack, fault and lack of space.
        """
        if self._wall() < EARLIEST_PLAUSIBLE:
            raise UpdateError("the machine's clock is not set, so nothing can be said to have expired or not")
        try:
            bootstrap = self._trusted_root.read_bytes()
        except OSError as error:
            raise UpdateError(f"{self._trusted_root}: {error.strerror}; install the trainer's root.json") from None
        if not (self._repository / "metadata" / "timestamp.json").is_file():
            return None
        metadata, targets = self._state / "metadata", self._state / "targets"
        try:
            metadata.mkdir(parents=True, exist_ok=True)
            targets.mkdir(parents=True, exist_ok=True)
            base = "file://" + quote(str(self._repository.absolute()))
            updater = Updater(
                str(metadata),
                f"{base}/metadata/",
                str(targets),
                f"{base}/targets/",
                _FolderFetcher(),
                bootstrap=bootstrap,
            )
            updater.refresh()
            target = updater.get_targetinfo(f"{site}.tar")
            if target is None:
                return None
            identity = _identity(target.custom)
            if identity in known:
                return None
            if target.length > LARGEST_BUNDLE:
                raise UpdateError(f"{target.path}: larger than {LARGEST_BUNDLE >> 20} MiB")
            return Fetched(Path(updater.find_cached_target(target) or updater.download_target(target)), identity)
        except (RepositoryError, DownloadError) as error:
            raise UpdateError(f"{self._repository}: {_reason(error)}") from None
        except OSError as error:
            raise UpdateError(f"{self._state}: the bundle cannot be stored: {error.strerror or error}") from None


def _identity(custom: object) -> str:
    return str(custom.get("identity", "")) if isinstance(custom, dict) else ""


def _reason(error: Exception) -> str:
    """Say in the words of an operator what the library refused."""
    text = (str(error).strip().splitlines() or [""])[0][:160]
    kinds: tuple[tuple[type[Exception] | tuple[type[Exception], ...], str], ...] = (
        (
            ExpiredMetadataError,
            "the signatures have expired: `igrow-trainer publish --refresh` at the trainer renews them, or news "
            "is held back",
        ),
        (BadVersionNumberError, "older than what this gateway has already seen (rollback)"),
        (UnsignedMetadataError, "not signed by the keys that this gateway trusts"),
        (LengthOrHashMismatchError, "a file is not the one that was signed (tampered with or cut short)"),
        (DownloadHTTPError, "a file that the signed metadata names is missing"),
        (DownloadError, "a file cannot be read, or is longer than signed"),
    )
    for kind, reason in kinds:
        if isinstance(error, kind):
            return f"{reason} [{text}]"
    return f"refused [{text}]"
