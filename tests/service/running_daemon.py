"""The daemon and the virtual PLC as processes of their own, over a real socket, in a folder of their own."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COMMAND = [sys.executable, "-m", "igrow.edge.cli"]
INTERVAL = 300


class RunningDaemon:
    """A daemon in lock-step with a simulated greenhouse: a cycle is 300 s of plant time."""

    def __init__(self, folder: Path, *, days: int = 90, extra: str = "", begin: str = "2020-01-15") -> None:
        self.folder = folder
        self.state = folder / "state"
        self.daemon: subprocess.Popen[bytes] | None = None
        self.runs = False
        """It was started, and nobody has ended it since."""
        self._environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
        register_map = ROOT / "config" / "register-maps" / "virtual-plc.yaml"
        command = [*COMMAND, "simulate-plc", "--map", str(register_map), "--port", "0"]
        self.plc = subprocess.Popen(
            [*command, "--pace", f"lockstep={INTERVAL}", "--days", str(days), "--start", begin],
            stdout=subprocess.PIPE,
            env=self._environment,
        )
        assert self.plc.stdout is not None
        line = self.plc.stdout.readline().decode()
        port = line.split(",")[0].rsplit(":", 1)[1]
        (folder / "map.yaml").write_text(register_map.read_text().replace("port: 5020", f"port: {port}"))
        self.configuration = folder / "daemon.yaml"
        self.configuration.write_text(
            f"site: {ROOT / 'config' / 'site.yaml'}\nregister_map: map.yaml\nstate: state\nexchange: exchange\n"
            f"cycle:\n  interval: 5 min\n  clock: lockstep\nstatus:\n  port: 0\n{extra}"
        )

    def start(self, **environment: str) -> None:
        """Start the daemon; its log goes to a file."""
        log = (self.folder / "daemon.log").open("ab")
        self.daemon = subprocess.Popen(
            [*COMMAND, "run", str(self.configuration)], stdout=log, stderr=log, env={**self._environment, **environment}
        )
        log.close()
        self.runs = True

    def kill(self) -> None:
        """Kill -9."""
        assert self.daemon is not None
        self.runs = False
        self.daemon.kill()
        self.daemon.wait()

    def stop(self) -> int:
        """Stop as systemd does; returns the exit status."""
        assert self.daemon is not None
        self.runs = False
        self.daemon.send_signal(signal.SIGTERM)
        return self.daemon.wait(60)

    def wait_for(self, condition, seconds: float = 900.0) -> None:
        """Wait until a condition holds; a daemon that was not ended has to live on until then.

        The limit only ends a hang, on however busy a machine.
        """
        until = time.monotonic() + seconds
        while not condition():
            assert not self.runs or self.daemon is None or self.daemon.poll() is None, (
                self.folder / "daemon.log"
            ).read_text()
            assert time.monotonic() < until, (self.folder / "daemon.log").read_text()[-2000:]
            time.sleep(0.05)

    def close(self) -> None:
        """End both processes."""
        for process in (self.daemon, self.plc):
            if process is not None:
                with contextlib.suppress(ProcessLookupError):
                    process.kill()
                process.wait()
        if self.plc.stdout is not None:
            self.plc.stdout.close()


def resident_bytes(pid: int) -> int:
    """Return the resident memory of a process."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def open_files(pid: int) -> int:
    """Return the number of open file handles of a process."""
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))
