"""What tests need that this project does not bring: programs, rights, data sets.

Where something is absent a test is skipped, with a reason that says what to install. Under CI (environment variable
CI) an absent program is a failure: there all were installed, so a skip would hide that nothing was tested. Rights
and data sets are not to be installed; a test that lacks one is skipped everywhere, and pytest prints why.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
from pathlib import Path
from typing import NoReturn

import pytest

ROOT = Path(__file__).resolve().parents[1]


def absent(what: str, remedy: str) -> NoReturn:
    """Skip the test that runs, or fail it under CI."""
    text = f"{what} is absent, so this was not tested: {remedy}"
    if os.environ.get("CI"):
        pytest.fail(text, pytrace=False)
    pytest.skip(text)


def program(name: str, script: str) -> str:
    """Return a program's path; daemons' folders count, which are not on everybody's PATH.

    Args:
        name: of the program.
        script: that installs it, from the repository's root.
    """
    path = shutil.which(name, path=os.environ.get("PATH", "") + ":/usr/sbin:/usr/local/sbin")
    return path or absent(name, f"sh {script}")


def file(path: Path, script: str) -> Path:
    """Return the path of what a script installs or builds."""
    return path if path.exists() else absent(path.name, f"sh {script}")


def package(module: str, extra: str) -> None:
    """Need a module that comes with an optional extra of this project."""
    if importlib.util.find_spec(module) is None:
        absent(module, f"pip install '.[{extra}]'")


def mount_namespace() -> None:
    """Need the right to mount a file system that nobody else sees."""
    if os.geteuid() != 0:
        pytest.skip("mounting a small disk needs root, so this was not tested")
    if subprocess.run(["unshare", "-m", "true"], check=False, capture_output=True).returncode != 0:
        pytest.skip("this machine allows no mount namespaces, so this was not tested")


def data_sets() -> Path:
    """Return the folder of the public greenhouse data sets."""
    folder = Path(os.environ.get("IGROW_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no greenhouse data in {folder}; set IGROW_DATA to the folder that holds agc2019 and the others")
    return folder
