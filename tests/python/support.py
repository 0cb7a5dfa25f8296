# SPDX-License-Identifier: Apache-2.0
"""Programs and sessions for the tests of the Python package. $PALPATE_BIN: folder of the programs."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from typing import Any, Callable, Iterator, Optional

import numpy as np

import palpate

from machine import DEADLINE_S

ROOT = Path(__file__).resolve().parents[2]
BIN = Path(os.environ.get("PALPATE_BIN", ROOT / "build/release/bin"))
EXAMPLE = ROOT / "physics_node/python/examples/half_space.py"

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
