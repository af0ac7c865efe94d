"""The gateway in one file: log and ledger, configuration, bundles, trust and the daemon's memory.

A gateway that broke is replaced by another machine: `igrow-edge restore` there puts everything back where it was. The
archive holds `store.tar.gz` (`igrow.edge.store.backup`), `configuration/` (the daemon's file as `daemon.yaml`, and
those that it names, relative to it) and `state/` (bundles, trust, overrides, manual settings that are respected).
"""

from __future__ import annotations

import os
import shutil
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.edge import store
from igrow.edge.configuration import Configuration, load_configuration
from igrow.edge.page.password import PASSWORD_FILE
from igrow.edge.state_lock import LOCK_FILE, daemon_stopped

STORE, CONFIGURATION, STATE, DAEMON_FILE = "store.tar.gz", "configuration", "state", "daemon.yaml"
_LEFT_OUT = (".part", ".new", "status.json", PASSWORD_FILE)
"""Ends of names of files that are just being written or made anew all the time, and of the page's password."""


class BackupError(IgrowError):
    """A backup cannot be written, or is none."""


def back_up(configuration: Configuration, target: Path) -> list[Path]:
    """Write everything that a new gateway needs to `target`, a .tar.gz; works while the daemon runs.

    The file is readable by its owner alone: a configuration may hold passwords. Returns the files that the
    configuration names and that lie elsewhere, which are not in it. Raises StoreError, BackupError.
    """
    inside, elsewhere = _configuration_files(configuration)
    partial = target.with_name(target.name + ".part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
            packed = store.backup(configuration.store_folder, Path(scratch) / STORE)
            descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
            with os.fdopen(descriptor, "wb") as stream, tarfile.open(fileobj=stream, mode="w:gz") as archive:
                archive.add(packed, arcname=STORE)
                for name, path in inside.items():
                    archive.add(path, arcname=f"{CONFIGURATION}/{name}")
                for path in _state_files(configuration.state_folder):
                    archive.add(path, arcname=f"{STATE}/{path.relative_to(configuration.state_folder)}")
        partial.replace(target)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise BackupError(f"{target}: the backup failed: {error.strerror or error}") from None
    return elsewhere


def put_back(archive: Path, configuration: Path) -> Configuration:
    """Put a backup in place, all of it or nothing of the state; returns the configuration that now holds.

    Args:
        archive: what `back_up` wrote.
        configuration: the daemon's file. Where there is none it comes out of the backup, with those that it names;
            one that is there stays, and says where the state goes.

    Raises:
        BackupError: not a backup, damaged, or something is in the way.
        StoreError: the log or ledger inside is damaged, or one is in the way.
        InUseError: a daemon runs on the state folder.
        SchemaError, ConfigurationError: the configuration has an error.
    """
    if configuration.exists():
        with daemon_stopped(load_configuration(configuration).state_folder):
            pass  # said before a large archive is unpacked in vain
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        try:
            with tarfile.open(archive, "r:gz") as source:
                _unpack(source, scratch)
        except (OSError, EOFError, tarfile.TarError) as error:
            raise BackupError(f"{archive}: the backup cannot be restored: {error}") from None
        if not (scratch / STORE).is_file() or not (scratch / CONFIGURATION / DAEMON_FILE).is_file():
            raise BackupError(f"{archive}: no backup of a gateway: it lacks {STORE} or {CONFIGURATION}/{DAEMON_FILE}")
        if not configuration.exists():
            _place(scratch / CONFIGURATION, configuration.parent, {DAEMON_FILE: configuration.name})
        found = load_configuration(configuration)
        with daemon_stopped(found.state_folder):
            _refuse_to_replace(scratch / STATE, found.state_folder)
            store.restore(scratch / STORE, found.store_folder)
            _place(scratch / STATE, found.state_folder, {})
    return found


def _unpack(source: tarfile.TarFile, folder: Path) -> None:
    """Unpack plain files into a folder; Debian 12's Python has no filter for that yet.

    Raises:
        TarError: a member is none, or lies outside the folder.
    """
    home = folder.resolve()
    for member in source:
        goal = (home / member.name).resolve()
        if not (member.isfile() or member.isdir()) or not goal.is_relative_to(home):
            raise tarfile.TarError(f"{member.name} is no file of a backup")
        content = source.extractfile(member)
        if content is None:
            continue
        goal.parent.mkdir(parents=True, exist_ok=True)
        with content, goal.open("wb") as file:
            shutil.copyfileobj(content, file)
        # Whoever else may read a file, nobody else may write to it.
        goal.chmod(member.mode & 0o755 | 0o600)


def _configuration_files(configuration: Configuration) -> tuple[dict[str, Path], list[Path]]:
    """Return the daemon's file and those in its folder that it names, by their name there, and those elsewhere."""
    home = configuration.path.parent.resolve()
    named = [home / configuration.file.site, home / configuration.file.register_map, configuration.trusted_root]
    paths = [path.resolve() for path in named if path is not None and path.is_file()]
    inside = {str(path.relative_to(home)): path for path in paths if path.is_relative_to(home)}
    return {DAEMON_FILE: configuration.path, **inside}, [path for path in paths if not path.is_relative_to(home)]


def _state_files(folder: Path) -> Iterator[Path]:
    """Yield the files of the daemon's memory beside the store, whole ones only."""
    for path in sorted(folder.rglob("*")):
        relative = path.relative_to(folder)
        beside = relative.parts[0] != "store" and relative.name != LOCK_FILE
        if beside and path.is_file() and not path.is_symlink() and not path.name.endswith(_LEFT_OUT):
            yield path


def _refuse_to_replace(source: Path, folder: Path) -> None:
    """Raise BackupError where a file of the backup is in the folder already."""
    for path in sorted(source.rglob("*")):
        goal = folder / path.relative_to(source)
        if path.is_file() and goal.exists():
            raise BackupError(f"{goal}: exists; move all of {folder} away first")


def _place(source: Path, folder: Path, names: dict[str, str]) -> None:
    """Copy files into a folder, under other names where `names` says so; one that is there stays."""
    for path in sorted(source.rglob("*")):
        relative = str(path.relative_to(source))
        goal = folder / names.get(relative, relative)
        if not path.is_file() or goal.exists():
            continue
        try:
            goal.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, goal)
        except OSError as error:
            raise BackupError(f"{goal}: cannot be written: {error.strerror or error}") from None
