"""The whole loop on a virtual greenhouse in which something breaks that the simulator does not know.

The first bundle is calibrated on four weeks of the greenhouse's own log, and its season planned. A daemon then controls
it over Modbus, and all is well, until on a given day something breaks: the prediction error climbs. Two weeks later the
trainer reads the log, names what is missing and since when, and publishes the corrected simulator; the daemon checks
it, runs it in the shadow and adopts it, and the error falls. Beside it: the same greenhouse under the grower's recipe,
and had nothing broken, when nothing may be found. Every step is a command that a user would type.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from igrow.core.quantities import WEATHER
from igrow.core.telemetry import write_csv
from igrow.trainer.data import read_log

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BIN = Path(sys.executable).parent
sys.path.insert(0, str(HERE))

from result import Days, summarise  # noqa: E402  # stands beside this file

WEEKS_BEFORE = 4
"""Of log, on which the first bundle is calibrated."""
WELL_DAYS, BROKEN_DAYS, SHADOW_DAYS, DAYS_AFTER = 7, 14, 2, 6
GENERATIONS = 18
"""Of the season's search, half as many as by default: it nets some percent less and takes half the time."""
EFFECT = "wind_infiltration=0.12"
LOG = "trainer/archive/telemetry/site=demo"
"""Where the trainer collects what the daemon leaves in the exchange."""
VERDICTS = NOTHING, _NAMED, _AMBIGUOUS, _UNEXPLAINED, DATA_FAULT = 0, 10, 11, 12, 13
"""Exit codes of a diagnosis."""


class DemoError(Exception):
    """A step of the demo went wrong; the message says which and where its output stands."""


@dataclass
class Demo:
    """One run: its folder, its processes, its options."""

    out: Path
    effect: str
    start: str
    seed: int
    weather: Path | None
    began: float = field(default_factory=time.monotonic)
    running: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def say(self, text: str, *, end: str = "\n") -> None:
        """Print a line with the time since the beginning."""
        print(f"\r[{time.monotonic() - self.began:4.0f} s] {text:<100}", end=end, flush=True)

    def spawn(self, name: str, command: Sequence[str]) -> subprocess.Popen[bytes]:
        """Start a command in the background, its output in a file of its name."""
        environment = dict(os.environ, OMP_NUM_THREADS="1")
        with (self.out / f"{name}.log").open("wb") as log:
            process = subprocess.Popen(
                [str(BIN / command[0]), *command[1:]], cwd=self.out, stdout=log, stderr=log, env=environment
            )
        self.running[name] = process
        return process

    def run(self, name: str, command: Sequence[str], allowed: Sequence[int] = (0,)) -> int:
        """Run a command to its end; returns its exit code."""
        self.say("$ " + " ".join(command))
        return self.finish(name, self.spawn(name, command), allowed)

    def finish(self, name: str, process: subprocess.Popen[bytes], allowed: Sequence[int] = (0,)) -> int:
        """Wait for a command; raises DemoError for an exit code that is not expected."""
        code = process.wait()
        self.running.pop(name, None)
        if code not in allowed:
            tail = (self.out / f"{name}.log").read_text(errors="replace").strip().splitlines()[-5:]
            raise DemoError(f"{name} ended with code {code}: " + " / ".join(tail))
        return code

    def stop(self) -> None:
        """End whatever still runs."""
        for process in self.running.values():
            process.send_signal(signal.SIGCONT)
            process.terminate()
        for process in self.running.values():
            process.wait()

    @property
    def plant(self) -> list[str]:
        """Arguments of the one greenhouse, whoever simulates it."""
        weather = ["--weather", str(self.weather)] if self.weather else []
        return ["--site", "site.yaml", "--seed", str(self.seed), "--spread", "0.08", *weather]

    def day(self, number: int) -> str:
        """Return the date of a day, counted from the daemon's first."""
        return str(np.datetime64(self.start, "D") + np.timedelta64(number, "D"))

    @property
    def plant_days(self) -> int:
        """Whole days of plant time that the daemon has handed over."""
        try:
            through = json.loads((self.out / "state/exchange/chain.json").read_text())["through"]
        except (OSError, ValueError):
            return 0
        # A day's last row is of some minutes before its end.
        return max(0, int(through + 3600 - np.datetime64(self.start, "s").astype(int)) // 86_400)

    def wait_for_day(self, day: int, what: str) -> None:
        """Show the plant's days pass until so many have been handed over."""
        shown = -1
        while (passed := self.plant_days) < day:
            for name in ("virtual-plc", "daemon"):
                if self.running[name].poll() is not None:
                    self.finish(name, self.running[name])
                    raise DemoError(f"{name} ended by itself; see {self.out / name}.log")
            if passed != shown:
                self.say(f"{what}: plant day {passed} of {day}", end="")
                shown = passed
            time.sleep(0.5)
        self.say(f"{what}: {day} plant days")


def main() -> int:
    """Run the demo."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/demo"), help="folder for everything; emptied first")
    parser.add_argument("--effect", default=EFFECT, help=f"NAME=SIZE of what no model knows (default {EFFECT})")
    parser.add_argument("--start", default="2020-02-01", help="the daemon's first day of plant time, UTC")
    parser.add_argument("--seed", type=int, default=1, help="of weather, plant, disturbances and noise")
    parser.add_argument("--weather", type=Path, help="telemetry file or data set with measured weather")
    options = parser.parse_args()
    out = options.out.resolve()
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    weather = None if options.weather is None else measured_weather(options.weather, out)
    demo = Demo(out, options.effect, options.start, options.seed, weather)
    try:
        run(demo)
    except DemoError as error:
        print(f"\nerror: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130
    finally:
        demo.stop()
    return 0


def run(demo: Demo) -> None:
    """The story, step by step."""
    days = WELL_DAYS + BROKEN_DAYS + SHADOW_DAYS + DAYS_AFTER
    broken = f"{demo.effect}@{demo.day(WELL_DAYS)}"
    lay_out(demo)
    # What the greenhouse beside it does needs no daemon; it is simulated meanwhile, without getting in its way.
    generate = ["igrow-trainer", "generate", *demo.plant, "--start", demo.start]
    nothing = demo.spawn("nothing", [*generate, "--days", str(WELL_DAYS + BROKEN_DAYS), "--out", "nothing"])
    recipe = demo.spawn("recipe", [*generate, "--days", str(days), "--effect", broken, "--out", "recipe"])
    for process in (nothing, recipe):
        give_way(process)
    make_first_bundle(demo)

    demo.say(f"the daemon takes over; on day {WELL_DAYS} something breaks that no model knows: {demo.effect}")
    demo.spawn(
        "virtual-plc",
        ["igrow-edge", "simulate-plc", *demo.plant, "--start", demo.start, "--map", "register-map.yaml",
         "--pace", "lockstep", "--days", str(days + 3), "--effect", broken],
    )  # fmt: skip
    wait_for_port(demo)
    daemon = demo.spawn("daemon", ["igrow-edge", "run", "daemon.yaml"])
    collect = ["igrow-trainer", "collect", "demo", "--exchange", "exchange", "--state", "trainer"]
    demo.wait_for_day(WELL_DAYS, "all is well")
    demo.wait_for_day(WELL_DAYS + BROKEN_DAYS, "and then it is not")

    # In lock step the plant's time stands still while the daemon does: the trainer's minutes cost no plant time.
    daemon.send_signal(signal.SIGSTOP)
    demo.run("collect", collect)
    verdict = demo.run(
        "diagnose",
        ["igrow-trainer", "diagnose", LOG, "--bundle", "first-bundle", "--site", "site.yaml", "--out", "diagnosis",
         "--truth", broken],
        VERDICTS,
    )  # fmt: skip
    demo.say(one_line((demo.out / "diagnose.log").read_text()))
    if verdict in (NOTHING, DATA_FAULT):
        raise DemoError(f"the undeclared effect was not found; see {demo.out / 'diagnosis'}")
    demo.run("publish", ["igrow-trainer", "publish", "diagnosis/bundle", "--keys", "keys", "--exchange", "exchange"])
    daemon.send_signal(signal.SIGCONT)
    demo.finish("nothing", nothing)
    quiet = demo.spawn(
        "nothing-diagnose",
        ["igrow-trainer", "diagnose", "nothing", "--bundle", "first-bundle", "--site", "site.yaml",
         "--out", "nothing-diagnosis"],
    )  # fmt: skip
    give_way(quiet)
    demo.wait_for_day(days, "shadow run, adoption, control with the corrected bundle")
    for name in ("daemon", "virtual-plc"):
        demo.running[name].send_signal(signal.SIGTERM)
        demo.finish(name, demo.running[name])

    demo.run("collect", collect)
    demo.finish("recipe", recipe)
    verdict = demo.finish("nothing-diagnose", quiet, VERDICTS)
    demo.say("the same greenhouse, had nothing broken")
    demo.say(one_line((demo.out / "nothing-diagnose.log").read_text()))
    print()
    print(summarise(demo.out, demo.effect, Days(WELL_DAYS, WELL_DAYS + BROKEN_DAYS)))
    if verdict != NOTHING:
        raise DemoError("something was found in the greenhouse in which nothing is missing")


def lay_out(demo: Demo) -> None:
    """Lay out the folder, and make the keys."""
    out = demo.out
    shutil.copy(HERE / "site.yaml", out)
    shutil.copy(HERE / "daemon.yaml", out)
    template = (ROOT / "config/register-maps/virtual-plc.yaml").read_text()
    (out / "register-map.yaml").write_text(template.replace("port: 5020", f"port: {free_port()}"))
    demo.run("keys", ["igrow-trainer", "keys", "create", "keys"])
    shutil.copy(out / "keys/1.root.json", out / "root.json")


def make_first_bundle(demo: Demo) -> None:
    """Calibrate the first bundle on the greenhouse's own weeks, and plan its season."""
    demo.run(
        "before",
        ["igrow-trainer", "generate", *demo.plant, "--start", demo.day(-7 * WEEKS_BEFORE), "--days",
         str(7 * WEEKS_BEFORE), "--out", "before"],
    )  # fmt: skip
    demo.run("calibrate", ["igrow-trainer", "calibrate", "before", "--site", "site.yaml", "--out", "calibrated"])
    demo.run(
        "season",
        ["igrow-trainer", "season", "--site", "site.yaml", "--bundle", "calibrated", "--generations", str(GENERATIONS),
         "--out", "first-bundle"],
    )  # fmt: skip


def give_way(process: subprocess.Popen[bytes]) -> None:
    """Let a process run on what the others leave of the processor."""
    os.setpriority(os.PRIO_PROCESS, process.pid, 15)


def free_port() -> int:
    """Return a TCP port that nobody listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def measured_weather(source: Path, out: Path) -> Path:
    """Write the weather of a log as one telemetry file, and return its path."""
    log = read_log(source, compartment="Reference" if source.is_dir() else None).telemetry
    path = out / "weather.csv.gz"
    write_csv(path, log.only([name for name in WEATHER if name in log]))
    return path


def wait_for_port(demo: Demo) -> None:
    """Wait until the virtual PLC says that it listens."""
    log = demo.out / "virtual-plc.log"
    while "simulated PLC on" not in log.read_text():
        if demo.running["virtual-plc"].poll() is not None:
            demo.finish("virtual-plc", demo.running["virtual-plc"])
        time.sleep(0.1)


def one_line(text: str) -> str:
    """Return the first line of a command's output that says what was found."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return next((line for line in lines if line.lower().startswith(("verdict", "named", "nothing"))), lines[-1])


if __name__ == "__main__":
    sys.exit(main())
