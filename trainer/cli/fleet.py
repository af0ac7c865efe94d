"""`igrow-trainer fleet`: the same work for many sites, and one page that says who needs attention."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from igrow.core.errors import IgrowError
from igrow.trainer.cli.common import utc_now
from igrow.trainer.fleet.overview import SiteRow, overview, utc
from igrow.trainer.fleet.registry import Entry, Registry, load_registry
from igrow.trainer.fleet.runner import run_tasks
from igrow.trainer.fleet.tasks import Ending, Task, TaskOutcome
from igrow.trainer.fleet.work import LEARNED
from igrow.trainer.service import history
from igrow.trainer.service.recalibration import DAYS
from igrow.trainer.service.site_memory import site_folder

EXAMPLE = (
    "igrow-trainer fleet collect /srv/fleet\n"
    "  igrow-trainer fleet recalibrate /srv/fleet             # those that are due; --site NAME for one\n"
    "  igrow-trainer fleet status /srv/fleet --page /var/www/greenhouses"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's actions."""
    actions = parser.add_subparsers(title="actions", dest="action", metavar="ACTION", required=True)
    status = actions.add_parser("status", help="show all sites, who needs attention first")
    collect = actions.add_parser("collect", help="bring what the gateways left into the archive")
    diagnose = actions.add_parser("diagnose", help="diagnose now, publish nothing")
    recalibrate = actions.add_parser("recalibrate", help="diagnose the sites that are due, and publish what is better")
    calibrate = actions.add_parser("calibrate", help="calibrate sites without a bundle of their own, and publish it")
    learn = actions.add_parser(
        "learn", help="learn from the sites that share it where they lie, and what models of them miss"
    )
    publish = actions.add_parser("publish", help="sign again what expires soon")
    for one in (status, collect, diagnose, recalibrate, calibrate, learn, publish):
        one.add_argument("fleet", type=Path, help="folder with fleet.yaml and sites/")
        one.add_argument("--site", action="append", default=[], metavar="NAME", help="only this one; may be repeated")
    status.add_argument("--page", type=Path, metavar="FOLDER", help="write the page and the reports into this folder")
    for one in (diagnose, recalibrate, calibrate, learn):
        one.add_argument("--days", type=int, default=DAYS, help=f"newest days of the log (default {DAYS})")
    collect.add_argument("--take-over", action="store_true", help="go on where another archive has collected so far")
    recalibrate.add_argument("--force", action="store_true", help="also the sites that are not due")
    publish.add_argument("--again", action="store_true", help="publish each site's bundle again, as after a new key")


def run(arguments: argparse.Namespace) -> int:
    """Do the work for each site; returns 1 where one failed, which is tried again at the next run."""
    registry = load_registry(arguments.fleet, arguments.site)
    now = utc_now()
    if arguments.action == "status":
        rows = overview(registry, now)
        print_rows(rows)
        if arguments.page is not None:
            from igrow.trainer.fleet.page import write_page  # noqa: PLC0415

            print(f"wrote {write_page(arguments.page, rows, now)}")
        return 0
    for name, problem in registry.problems.items():
        print(f"{name}: error; {problem}", flush=True)
    entries = [entry for entry in registry.entries if not left_out(entry, arguments.action)]
    for entry in registry.entries if arguments.site else ():
        if why := left_out(entry, arguments.action):
            raise IgrowError(f"{entry.site.name}: {why} ({registry.folder / 'fleet.yaml'})")
    tasks = [make_task(arguments, registry, entry, now) for entry in entries]
    failed = len(registry.problems)
    file = registry.file
    outcomes = run_tasks(tasks, file.backend, workers=file.workers, address=file.ray_address)
    for number, outcome in enumerate(outcomes, 1):
        failed += outcome.ending is not Ending.DONE or outcome.result.get("verdict") == "error"
        remember(registry, arguments.action, outcome, now)
        print(f"[{number}/{len(tasks)}] {sentence(outcome)}", flush=True)
    print(f"{len(tasks) + len(registry.problems)} sites, {failed} failed", file=sys.stderr)
    if arguments.action == "learn":
        print(write_shared(registry, entries))
    return int(failed > 0)


def make_task(arguments: argparse.Namespace, registry: Registry, entry: Entry, now: datetime) -> Task:
    """Return the task of one site."""
    exchange = {
        "url": entry.exchange,
        "base": str(registry.folder.resolve()),
        "known_hosts": registry.path(registry.file.known_hosts),
        "identity": registry.path(registry.file.identity),
    }
    common: dict[str, object] = {"state": str(registry.state.resolve()), "now": now.timestamp()}
    # What was collected is enough to learn.
    common |= {"exchange": exchange} if arguments.action != "learn" else {}
    site, file, keys = entry.site.name, str(entry.file.resolve()), str(registry.keys.resolve())
    asked = vars(arguments)
    days = asked.get("days")
    again = {"file": file, "keys": keys, "days": days}
    population, forward = shared(entry, registry.population), registry.file.forward
    function, own = {
        "collect": ("collect_site", {"site": site, "forward_to": forward, "take_over": asked.get("take_over")}),
        "publish": ("publish_site", {"site": site, "keys": keys, "again": asked.get("again")}),
        "diagnose": ("recalibrate_site", {**again, "publish": False, "force": True}),
        "recalibrate": ("recalibrate_site", {**again, "publish": True, "force": asked.get("force")}),
        "learn": ("learn_from_site", {"file": file, "days": days}),
        "calibrate": ("calibrate_site", {"file": file, "keys": keys, "days": days, "population": population}),
    }[arguments.action]
    limits = registry.file.limits
    return Task(
        entry.site.name,
        f"igrow.trainer.fleet.work:{function}",
        {**common, **own},
        seconds=limits.time.total_seconds(),
        megabytes=limits.memory,
        retries=limits.retries,
    )


def left_out(entry: Entry, action: str) -> str:
    """Return why a site has no task in this action; empty where it has one."""
    if entry.paused:
        return "it is paused"
    return "it does not say learning: true" if action == "learn" and not entry.learning else ""


def shared(entry: Entry, file: Path) -> str | None:
    """Return a file of what sites share, where this one takes part and there is one."""
    return str(file.resolve()) if entry.learning and file.exists() else None


def write_shared(registry: Registry, entries: Sequence[Entry]) -> str:
    """Put together what sites have learned; returns a sentence a file. Raises IgrowError where too few have."""
    from igrow.trainer.fit.population import learn_population, read_learned  # noqa: PLC0415  (status needs no scipy)

    folders = [site_folder(registry.state, entry.site.name) for entry in entries]
    population = learn_population([read_learned(one / LEARNED) for one in folders if (one / LEARNED).exists()])
    population.write(registry.population)
    count = len(population.mean)
    return f"wrote {registry.population}: {count} parameters, effects and patterns of {population.sites} sites"


def remember(registry: Registry, action: str, outcome: TaskOutcome, now: datetime) -> None:
    """Write into a site's history what its task could not write itself."""
    if outcome.ending is Ending.DONE:
        return
    command = "recalibrate" if action == "diagnose" else action
    line = history.Turn(command, outcome.name, now, "error", False, outcome.note).to_json()
    folder = site_folder(registry.state, outcome.name)
    try:
        history.append(folder, line)
    except OSError as error:
        print(f"{outcome.name}: its history cannot be written: {folder}: {error.strerror}", file=sys.stderr, flush=True)


def sentence(outcome: TaskOutcome) -> str:
    """Return what became of one site's task, in one line and one more for each note."""
    cost = f"({outcome.seconds:.1f} s, {outcome.megabytes:.0f} MB)"
    if outcome.ending is not Ending.DONE:
        tried = f" after {outcome.attempts} attempts" if outcome.attempts > 1 else ""
        return f"{outcome.name}: error{tried}; {outcome.note} {cost}"
    result = outcome.result
    if "segments" in result:
        text = f"{result['segments']} segments, {result['rows']} rows"
    else:
        text = "; ".join(str(result[key]) for key in ("verdict", "note") if result.get(key))
    return "\n  ".join([f"{outcome.name}: {text} {cost}", *map(str, result.get("notes", []))])


def print_rows(rows: list[SiteRow]) -> None:
    """Print the table for a terminal."""
    width = max((len(row.site) for row in rows), default=4)
    for row in rows:
        print(f"{row.site:<{width}}  {utc(row.newest) or 'never':<16}  {'; '.join(row.reasons) or 'all is well'}")
