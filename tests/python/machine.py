# SPDX-License-Identifier: Apache-2.0
"""How fast the machine is on which the tests run, and whether it is quiet, as in tests/support/machine/machine.h."""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
from pathlib import Path
from typing import Iterable, NamedTuple


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


class QuietMachine:
    """Observes the machine: a figure of real time is checked only if the machine was quiet all that time.

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
