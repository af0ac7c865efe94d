"""`igrow-edge separating-test`: the tests of the plant that tell causes apart; the grower approves each one."""

from __future__ import annotations

import argparse
import getpass
from datetime import timedelta
from pathlib import Path

from igrow.core.separating_tests import SEPARATING_TESTS
from igrow.core.yaml_scalars import duration
from igrow.edge.cli.common import configuration_of
from igrow.edge.configuration import Configuration
from igrow.edge.separating_tests import approval_file, approve, obstacles, read_approval, withdraw

EXAMPLE = "igrow-edge separating-test /etc/igrow/daemon.yaml --approve vent_square_wave"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("configuration", type=Path, help="the daemon's YAML file")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--approve", metavar="TEST", help="let the daemon run this test once, when its weather comes")
    what.add_argument("--withdraw", action="store_true", help="end the approved test, also while it runs")
    parser.add_argument("--by", default=None, help="who says so (default: the user)")


def run(options: argparse.Namespace) -> int:
    """List tests, approve one, or withdraw it; a running daemon sees it in its next cycle."""
    configuration, by = configuration_of(options), options.by or getpass.getuser()
    if options.approve is not None:
        approval = approve(configuration, options.approve, by=by)
        print(f"{approval.test} is approved: it runs once, within {duration(timedelta(seconds=approval.seconds))}")
        print("it begins when its weather comes; `igrow-edge status` says what it waits for")
    elif options.withdraw:
        withdrawn = withdraw(configuration, by=by)
        print("no test is approved" if withdrawn is None else f"{withdrawn.test} is withdrawn")
    else:
        print("\n".join(_listed(configuration)))
    return 0


def _listed(configuration: Configuration) -> list[str]:
    """Return a line or two on each test, and how the approved one stands."""
    lines = []
    for name, obstacle in obstacles(configuration).items():
        test = SEPARATING_TESTS[name]
        what = f"{test.title}; {test.minutes:.0f} min by {test.when}"
        lines.append(f"{name}: {what}; tells {', '.join(test.separates)}")
        lines.append(f"  not here: {obstacle}" if obstacle else "  may be approved")
    approval = read_approval(approval_file(configuration.state_folder))
    if approval is not None:
        how = approval.ended or ("it runs" if approval.begun is not None else "it waits for its weather")
        lines.append(f"approved last: {approval.test}, by {approval.by}: {how}")
    return lines
