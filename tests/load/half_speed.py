#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Takes half of every processor's time from all programs, real-time ones too, until it is ended: 0.2 ms in
0.4 ms on each, at the highest real-time priority. Needs permission for that (root)."""

import os
import signal
import time

SLICE_S = 200e-6


def take_half(processor: int) -> None:
    os.sched_setaffinity(0, {processor})
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(os.sched_get_priority_max(os.SCHED_FIFO)))
    begin = time.perf_counter()
    busy_s = 0.0
    while True:
        woken = time.perf_counter()
        while time.perf_counter() < woken + SLICE_S:
            pass
        busy_s += time.perf_counter() - woken
        time.sleep(max(0.0, begin + 2.0 * busy_s - time.perf_counter()))


def main() -> None:
    signal.signal(signal.SIGTERM, lambda *_: os.killpg(0, signal.SIGKILL))
    os.setpgid(0, 0)
    children = []
    for processor in os.sched_getaffinity(0):
        child = os.fork()
        if child == 0:
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            take_half(processor)
        children.append(child)
    os.waitpid(children[0], 0)
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    main()
