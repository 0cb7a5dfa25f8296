# SPDX-License-Identifier: Apache-2.0
"""Programs and sessions for the tests of the Python package. $PALPATE_BIN: folder of the programs."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path
from typing import Any, Callable, Iterable, Iterator, NamedTuple, Optional

import numpy as np

import palpate

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(os.environ.get("PALPATE_BIN", ROOT / "build/release/bin"))
EXAMPLE = ROOT / "physics_node/python/examples/half_space.py"


class Slowness(NamedTuple):
    """How many times as long as on the reference machine a fixed piece of work takes here."""

    of_processor: float  # by processor time: its speed
    of_machine: float  # by the time that passed: other programs too


def measure_slowness() -> Slowness:
    begin, begin_cpu = time.monotonic(), time.thread_time()
    x = 2463534242
    for _ in range(100_000):
        x ^= (x << 13) & 0xFFFFFFFF
        x ^= x >> 17
        x ^= (x << 5) & 0xFFFFFFFF
    return Slowness((time.thread_time() - begin_cpu) / 0.035, (time.monotonic() - begin) / 0.035)


# For events that must happen; only a failing test waits so long.
DEADLINE_S = 30.0 * 4 * max(1.0, measure_slowness().of_machine)

# Two springs in series, hand and tissue 400 N/m each, 5 mm apart: 1 N. Stiction of 0.1 N may hold the
# hand before or beyond that; the tissue takes half of it. Long periods and leases for busy machines.
RESTING_NEWTON = 1.0
STICTION_NEWTON = 0.05
RESTING = """
device {
  monitor: off
  rate_hz: 200
  lease_us: 12500
  simulated { position_resolution_m: 0 }
  profile { position_resolution_m: 0 }
}
hand {
  stiffness_newton_per_m: 400
  damping_newton_s_per_m: 10
  hold { position_m { z: -0.005 } }
}
mofc { controller: none stale_after_ms: 200 }
realtime { priority: 0 cpu: -1 }
viewer { web { port: 0 } }
"""


# The same for a session with its own device and mofc.
PATIENT = [
    argument
    for setting in ("device.rate_hz=200", "device.lease_us=12500", "mofc.stale_after_ms=200")
    for argument in ("--set", setting)
]


class QuietMachine:
    """Observes the machine, as in tests/support/machine/machine.h: a figure of real time is checked only if the machine
    was quiet all that time.

        with QuietMachine() as machine:
            …
            if machine.may_check("figure"):
    """

    MOST_SLOWNESS = 1.5
    MOST_OTHERS_RATIO = 0.1
    MOST_OTHERS_S = 0.05  # five ticks of the kernel's accounts
    LONGEST_PAUSE_S = 0.02

    def __init__(self) -> None:
        self._slowness = measure_slowness().of_processor
        self._begin = *_processor_times_s(), _own_s()
        self._throttled = _throttled_times()
        self._longest_pause_s = 0.0
        self._has_ended = threading.Event()
        self._thread = threading.Thread(target=self._look)
        self._thread.start()

    def __enter__(self) -> "QuietMachine":
        return self

    def __exit__(self, *exception: object) -> None:
        self._has_ended.set()
        self._thread.join()

    def may_check(self, figure: str) -> bool:
        """Whether the machine was quiet until now. If not, says that `figure` is not checked, and why."""
        why_not = self._disturbance()
        if why_not:
            print(f"\nnot checked: {figure}: the machine was not quiet: {why_not}", file=sys.stderr)
        return not why_not

    def _look(self) -> None:
        while not self._has_ended.is_set():
            due = time.monotonic() + 0.005
            time.sleep(0.005)
            self._longest_pause_s = max(self._longest_pause_s, time.monotonic() - due)

    def _disturbance(self) -> str:
        all_s, busy_s, own_s = (now - begin for now, begin in zip((*_processor_times_s(), _own_s()), self._begin))
        others_s = busy_s - own_s
        others_ratio = others_s / max(0.01, all_s)
        if self._slowness > self.MOST_SLOWNESS:
            return f"the processor takes {self._slowness:.1f} times as long as the reference"
        if others_s > self.MOST_OTHERS_S and others_ratio > self.MOST_OTHERS_RATIO:
            return f"other programs used {100 * others_ratio:.0f} % of the processors"
        if _throttled_times() > self._throttled:
            return "a quota withheld processor time"
        if self._longest_pause_s > self.LONGEST_PAUSE_S:
            return f"the test itself was kept waiting for {1e3 * self._longest_pause_s:.0f} ms"
        return ""


def _ticks_s(ticks: Iterable[str]) -> float:
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


def _processor_times_s() -> tuple[float, float]:
    """Of all processors: in all, and busy, with what a hypervisor took away."""
    ticks = Path("/proc/stat").read_text().split("\n")[0].split()[1:9]
    return _ticks_s(ticks), _ticks_s(ticks[:3] + ticks[5:])


def _own_s() -> float:
    """Processor time of this process and of all that it started, with theirs."""
    parents, used_s = {}, {}
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        with contextlib.suppress(OSError):  # it has ended
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
            parents[int(folder.name)] = int(fields[1])
            used_s[int(folder.name)] = _ticks_s(fields[11:15])

    def is_own(process: int) -> bool:
        return process == os.getpid() or process in parents and is_own(parents[process])

    return sum(used for process, used in used_s.items() if is_own(process))


def _throttled_times() -> int:
    """How often the control group of this process was made to wait for its quota."""
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/cgroup").read_text().splitlines():
            _, controllers, path = line.split(":", 2)
            if controllers and "cpu" not in controllers.split(","):
                continue
            folder = "/sys/fs/cgroup" + ("/cpu" if controllers else "") + path
            for key_value in Path(folder, "cpu.stat").read_text().splitlines():
                if key_value.startswith("nr_throttled "):
                    return int(key_value.split()[1])
    return 0


class TestCase(unittest.TestCase):
    """With a folder for files and one for the ipc files of its sessions."""

    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory(prefix="palpate-")
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        previous = os.environ.get("PALPATE_RUN_DIR")
        os.environ["PALPATE_RUN_DIR"] = str(self.folder / "run")
        self.addCleanup(
            lambda: os.environ.pop("PALPATE_RUN_DIR") if previous is None
            else os.environ.__setitem__("PALPATE_RUN_DIR", previous)
        )

    def session(self, text: str, name: str = "test") -> Path:
        file = self.folder / f"{name}.txtpb"
        file.write_text(f'name: "{name}"\n{text}')
        return file

    def python_session(self, more: str = "", program: Path = EXAMPLE, name: str = "test") -> Path:
        """The hand at rest in the tissue of a Python program."""
        return self.session(
            f'{RESTING}physics {{ rate_hz: 1000 command: ["{sys.executable}", "{program}"] }}\n{more}', name
        )

    @contextlib.contextmanager
    def running(self, program: str, *arguments: object) -> Iterator["Program"]:
        started = Program(self.folder, program, *arguments)
        try:
            yield started
        finally:
            started.end()


class Program:
    """A program of the project, its stderr in a file."""

    def __init__(self, folder: Path, program: str, *arguments: object) -> None:
        self._err = folder / f"{program}.{time.monotonic_ns()}.err"
        with self._err.open("w") as err:
            self.process = subprocess.Popen(
                [str(BIN / program), *map(str, arguments)], stdout=subprocess.DEVNULL, stderr=err
            )

    @property
    def err(self) -> str:
        return self._err.read_text()

    def await_err(self, text: str, count: int = 1) -> str:
        """The rest of the line in which stderr has `text` for the `count`-th time."""

        def found() -> bool:
            return self.err.count(text) >= count and self.err.split(text)[count].find("\n") >= 0

        if not until(lambda: found() or self.process.poll() is not None) or not found():
            raise AssertionError(f"no {text!r}:\n{self.err}")
        return self.err.split(text)[count].split("\n")[0]

    def node(self, name: str, count: int = 1) -> int:
        """Process of the `count`-th start of a node."""
        return int(self.await_err(f"event=node_started node={name} pid=", count))

    def stop(self) -> int:
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(DEADLINE_S)

    def end(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait(DEADLINE_S)


def until(is_so: Callable[[], bool], deadline_s: float = DEADLINE_S) -> bool:
    """Waits until `is_so()`; false at the deadline."""
    end = time.monotonic() + deadline_s
    while time.monotonic() < end:
        if is_so():
            return True
        time.sleep(0.01)
    return False


def recorded(file: Path, topic: str) -> list[Any]:
    """The messages of a topic in a recording, which may still be written."""
    try:
        return [message for _, message in palpate.Recording(file).messages(topic)]
    except palpate.SetupError:
        return []


def force_z_until(telemetry: palpate.Telemetry, is_so: Callable[[np.ndarray], bool]) -> Optional[np.ndarray]:
    """The z components of the force on the hand in the first batch of the device that `is_so`."""
    end = time.monotonic() + DEADLINE_S
    while time.monotonic() < end:
        batch = telemetry.receive(0.5)
        if batch is None or batch.node != "device" or not batch.columns["sequence"].size:
            continue
        force = batch.columns["force_on_hand_newton"][:, 2]
        if is_so(force):
            return force
    return None


def rests(force: np.ndarray) -> bool:
    return bool(np.all(np.abs(force - RESTING_NEWTON) < STICTION_NEWTON))


def is_limp(force: np.ndarray) -> bool:
    return bool(np.all(force == 0.0))
