"""`igrow-trainer keys`: make the signing keys, take the root offline, replace a key, see what there is."""

from __future__ import annotations

import argparse
from pathlib import Path

from igrow.trainer.publishing.keys import ROLES, create_keys, renew_root, replace_key, status, take_offline

EXAMPLE = (
    "igrow-trainer keys create keys --root-keys 3 --threshold 2   # once; keys/1.root.json goes onto each gateway\n"
    "  igrow-trainer keys offline keys --to /media/stick            # the root keys lie in a safe from now on\n"
    "  igrow-trainer keys show keys\n"
    "  igrow-trainer keys replace keys timestamp --root /media/stick --root /media/other-stick"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's actions."""
    actions = parser.add_subparsers(title="actions", dest="action", metavar="ACTION", required=True)
    create = actions.add_parser("create", help="make all keys, once")
    create.add_argument("--root-keys", type=int, default=1, help="how many root keys there are (default 1)")
    create.add_argument("--threshold", type=int, default=1, help="how many of them must sign (default 1)")
    show = actions.add_parser("show", help="show the roles, which keys are here, and when the root expires")
    offline = actions.add_parser("offline", help="move the root keys out of this folder")
    offline.add_argument("--to", type=Path, required=True, help="a folder on a medium that is kept apart")
    replace = actions.add_parser("replace", help="replace a key that was lost or stolen, or is old")
    renew = actions.add_parser("renew", help="let the root metadata hold for another ten years")
    for one in (create, show, offline, replace, renew):
        one.add_argument("keys", type=Path, help="folder of the signing keys")
    replace.add_argument("role", choices=ROLES, help="whose key; root keys alone stay")
    for one in (replace, renew):
        one.add_argument("--root", type=Path, action="append", help="folder of root keys; may be repeated")


def run(arguments: argparse.Namespace) -> int:
    """Do what the action says."""
    folder: Path = arguments.keys
    if arguments.action == "create":
        root = create_keys(folder, root_keys=arguments.root_keys, threshold=arguments.threshold)
        print(f"made keys in {folder}; install {root} on each gateway as updates.trusted_root")
        print(f"then take the root keys offline: igrow-trainer keys offline {folder} --to FOLDER")
    elif arguments.action == "offline":
        for path in take_offline(folder, arguments.to):
            print(f"moved to {path}")
    elif arguments.action in ("replace", "renew"):
        roots = arguments.root or [folder]
        written = (
            replace_key(arguments.role, folder, roots) if arguments.action == "replace" else renew_root(folder, roots)
        )
        # What the old key of targets has signed no gateway takes any more.
        next_time = "publish" if arguments.action == "replace" and arguments.role == "targets" else "publish or refresh"
        print(f"wrote {written}; gateways follow at the next {next_time} of their site")
    else:
        roles, expires, version = status(folder)
        print(f"root version {version}, holds until {expires:%Y-%m-%d}")
        for one in roles:
            elsewhere = "offline" if one.role == "root" else "not here"
            here = f"{one.present} here" if one.present else elsewhere
            print(f"  {one.role:<10} {one.threshold} of {one.keys} must sign; {here}")
    return 0
