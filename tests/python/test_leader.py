# SPDX-License-Identifier: Apache-2.0
"""A leader arm on an emulated Dynamixel bus, as docs/operations/leader_arms.md has it: the loop with the
clamp, what a stopped process leaves, and faults that are named."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from support import BIN, ROOT

EXAMPLES = ROOT / "mofc_node/controllers/examples"
sys.path.insert(0, str(EXAMPLES))
from dynamixel_leader import JOINTS, Follower, clamp_for, teleoperate  # noqa: E402
from palpate_controllers import DynamixelLeader, LeaderFault, LeaderJoint, load  # noqa: E402

LIBRARY = Path(os.environ.get("PALPATE_CONTROLLERS",
                              BIN.parent / "mofc_node/controllers/libpalpate_controllers_c.so"))

# For busy machines: the kernel hands the bytes of a terminal over in a work queue of ordinary priority.
WATCHDOG_UNITS = 50  # 1 s
PATIENT = {"bits_per_second": 4_000_000, "watchdog_units": WATCHDOG_UNITS, "answer_limit_s": 1.0,
           "longest_cycle_s": 1.0}

# What the page's loop does, in a process that is stopped.
PROGRAM = f"""
import sys
sys.path.insert(0, {str(EXAMPLES)!r})
from palpate_controllers import DynamixelLeader, load
from dynamixel_leader import JOINTS
leader = DynamixelLeader(load(sys.argv[1]), JOINTS, sys.argv[2], **{PATIENT!r})
leader.enable()
for k in range(100000):
    leader.read()
    leader.write([0.1] * len(JOINTS))
    if k == 20:
        print("torque", flush=True)
"""


@unittest.skipUnless(LIBRARY.exists() and (BIN / "palpate").exists(), "not built")
class Leader(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory(prefix="palpate-")
        self.addCleanup(folder.cleanup)
        self.port = str(Path(folder.name) / "leader")
        self.library = load(str(LIBRARY))

    def emulate(self, *arguments: str) -> subprocess.Popen:
        emulator = subprocess.Popen(
            [str(BIN / "palpate"), "emulate", "--leader", self.port, *arguments],
            stderr=subprocess.STDOUT, stdout=subprocess.PIPE, text=True)
        self.addCleanup(emulator.stdout.close)
        self.addCleanup(emulator.wait)
        self.addCleanup(emulator.kill)
        until = time.monotonic() + 60.0
        while not os.path.islink(self.port) and time.monotonic() < until:
            time.sleep(0.02)
        return emulator

    def end(self, emulator: subprocess.Popen) -> tuple[float, float]:
        """Least energy in J, and for how long there was no torque in s."""
        emulator.send_signal(signal.SIGINT)
        text = emulator.communicate(timeout=60)[0]
        found = re.search(r"least true energy (\S+) (\S+), no torque for the last (\S+) s", text)
        self.assertIsNotNone(found, text)
        unit = {"nJ": 1e-9, "µJ": 1e-6, "mJ": 1e-3, "J": 1.0}[found[2]]
        return float(found[1]) * unit, float(found[3])

    def test_the_loop_of_the_page_pushes_back(self) -> None:
        emulator = self.emulate()
        with DynamixelLeader(self.library, JOINTS, self.port, **PATIENT) as leader:
            self.assertIn("joint 7 (id 7): XL330-M288", leader.description)
            cycles, share = teleoperate(leader, clamp_for(self.library, leader), Follower(), 3.0)
        self.assertGreater(cycles, 20)
        self.assertGreater(share, 0.05)
        time.sleep(0.2)
        self.assertGreater(self.end(emulator)[1], 0.0)  # closed: limp

    def stop_a_process(self, *arguments: str) -> float:
        """For how long there was no torque, 4 s after the process was stopped."""
        emulator = self.emulate(*arguments)
        with subprocess.Popen([sys.executable, "-c", PROGRAM, str(LIBRARY), self.port],
                              stdout=subprocess.PIPE, text=True) as program:
            self.assertEqual(program.stdout.readline(), "torque\n")
            program.send_signal(signal.SIGSTOP)
            time.sleep(4.0)
            silent_s = self.end(emulator)[1]
            program.kill()
        return silent_s

    def test_the_watchdogs_end_the_torque_of_a_process_that_is_stopped(self) -> None:
        silent_s = self.stop_a_process()
        self.assertGreater(silent_s, 4.0 - 0.02 * WATCHDOG_UNITS - 1.0)
        self.assertLess(silent_s, 20.0)  # there was some

    def test_without_watchdogs_it_goes_on(self) -> None:
        self.assertLess(self.stop_a_process("--fault", "no_watchdog@0:900000"), 1.0)

    def test_a_servo_that_drops_out_is_named(self) -> None:
        self.emulate("--hands-off", "--fault", "servo_gone@3:900000")
        with DynamixelLeader(self.library, JOINTS, self.port, **PATIENT) as leader:
            with self.assertRaisesRegex(LeaderFault, r"joint 6 \(id 6\): does not answer"):
                until = time.monotonic() + 60.0
                while time.monotonic() < until:
                    leader.read()
                    time.sleep(0.02)
            with self.assertRaises(LeaderFault):
                leader.write([0.0] * 7)

    def test_a_wrong_arm_is_refused_with_its_remedy(self) -> None:
        with self.assertRaisesRegex(LeaderFault, "No such file"):
            DynamixelLeader(self.library, JOINTS, self.port)
        self.emulate("--hands-off")
        with self.assertRaisesRegex(LeaderFault, r"id 9\): does not answer at 1000000 bit/s"):
            DynamixelLeader(self.library, [LeaderJoint(9, current_limit_ampere=1.0)], self.port)
        with self.assertRaisesRegex(LeaderFault, "current_limit_ampere"):
            DynamixelLeader(self.library, [LeaderJoint(1)], self.port)


if __name__ == "__main__":
    unittest.main()
