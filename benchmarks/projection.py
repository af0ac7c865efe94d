"""What a fleet of many sites costs on a Ray cluster of given size, from the seconds of one, and what fails first.

Arithmetic, not a measurement: nothing here says how a cluster behaves. Each part of the work has a bound, and a number
of sites that reaches it; the part with the smallest number fails first.
"""

from __future__ import annotations

from dataclasses import dataclass

DAY, HOUR, WEEK = 86_400.0, 3600.0, 7.0
ROUNDS = 24
"""Collections a day, as docs/fleet.md has them run; one of them finds a sealed day."""
CONNECTIONS = 10.0
"""New connections a second that one OpenSSH server takes with its default MaxStartups, if each takes a second."""
BUCKET = 3500.0
"""Writing requests a second that S3's maker names for one prefix; reading ones have 5500."""
STATUS = 600.0
"""Seconds that the pages of all sites may take."""


@dataclass(frozen=True)
class Costs:
    """Of one site, as measured; seconds are of one core."""

    collecting: float
    """Seconds where a day is there."""
    looking: float
    """Seconds where nothing is."""
    requests: float
    """To the exchange, in a round that finds a day."""
    diagnosing: float
    """Seconds, once a week."""
    megabytes: float
    """Of a process that diagnoses."""
    showing: float
    """Seconds of its row of the page."""


@dataclass(frozen=True)
class Cluster:
    """What is rented."""

    cores: int
    gigabytes: float
    price: float
    """EUR a core and hour."""


def core_seconds(one: Costs) -> float:
    """Return the seconds of one core that a site takes a day."""
    return one.collecting + (ROUNDS - 1) * one.looking + one.diagnosing / WEEK


def bounds(one: Costs, cluster: Cluster) -> list[tuple[float, str]]:
    """Return (number of sites, what reaches its bound there), the smallest number first."""
    tasks = min(cluster.cores, int(1000.0 * cluster.gigabytes / one.megabytes))
    return sorted(
        [
            (tasks * DAY / core_seconds(one), f"processors: {tasks} tasks at once, by cores and memory, all day"),
            (tasks * HOUR / one.looking, "a round each hour, on these cores"),
            (CONNECTIONS * HOUR, f"one SFTP server: {CONNECTIONS:g} new connections a second, one a site and round"),
            (BUCKET * HOUR / one.requests, f"one S3 prefix: {BUCKET:g} requests a second, {one.requests:.0f} a round"),
            (STATUS / one.showing, f"writing the pages of all within {STATUS / 60.0:.0f} minutes, by one process"),
        ]
    )  # fmt: skip


def report(one: Costs, cluster: Cluster, sites: int) -> list[str]:
    """Return the projection, line by line."""
    hours = sites * core_seconds(one) / HOUR
    lines = [
        f"{sites:,} sites, {ROUNDS} rounds a day, a diagnosis a week; {cluster.cores} cores, {cluster.gigabytes:g} GB:",
        f"  {hours:,.0f} core-hours a day, {hours / cluster.cores:.1f} h of the cluster's day, "
        f"{30.0 * hours * cluster.price:,.0f} EUR a month at {cluster.price:g} EUR a core-hour",
        "reaches its bound at (what fails first comes first):",
    ]
    return lines + [f"  {number:>12,.0f} sites  {what}" for number, what in bounds(one, cluster)]
