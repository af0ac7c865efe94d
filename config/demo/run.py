"""The whole loop on a virtual greenhouse that does something the simulator does not know.

A virtual PLC runs a greenhouse with an undeclared effect; the daemon controls it over Modbus for four weeks of plant
time; the log reaches the trainer, which names the effect and publishes the corrected simulator; the daemon checks it,
runs it in the shadow, adopts it, and goes on for two weeks. Beside it: the same greenhouse under the grower's recipe,
and one without the effect, in which nothing may be found. Every step is a command that a user would type.
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

from ideal import LOG  # noqa: E402  # stands beside this file
from result import summarise  # noqa: E402  # and so does this

WEEKS_BEFORE, DAYS_AFTER, SHADOW_DAYS = 4, 14, 2
EFFECT = "wind_infiltration=0.12"
NOTHING, NAMED = 0, 10


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
        while self.plant_days < day:
            for name in ("virtual-plc", "daemon"):
                if self.running[name].poll() is not None:
                    self.finish(name, self.running[name])
                    raise DemoError(f"{name} ended by itself; see {self.out / name}.log")
            self.say(f"{what}: plant day {self.plant_days} of {day}", end="")
            time.sleep(0.5)
        self.say(f"{what}: {day} plant days")


def main() -> int:
    """Run the demo."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/demo"), help="folder for everything; emptied first")
    parser.add_argument("--effect", default=EFFECT, help=f"NAME=SIZE of what no model knows (default {EFFECT})")
    parser.add_argument("--start", default="2020-02-01", help="first day of plant time, UTC")
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
    out, days_before = demo.out, 7 * WEEKS_BEFORE
    days = days_before + SHADOW_DAYS + DAYS_AFTER
    prepare(demo)
    plant = ["--site", "site.yaml", "--seed", str(demo.seed), "--spread", "0.08", "--start", demo.start]
    plant += ["--weather", str(demo.weather)] if demo.weather else []
    generate = ["igrow-trainer", "generate", *plant]
    demo.say(f"a virtual greenhouse with {demo.effect}, of which no model knows; the daemon takes over")
    demo.spawn(
        "virtual-plc",
        ["igrow-edge", "simulate-plc", *plant, "--map", "register-map.yaml", "--pace", "lockstep",
         "--days", str(days + 3), "--effect", demo.effect],
    )  # fmt: skip
    wait_for_port(demo)
    daemon = demo.spawn("daemon", ["igrow-edge", "run", "daemon.yaml"])
    # What the two greenhouses beside it do needs no daemon; they are simulated meanwhile, without getting in its way.
    beside = {
        "recipe": demo.spawn("recipe", [*generate, "--days", str(days), "--effect", demo.effect, "--out", "recipe"]),
        "nothing": demo.spawn("nothing", [*generate, "--days", str(days_before), "--out", "nothing"]),
    }
    for process in beside.values():
        os.setpriority(os.PRIO_PROCESS, process.pid, 15)
    collect = ["igrow-trainer", "collect", "demo", "--exchange", "exchange", "--state", "trainer"]
    demo.wait_for_day(days_before, "controlled over Modbus with the first bundle")

    # In lock step the plant's time stands still while the daemon does: the trainer's minutes cost no plant time.
    daemon.send_signal(signal.SIGSTOP)
    demo.run("collect", collect)
    verdict = demo.run(
        "diagnose",
        ["igrow-trainer", "diagnose", LOG, "--bundle", "first-bundle", "--site", "site.yaml",
         "--out", "diagnosis"],
        (NOTHING, NAMED, 11, 12, 13),
    )  # fmt: skip
    demo.say(one_line((out / "diagnose.log").read_text()))
    if verdict in (NOTHING, 13):
        raise DemoError(f"the undeclared effect was not found; see {out / 'diagnosis'}")
    demo.run("publish", ["igrow-trainer", "publish", "diagnosis/bundle", "--keys", "keys", "--exchange", "exchange"])
    daemon.send_signal(signal.SIGCONT)
    demo.wait_for_day(days, "shadow run, adoption, control with the corrected bundle")
    for name in ("daemon", "virtual-plc"):
        demo.running[name].send_signal(signal.SIGTERM)
        demo.finish(name, demo.running[name])

    demo.run("collect", collect)
    for name, process in beside.items():
        demo.finish(name, process)
    demo.say("a second greenhouse, with nothing missing")
    nothing = demo.run(
        "nothing-diagnose",
        ["igrow-trainer", "diagnose", "nothing", "--bundle", "first-bundle", "--site", "site.yaml",
         "--out", "nothing-diagnosis"],
        (NOTHING, NAMED, 11, 12, 13),
    )  # fmt: skip
    demo.say(one_line((out / "nothing-diagnose.log").read_text()))
    print()
    print(summarise(out, demo.effect, days_before))
    if nothing != NOTHING:
        raise DemoError("something was found in the greenhouse in which nothing is missing")


def prepare(demo: Demo) -> None:
    """Lay out the folders, make the keys, and export the first bundle for the site."""
    out = demo.out
    shutil.copy(HERE / "site.yaml", out)
    shutil.copy(HERE / "daemon.yaml", out)
    template = (ROOT / "config/register-maps/virtual-plc.yaml").read_text()
    (out / "register-map.yaml").write_text(template.replace("port: 5020", f"port: {free_port()}"))
    demo.run("keys", ["igrow-trainer", "keys", "create", "keys"])
    shutil.copy(out / "keys/1.root.json", out / "root.json")
    # The demo's greenhouse is the one that the built-in bundle was calibrated on.
    demo.run(
        "export",
        ["igrow-trainer", "export", "--site", "site.yaml", "--same-greenhouse", "--out", "first-bundle"],
    )


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
