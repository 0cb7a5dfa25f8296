# SPDX-License-Identifier: Apache-2.0
"""Runs the tests against the mutants: which test reaches which mutant, then which mutant no test
kills."""

import mmap
import os
import resource
import subprocess
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

MUTANTS = 1 << 20       # kMutants of mutant.h
WALL_S = 120.0          # a test that waits for ever
MEMORY_BYTES = 4 << 30  # a mutant that allocates for ever
TIERS_S = (0.01, 0.05, 0.3, 1.0, 1e9)  # the cheapest tests first, those of one tier in one process


@dataclass
class Test:
    program: str
    name: str
    seconds: float = 0.0
    reached: set = field(default_factory=set)


def run(command, environment, cpu_s):
    """@return exit status, negative after a signal; processor time in seconds"""
    process = subprocess.Popen(["nice", *command], env={**os.environ, **environment},
                               stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
    limit = int(cpu_s) + 1
    resource.prlimit(process.pid, resource.RLIMIT_CPU, (limit, limit))
    resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.prlimit(process.pid, resource.RLIMIT_CORE, (0, 0))
    timer = threading.Timer(WALL_S, process.kill)
    timer.start()
    _, status, usage = os.wait4(process.pid, 0)
    timer.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage.ru_utime + usage.ru_stime


def listed_tests(program):
    output = subprocess.run([program, "--gtest_list_tests"], check=True, capture_output=True,
                            text=True).stdout
    names = []
    suite = ""
    for line in output.splitlines():
        if not line.startswith(" "):
            suite = line.split()[0] if line.endswith(".") or ".  #" in line else ""
        elif suite:
            names.append(suite + line.split()[0])
    return [n for n in names if "DISABLED_" not in n]


def observe(program, name, scratch):
    """One test without a mutant: its time, and the mutants that it reaches."""
    with tempfile.NamedTemporaryFile(dir=scratch) as file:
        file.truncate(MUTANTS)
        status, seconds = run([program, f"--gtest_filter={name}"],
                              {"PALPATE_MUTANTS_REACHED": file.name}, 600.0)
        if status != 0:
            raise RuntimeError(f"{os.path.basename(program)} --gtest_filter={name} fails without a "
                               f"mutant, status {status}; mend the test first")
        reached = set()
        with mmap.mmap(file.fileno(), MUTANTS, access=mmap.ACCESS_READ) as bytes_:
            at = bytes_.find(b"\1")
            while at >= 0:
                reached.add(at)
                at = bytes_.find(b"\1", at + 1)
    return Test(program, name, seconds, reached)


def observe_all(programs, leave_out, scratch, jobs):
    """@param leave_out  a regular expression; tests whose name it finds are not run"""
    names = [(p, n) for p in programs for n in listed_tests(p)
             if not (leave_out and leave_out.search(n))]
    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(lambda one: observe(*one, scratch), names))


def batches(mutant, tests):
    """The tests that reach it, one list for each process to start, cheapest first."""
    reaching = [t for t in tests if mutant.number in t.reached]
    low = 0.0
    for high in TIERS_S:
        tier = [t for t in reaching if low <= t.seconds < high]
        programs = sorted({t.program for t in tier},
                          key=lambda p: sum(t.seconds for t in tier if t.program == p))
        for program in programs:
            yield program, [t for t in tier if t.program == program]
        low = high


def verdict(mutant, tests):
    """@return "unreached", "survived", "killed" or "timeout" (killed by it)"""
    result = "unreached"
    for program, batch in batches(mutant, tests):
        result = "survived"
        names = ":".join(t.name for t in batch)
        cpu_s = 1.0 + 4.0 * sum(t.seconds for t in batch)
        status, seconds = run([program, f"--gtest_filter={names}", "--gtest_fail_fast",
                               "--gtest_brief=1"], {"PALPATE_MUTANT": str(mutant.number)}, cpu_s)
        if status != 0:
            return "timeout" if status in (-9, -24) else "killed"
    return result


def verdicts(mutants, tests, jobs, deadline, report):
    """Tries the mutants until `deadline` of time.monotonic(), the rest stays untried.
    @return pairs of mutant and verdict"""
    found = []
    lock = threading.Lock()

    def attempt(mutant):
        if time.monotonic() > deadline:
            return
        result = verdict(mutant, tests)
        with lock:
            found.append((mutant, result))
            report(mutant, result, len(found))

    with ThreadPoolExecutor(jobs) as pool:
        list(pool.map(attempt, mutants))
    return found
