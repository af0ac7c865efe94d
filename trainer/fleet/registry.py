"""The registry: one folder with `fleet.yaml` and a site file for each greenhouse in `sites/`.

The site files are the gateways' own. Nothing is ever written here, so comments and order stay as people made them.
"""

# ruff: noqa: RUF009 - `setting` makes a dataclass field

from __future__ import annotations

import datetime
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.core.site import Site, load_site
from igrow.core.yaml_schema import load, place, setting
from igrow.trainer.service.known_sites import known_sites

_MINUTE = datetime.timedelta(minutes=1)


class Backend(Enum):
    """Where tasks run."""

    PROCESSES = "processes"
    """On this machine."""
    RAY = "ray"
    """On a Ray cluster that shares the folders of this machine."""


@dataclass(frozen=True)
class Limits:
    """What the work for one site may take."""

    time: datetime.timedelta = setting(
        low=_MINUTE / 60, high=datetime.timedelta(days=1), default=30 * _MINUTE, help="longest time"
    )
    memory: int = setting(low=64, high=1_000_000, default=4000, help="largest data segment (MB)")
    retries: int = setting(low=0, high=10, default=2, help="how often work that was killed or cut off is tried again")


@dataclass(frozen=True)
class SiteOptions:
    """What is different for one site."""

    exchange: str | None = setting(default=None, help="an exchange of its own, or null")
    paused: bool = setting(default=False, help="true leaves the site alone")
    learning: bool = setting(
        default=False, help="true: what its calibration says goes to other sites that learn, and theirs to it"
    )


@dataclass(frozen=True)
class FleetFile:
    """`fleet.yaml`."""

    exchange: str = setting(help="where gateways and trainer meet: a folder, sftp://... or s3://...")
    state: str = setting(default="state", help="folder of the archive, the histories and the bundles")
    keys: str = setting(default="keys", help="folder of the signing keys")
    known_hosts: str | None = setting(default=None, help="file with the SFTP server's key, or null: ~/.ssh/known_hosts")
    identity: str | None = setting(default=None, help="file with our private key for SFTP, or null: the user's own")
    backend: Backend = setting(default=Backend.PROCESSES, help="processes or ray")
    workers: int = setting(low=1, high=1000, default=1, help="how many tasks run at once on this machine")
    ray_address: str | None = setting(default=None, help="address of the Ray cluster, or null: one on this machine")
    forward: str | None = setting(default=None, help="a database that collected logs are written to as well, or null")
    limits: Limits = setting(default_factory=Limits, help="limits of the work for one site")
    sites: Mapping[str, SiteOptions] = setting(default_factory=dict, help="options by site name")


@dataclass(frozen=True)
class Entry:
    """One site of the fleet."""

    site: Site
    file: Path
    exchange: str
    paused: bool
    learning: bool


@dataclass(frozen=True)
class Registry:
    """The whole fleet."""

    folder: Path
    file: FleetFile
    entries: tuple[Entry, ...]
    problems: Mapping[str, str]
    """Site files that cannot be read, by the file's name without ending, and sites with options but without a file: the
    error in one line."""

    @property
    def state(self) -> Path:
        """The folder of the archive, the histories and the bundles."""
        return self.folder / self.file.state

    @property
    def keys(self) -> Path:
        """The folder of the signing keys."""
        return self.folder / self.file.keys

    @property
    def population(self) -> Path:
        """The file of what was learned from the sites that share it."""
        return self.state / "population.json"

    def path(self, text: str | None) -> str | None:
        """Return a path of the file, which is relative to the folder."""
        return None if text is None else str(self.folder / text)


def load_registry(folder: Path, only: Sequence[str] = ()) -> Registry:
    """Read the registry; `only` names the sites that are wanted, none of them means all.

    Raises IgrowError for a bad `fleet.yaml` and where `only` has a name that is not there. A bad site file, and options
    of a site that is not there, are that site's problem.
    """
    path = folder / "fleet.yaml"
    file = load(path, FleetFile)
    entries: dict[str, Entry] = {}
    problems: dict[str, str] = {}
    for found in sorted((folder / "sites").glob("*.yaml")):
        try:
            site = load_site(found)
            if site.name in entries:
                raise IgrowError(f"{found}: site {site.name} is in {entries[site.name].file.name} already")
        except IgrowError as error:
            problems[found.stem] = str(error)
            continue
        options = file.sites.get(site.name, SiteOptions())
        entries[site.name] = Entry(site, found, options.exchange or file.exchange, options.paused, options.learning)
    known = {*entries, *problems}
    if not known:
        raise IgrowError(f"{folder / 'sites'}: no site file (*.yaml) in it")
    for name in set(file.sites) - known:
        problems[name] = f"{place(path, 'sites', name)}: no site {name} in {folder / 'sites'}"
    for name in only:
        if name not in known:
            raise IgrowError(f"{name}: no such site in {folder / 'sites'}; {known_sites(name, known)}")
    if only:
        entries = {name: entry for name, entry in entries.items() if name in only}
        problems = {name: problem for name, problem in problems.items() if name in only}
    return Registry(folder, file, tuple(entries.values()), problems)
