# SPDX-License-Identifier: Apache-2.0
"""Leader arms on an emulated Dynamixel bus and on an emulated CAN bus (OpenArm), as
docs/operations/leader_arms.md has them: the loop with the clamp, what a stopped process leaves, and faults
that are named."""

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
import dynamixel_leader  # noqa: E402
import openarm_leader  # noqa: E402
from dynamixel_leader import Follower, clamp_for, teleoperate  # noqa: E402
from palpate_controllers import (DamiaoJoint, DamiaoLeader, DynamixelJoint, DynamixelLeader,  # noqa: E402
                                 LeaderFault, load)

LIBRARY = Path(os.environ.get("PALPATE_CONTROLLERS",
                              BIN.parent / "mofc_node/controllers/libpalpate_controllers_c.so"))

WATCHDOG_S = 1.0
PATIENT = {"answer_limit_s": 1.0, "longest_cycle_s": 1.0}
# For busy machines: the kernel hands the bytes of a terminal over in a work queue of ordinary priority.
DYNAMIXEL = {"bits_per_second": 4_000_000, "watchdog_units": round(WATCHDOG_S / 0.02), **PATIENT}
OPENARM = {"timeout_s": WATCHDOG_S, **PATIENT}

# What the page's loop does, in a process that is stopped.
PROGRAM = f"""
import sys
sys.path.insert(0, {str(EXAMPLES)!r})
import palpate_controllers
module, kind, settings = __import__(sys.argv[3]), sys.argv[4], eval(sys.argv[5])
make = getattr(palpate_controllers, kind)
leader = make(palpate_controllers.load(sys.argv[1]), module.JOINTS, sys.argv[2], **settings)
leader.enable()
for k in range(100000):
    leader.read()
    leader.write([0.1] * len(module.JOINTS))
    if k == 20:
        print("torque", flush=True)
"""


class Emulated(unittest.TestCase):
    """An emulated arm at self.port."""
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
        while not os.path.exists(self.port) and time.monotonic() < until:
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

    def stop_a_process(self, module: str, kind: str, settings: dict, *arguments: str) -> float:
        """For how long there was no torque, 4 s after the process was stopped."""
        emulator = self.emulate(*arguments)
        with subprocess.Popen([sys.executable, "-c", PROGRAM, str(LIBRARY), self.port, module, kind,
                               repr(settings)], stdout=subprocess.PIPE, text=True) as program:
            self.assertEqual(program.stdout.readline(), "torque\n")
            program.send_signal(signal.SIGSTOP)
            time.sleep(4.0)
            silent_s = self.end(emulator)[1]
            program.kill()
        return silent_s

    def check_that_a_lost_motor_is_named(self, leader) -> None:
        with self.assertRaisesRegex(LeaderFault, r"joint 6 \(id 6\): does not answer"):
            until = time.monotonic() + 60.0
            while time.monotonic() < until:
                leader.read()
                time.sleep(0.02)
        with self.assertRaises(LeaderFault):
            leader.write([0.0] * 7)


@unittest.skipUnless(LIBRARY.exists() and (BIN / "palpate").exists(), "not built")
class OnDynamixel(Emulated):
    def leader(self) -> DynamixelLeader:
        return DynamixelLeader(self.library, dynamixel_leader.JOINTS, self.port, **DYNAMIXEL)

    def stop(self, *arguments: str) -> float:
        return self.stop_a_process("dynamixel_leader", "DynamixelLeader", DYNAMIXEL, *arguments)

    def test_the_loop_of_the_page_pushes_back(self) -> None:
        emulator = self.emulate()
        with self.leader() as leader:
            self.assertIn("joint 7 (id 7): XL330-M288", leader.description)
            clamp = clamp_for(self.library, leader, dynamixel_leader.JOINTS)
            cycles, share, reported = teleoperate(leader, clamp, Follower(), 3.0)
        self.assertGreater(cycles, 20)
        self.assertGreater(share, 0.05)
        self.assertGreater(reported, 0.5 * share)
        time.sleep(0.2)
        self.assertGreater(self.end(emulator)[1], 0.0)  # closed: limp

    def test_the_watchdogs_end_the_torque_of_a_process_that_is_stopped(self) -> None:
        silent_s = self.stop()
        self.assertGreater(silent_s, 4.0 - WATCHDOG_S - 1.0)
        self.assertLess(silent_s, 20.0)  # there was some

    def test_without_watchdogs_it_is_not_enabled(self) -> None:
        self.emulate("--fault", "no_watchdog@0:900000")
        with DynamixelLeader(self.library, dynamixel_leader.JOINTS, self.port,
                             **{**DYNAMIXEL, "watchdog_units": 5}) as leader, \
                self.assertRaisesRegex(LeaderFault, "does not keep its watchdog"):
            leader.enable()

    def test_motors_without_supply_report_that_they_make_nothing(self) -> None:
        self.emulate("--fault", "no_supply@0:900000")
        with self.leader() as leader:
            clamp = clamp_for(self.library, leader, dynamixel_leader.JOINTS)
            _, share, reported = teleoperate(leader, clamp, Follower(), 3.0)
        self.assertGreater(share, 0.05)
        self.assertEqual(reported, 0.0)

    def test_the_examples_say_how_they_are_called(self) -> None:
        for name in ("dynamixel_leader", "openarm_leader", "leader_arms", "plain_loop"):
            run = subprocess.run([sys.executable, str(EXAMPLES / f"{name}.py")], capture_output=True,
                                 text=True)
            self.assertEqual((run.returncode, run.stderr), (2, ""), name)
            self.assertIn(f"{name}.py LIBRARY", run.stdout)

    def test_a_servo_that_drops_out_is_named(self) -> None:
        self.emulate("--hands-off", "--fault", "servo_gone@3:900000")
        with self.leader() as leader:
            self.check_that_a_lost_motor_is_named(leader)

    def test_a_wrong_arm_is_refused_with_its_remedy(self) -> None:
        with self.assertRaisesRegex(LeaderFault, "No such file"):
            DynamixelLeader(self.library, dynamixel_leader.JOINTS, self.port)
        self.emulate("--hands-off")
        with self.assertRaisesRegex(LeaderFault, r"id 9\): does not answer at 1000000 bit/s"):
            DynamixelLeader(self.library, [DynamixelJoint(9, current_limit_ampere=1.0)], self.port)
        with self.assertRaisesRegex(LeaderFault, "current_limit_ampere"):
            DynamixelLeader(self.library, [DynamixelJoint(1)], self.port)


class EndOfTheTest(Exception):
    pass


class EndingFollower(Follower):
    """Ends the page's loop after so many cycles."""

    def __init__(self, cycles: int) -> None:
        self.left = cycles

    def angles(self, leader_rad):
        self.left -= 1
        if self.left < 0:
            raise EndOfTheTest
        return super().angles(leader_rad)


@unittest.skipUnless(LIBRARY.exists() and (BIN / "palpate").exists(), "not built")
class OnOpenArm(Emulated):
    def emulate(self, *arguments: str) -> subprocess.Popen:
        return super().emulate("--bus", "openarm", *arguments)

    def leader(self, **settings) -> DamiaoLeader:
        return DamiaoLeader(self.library, openarm_leader.JOINTS, self.port,
                            **{**OPENARM, **settings})

    def stop(self, *arguments: str) -> float:
        return self.stop_a_process("openarm_leader", "DamiaoLeader", OPENARM, *arguments)

    def test_the_code_of_the_page_runs_and_is_short(self) -> None:
        text = (ROOT / "docs/operations/leader_arms.md").read_text()
        section = text[text.index("## A real leader: OpenArm"):]
        code = section.split("```python\n")[1].split("```")[0]
        self.assertLessEqual(len(code.splitlines()), 30)
        for what, instead in (('"libpalpate_controllers_c.so"', repr(str(LIBRARY))),
                              ('"can0"', repr(self.port) + f", **{OPENARM!r}")):
            self.assertIn(what, code)
            code = code.replace(what, instead)
        emulator = self.emulate()
        follower = EndingFollower(200)
        with self.assertRaises(EndOfTheTest):
            exec(code, {"follower": follower, "input": lambda _: "", "print": lambda _: None})
        energy_joule, silent_s = self.end(emulator)
        self.assertGreaterEqual(energy_joule, -1e-6)
        self.assertLess(silent_s, 20.0)  # there was torque

    def test_the_loop_pushes_back(self) -> None:
        emulator = self.emulate()
        with self.leader() as leader:
            self.assertIn("joint 7 (id 7): DM4310", leader.description)
            clamp = clamp_for(self.library, leader, openarm_leader.JOINTS)
            cycles, share, reported = teleoperate(leader, clamp, Follower(), 3.0)
        self.assertGreater(cycles, 20)
        self.assertGreater(share, 0.05)
        self.assertGreater(reported, 0.5 * share)
        time.sleep(0.2)
        self.assertGreater(self.end(emulator)[1], 0.0)  # closed: limp

    def test_the_timeouts_end_the_torque_of_a_process_that_is_stopped(self) -> None:
        silent_s = self.stop()
        self.assertGreater(silent_s, 4.0 - WATCHDOG_S - 1.0)
        self.assertLess(silent_s, 20.0)  # there was some

    def test_without_timeouts_it_is_not_enabled(self) -> None:
        self.emulate("--fault", "no_watchdog@0:900000")
        with self.leader(timeout_s=0.1) as leader, \
                self.assertRaisesRegex(LeaderFault, "does not keep its watchdog"):
            leader.enable()

    def test_a_motor_that_drops_out_is_named(self) -> None:
        self.emulate("--hands-off", "--fault", "servo_gone@3:900000")
        with self.leader() as leader:
            self.check_that_a_lost_motor_is_named(leader)

    def test_a_wrong_arm_is_refused_with_its_remedy(self) -> None:
        with self.assertRaisesRegex(LeaderFault, "No such file"):
            self.leader()
        self.emulate("--hands-off")
        with self.assertRaisesRegex(LeaderFault, "those of a DM4310 within 12.5 and 10"):
            DamiaoLeader(self.library, [DamiaoJoint(1, "DM4310", torque_limit_newton_m=1.0)],
                         self.port)
        with self.assertRaisesRegex(LeaderFault, "is not known here; there are"):
            DamiaoLeader(self.library, [DamiaoJoint(1, "XL330", torque_limit_newton_m=1.0)],
                         self.port)


if __name__ == "__main__":
    unittest.main()
