"""From the box to the first plan, as docs/installation.md has it typed: at most five commands, each of them run.

`git clone` and the installation itself need a machine of their own (`systemd/try-on-clean-root.sh`); here the files
that they lay down are taken from the repository, a simulated PLC stands in for the real one, and each service is
started by the line of its unit.
"""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

from igrow.edge.daemon_file import PAGE_PORT
from tests.control.daemon_bench import free_port
from tests.page.page_bench import ROOT, found_in
from tests.patience import PATIENCE

BIN = Path(sys.executable).parent


def typed() -> list[str]:
    """The commands of the documentation, without their comments."""
    text = (ROOT / "docs" / "installation.md").read_text()
    block = found_in(r"(?s)From the box to the first plan.*?```sh\n(.*?)```", text)
    return [line.split("  #")[0].strip() for line in block.splitlines()]


def exec_start(unit: str) -> list[str]:
    """The command that a unit starts."""
    text = (ROOT / "systemd" / f"{unit}.service").read_text()
    return found_in(r"^ExecStart=(.*)$", text).split()


@contextlib.contextmanager
def started(command: list[str], folder: Path, log: str) -> Iterator[subprocess.Popen[bytes]]:
    with (folder / log).open("wb") as output:
        process = subprocess.Popen(command, cwd=folder, stdout=output, stderr=output)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(60)


def plc(folder: Path, pace: str) -> contextlib.AbstractContextManager[subprocess.Popen[bytes]]:
    command = [
        str(BIN / "igrow-edge"),
        "simulate-plc",
        "--site",
        "site.yaml",
        "--map",
        "register-maps/virtual-plc.yaml",
    ]
    return started([*command, "--days", "4", "--pace", pace, "--fallback-after", "4"], folder, "plc.log")


def edited(folder: Path, port: int, page: int) -> Path:
    """What `install.sh` lays down, with what its owner then writes into it."""
    for file in ("daemon.yaml", "site.yaml", "register-maps/virtual-plc.yaml"):
        (folder / file).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / "config" / file, folder / file)
    path, registers = folder / "daemon.yaml", folder / "register-maps" / "virtual-plc.yaml"
    text = path.read_text()
    for before, after in (
        ("state: /var/lib/igrow-edge", "state: state"), ("port: 8420", "port: 0"), ("port: 8421", f"port: {page}"),
        ("interval: 10 s", "interval: 5 min"), ("clock: system", "clock: lockstep"),
    ):  # fmt: skip
        assert before in text
        text = text.replace(before, after)
    path.write_text(text)
    registers.write_text(registers.read_text().replace("port: 5020", f"port: {port}"))
    return path


def page_shows(port: int, text: str) -> str:
    """Look until the page shows a text; returns the page."""
    ends, seen = time.monotonic() + PATIENCE, ""
    while time.monotonic() < ends:
        with contextlib.suppress(OSError, urllib.error.HTTPError):
            seen = str(urllib.request.urlopen(f"http://localhost:{port}/", timeout=60).read().decode())
            if text in seen:
                return seen
        time.sleep(0.5)
    raise AssertionError(f"the page never showed {text!r}; last: {re.sub('<[^>]*>', ' ', seen)[:2000]}")


@pytest.mark.slow
def test_five_commands_lead_from_the_box_to_the_first_plan(tmp_path):
    clone, install, edit, commission, enable = typed()
    assert clone.startswith("git clone ")
    # 2: the script is there, is a script, and lays down the files and units that the next commands name
    script = ROOT / install.removeprefix("sudo sh igrow/")
    subprocess.run(["sh", "-n", str(script)], check=True)
    units = enable.removeprefix("sudo systemctl enable --now ").split()
    assert units == ["igrow-edge", "igrow-page"]
    laid_down = found_in(r"for unit in ([^;]*);", script.read_text()).split()
    assert {f"{unit}.service" for unit in units} <= set(laid_down)
    assert f"\nSocketBindAllow=tcp:{PAGE_PORT}\n" in (ROOT / "systemd" / "igrow-page.service").read_text()
    # 3
    assert edit.split() == ["sudoedit", "/etc/igrow/daemon.yaml", "/etc/igrow/site.yaml"]
    port, page = free_port(), free_port()
    configuration = edited(tmp_path, port, page)
    # 4: the person at the terminal says yes to everything, and this PLC falls back after seconds
    command = commission.removeprefix("sudo -u igrow ").split()
    assert command == ["igrow-edge", "commission"]
    with plc(tmp_path, "realtime"):
        walked = subprocess.run(
            [str(BIN / "igrow-edge"), "commission", str(configuration), "--fallback-after", "4"],
            input="y\n" * 200, text=True, capture_output=True, timeout=PATIENCE, check=False,
        )  # fmt: skip
    assert walked.stdout.rstrip().endswith("all checks were passed"), walked.stdout + walked.stderr
    # 5: by the lines of the units
    with plc(tmp_path, "lockstep=300"), contextlib.ExitStack() as services:
        for unit in units:
            program, *arguments = exec_start(unit)
            assert program == "/opt/igrow/venv/bin/igrow-edge"
            here = [str(configuration) if one == "/etc/igrow/daemon.yaml" else one for one in arguments]
            services.enter_context(started([str(BIN / "igrow-edge"), *here], tmp_path, f"{unit}.log"))
        shown = page_shows(page, "The plan decides")
    assert "The plan is expected to bring" in shown or "are expected to bring the same" in shown
    assert "As your recipe." in shown
