# SPDX-License-Identifier: Apache-2.0
"""The controllers through ctypes: what a callback gets and gives, with values."""

from __future__ import annotations

import math
import os
import sys
import unittest
from ctypes import byref, pointer
from pathlib import Path

from support import BIN, ROOT

sys.path.insert(0, str(ROOT / "mofc_node/controllers/examples"))
from leader_arms import LEAST, PERIOD_S, STIFFNESS, joint_clamp, teleoperate  # noqa: E402
from palpate_controllers import (DamiaoJoint, DynamixelJoint, DynamixelLeader, Input, JointClamp,  # noqa: E402
                                 Output, Port, Stretch, Tissue, load)
from two_arms import COULOMB, JOINTS, PEAK, Q, VISCOUS, TwoArms, realised  # noqa: E402

LIBRARY = Path(os.environ.get("PALPATE_CONTROLLERS",
                              BIN.parent / "mofc_node/controllers/libpalpate_controllers_c.so"))

K = 300.0  # wall below z = 0, N/m
K_C = 700.0  # virtual coupling
DEPTH_M = 0.016
ACROSS_N = 0.25  # along x, so that the components cannot be mixed up unseen


@unittest.skipUnless(LIBRARY.exists(), f"{LIBRARY} is not built")
class Callbacks(unittest.TestCase):
    def setUp(self) -> None:
        self.library = load(str(LIBRARY))
        self.seen: list[tuple] = []

    def rendered(self, controller: str) -> list[float]:
        """The force on a hand that rests at DEPTH_M below the surface, in N."""

        def wall(user, position, velocity, force, stored):
            self.seen.append((user, position[:3], velocity[:3]))
            depth_m = max(0.0, -position[2])
            force[0], force[1], force[2] = ACROSS_N, 0.0, K * depth_m
            stored[0] = 0.5 * K * depth_m**2

        tissue = Tissue(wall)
        handle = self.library.palpate_controller_create(controller.encode())
        self.assertIsNotNone(handle)
        for name, value in {"coupling_stiffness_newton_per_m": K_C,
                            "coupling_damping_newton_s_per_m": 0.05}.items():
            self.assertEqual(self.library.palpate_controller_set(handle, name.encode(), value), 0)
        last, output = Stretch(duration_s=0.001), Output()
        step = Input(applied=pointer(last), tissue=tissue, tissue_user=42)
        for k in range(200):
            for i, x in enumerate((0.001, 0.002, -DEPTH_M)):
                step.hand_position_m[i] = last.hand_position_at_end_m[i] = x
            step.applied_count = min(k, 1)
            step.requested_force_on_hand_newton[2] = K * DEPTH_M
            step.stored_energy_joule = 0.5 * K * DEPTH_M**2
            self.assertEqual(
                self.library.palpate_controller_step(handle, byref(step), byref(output)), 0)
            last.force_on_hand_newton = output.force_on_hand_newton
        self.library.palpate_controller_destroy(handle)
        return output.force_on_hand_newton[:3]

    def test_virtual_coupling_is_the_wall_and_the_coupling_in_series(self) -> None:
        force = self.rendered("virtual_coupling")
        # at rest the proxy is where both springs pull alike: 1/(1/K + 1/K_c) · depth, 3.36 N
        self.assertAlmostEqual(force[2], DEPTH_M / (1.0 / K + 1.0 / K_C), places=3)
        self.assertAlmostEqual(force[0], ACROSS_N, places=3)
        self.assertAlmostEqual(force[1], 0.0, places=6)

    def test_a_callback_gets_what_it_was_given_and_the_place_of_the_hand(self) -> None:
        self.rendered("virtual_coupling")
        user, position, velocity = self.seen[-1]
        self.assertEqual(user, 42)
        self.assertAlmostEqual(position[1], 0.002, places=6)
        self.assertLess(position[2], -0.001)
        self.assertLess(max(map(abs, velocity)), 1e-3)  # at rest

    def test_lyapunov_asks_the_tissue_too(self) -> None:
        force = self.rendered("lyapunov")
        self.assertGreater(len(self.seen), 0)
        self.assertGreater(force[2], 0.9 * min(3.3, K * DEPTH_M))


@unittest.skipUnless(LIBRARY.exists(), f"{LIBRARY} is not built")
class LeaderArms(unittest.TestCase):
    def setUp(self) -> None:
        self.library = load(str(LIBRARY))

    def run_pair(self, delay_s: float, clamp) -> tuple[TwoArms, float]:
        arms = TwoArms(delay_s)
        return arms, teleoperate(arms, clamp)

    def test_a_late_pair_drives_the_hand_and_shakes_without_the_clamp_only(self) -> None:
        free, _ = self.run_pair(0.05, None)
        held, _ = self.run_pair(0.05, joint_clamp(self.library, 0.2))
        self.assertLess(free.least_joule, -1.0)
        self.assertGreaterEqual(held.least_joule, -1e-6)
        self.assertGreater(free.shake_deg(PERIOD_S), 5.0)
        self.assertLess(held.shake_deg(PERIOD_S), 1.0)

    def test_a_pair_without_delay_is_left_alone(self) -> None:
        arms, made = self.run_pair(0.0, joint_clamp(self.library, 1.0))
        self.assertGreater(made, 0.98)
        self.assertGreaterEqual(arms.least_joule, -1e-6)

    def one_joint(self) -> JointClamp:
        port = Port(viscous=0.1, coulomb=0.1, resolution=0.0, v_max=5.0, peak_effort=2.0)
        clamp = JointClamp(self.library, [port], lease_s=0.002, earliest_end_s=0.002, delay_s=0.0)
        for k in range(100):  # 1 rad/s earns 0.2 mJ each
            clamp.step([0.002 * k], [0.0], 0.002)
        return clamp

    def test_a_gap_costs_the_credit(self) -> None:
        for elapsed_s, is_known, is_kept in ((0.002, True, True), (0.0021, True, False),
                                             (0.002, False, False)):
            clamp = self.one_joint()
            clamp.step([0.2], [0.0], elapsed_s, is_known)
            self.assertEqual(clamp.output.ledger_energy_joule > 1e-3, is_kept)

    def test_numbers_that_are_none(self) -> None:
        clamp = self.one_joint()
        self.assertEqual(clamp.step([0.2], [float("nan")], 0.002), [0.0])
        with self.assertRaises(ValueError):
            clamp.step([float("nan")], [0.0], 0.002)
        self.assertEqual(JOINTS, 7)

    def test_what_is_wrong_is_said_with_its_field_and_rule(self) -> None:
        good = [Port(v_max=1.0)] * 2
        for ports, settings, text in (
                ([Port(v_max=0.0)], {}, "port 0: v_max = 0: must be above 0"),
                ([Port(v_max=1.0), Port(v_max=1.0, coulomb=-0.5)], {}, "port 1: coulomb = -0.5"),
                ([], {}, "1 … 8 ports, not 0"),
                (good, {"lease_s": -1.0}, "earliest_end_s <= lease_s"),
                (good, {"lease_s": 0.004, "earliest_end_s": 0.005}, "earliest_end_s = 0.005"),
                (good, {"lease_s": 0.004, "delay_s": 0.003}, "delay_s = 0.003"),
                (good, {"lease": 1.0}, "lease: there is no such setting; there are lease_s"),
                (good, {"gate_joule": 0.0}, "gate_joule = 0: must be above 0")):
            with self.assertRaisesRegex(ValueError, text):
                JointClamp(self.library, ports, **settings)
        clamp = JointClamp(self.library, good)
        for step in (([0.0], [0.0] * 2), ([0.0] * 3, [0.0] * 2), ([0.0] * 2, [0.0] * 3)):
            with self.assertRaisesRegex(ValueError, "numbers; the clamp has 2 ports"):
                clamp.step(*step, 0.001)
        with self.assertRaisesRegex(ValueError, "effort has 3 numbers"):
            clamp.acts([0.0] * 3)
        with self.assertRaisesRegex(ValueError, "port 1: position = 1e\\+308: must be a number"):
            clamp.step([0.0, 1e308], [0.0] * 2, 0.001)

    def test_a_misspelt_setting_is_refused(self) -> None:
        for make, text in (
                (lambda: Port(resolutoin=0.0016), "Port has no 'resolutoin'; it has viscous"),
                (lambda: DynamixelJoint(1, ofset_rad=1.0), "DynamixelJoint has no 'ofset_rad'"),
                (lambda: DamiaoJoint(1, "DM4310", torque_rato=1.4), "DamiaoJoint has no 'torque_rato'"),
                (lambda: DynamixelLeader(self.library, [], "", watchdog=2),
                 "DynamixelLeader has no 'watchdog'; it has bits_per_second, watchdog_units")):
            with self.assertRaisesRegex(TypeError, text):
                make()

    def late_pair(self, write_s: float, net_s: float, period_s: float, **times) -> TwoArms:
        """A loop whose torque acts `write_s` after its reading."""
        arms, acting = TwoArms(net_s), [0.0] * JOINTS
        ports = [Port(viscous=LEAST * VISCOUS[i], coulomb=LEAST * COULOMB[i], resolution=Q, v_max=6.0,
                      peak_effort=PEAK[i]) for i in range(JOINTS)]
        clamp = JointClamp(self.library, ports, **times)
        for _ in range(round(4.0 / period_s)):
            q, far = arms.read_leader(), arms.follower_as_seen()
            torque = [max(-p, min(p, k * (f - x))) for k, f, x, p in zip(STIFFNESS, far, q, PEAK)]
            sent = realised(clamp.step(q, torque, period_s))
            clamp.acts(sent)
            arms.run(write_s, acting)
            acting = sent
            arms.run(period_s - write_s, acting)
        return arms

    def test_a_write_later_than_the_reading_gives_no_energy(self) -> None:
        for write_s, period_s in ((0.0016, 0.002), (0.002, 0.002), (0.0032, 0.004)):
            wrong = self.late_pair(write_s, 0.02, period_s, lease_s=2 * period_s,
                                   earliest_end_s=2 * period_s, delay_s=0.0)
            self.assertLess(wrong.least_joule, -0.1)
            for times in ({"lease_s": 2 * period_s, "earliest_end_s": 2 * period_s, "delay_s": write_s},
                          {"lease_s": 4 * period_s}):
                arms = self.late_pair(write_s, 0.02, period_s, **times)
                self.assertGreaterEqual(arms.least_joule, -1e-6)

    def test_a_loop_that_is_too_slow_for_its_lease_is_told(self) -> None:
        with self.assertWarnsRegex(RuntimeWarning, "beyond earliest_end_s = 0.002 s"):
            self.late_pair(0.0, 0.0, 0.002, lease_s=0.004)

    def test_a_lease_that_is_shorter_than_the_default_is_kept(self) -> None:
        clamp = JointClamp(self.library, [Port(v_max=1.0)], lease_s=0.001)
        clamp.step([0.0], [0.0], 0.0)
        self.assertEqual(clamp.output.lease_s, 0.001)

    def watched(self, late_s: float, ends_s: float, frac: float, **times) -> float:
        """Least energy of a loop of 5 ms with cycles of `late_s`, in which the motors let go after
        `ends_s`; then the hand goes back, at `frac` of v_max."""
        v_max, coulomb, viscous, efforts = 6.0, 0.096, 0.032, 0.6
        port = Port(coulomb=coulomb, viscous=viscous, resolution=Q, v_max=v_max, peak_effort=efforts)
        clamp = JointClamp(self.library, [port], **times)
        x = energy = least = elapsed_s = 0.0
        for k in range(3000):
            sent = clamp.step([Q * round(x / Q)], [efforts if k // 60 % 2 else -efforts], elapsed_s)[0]
            if k % 2 == 0:
                elapsed_s, acts_s, v, after = late_s, ends_s, 0.0, -math.copysign(frac * v_max, sent)
            else:
                elapsed_s = acts_s = 0.005
                after = 0.0
                v = math.copysign(min(v_max, max(0.0, (abs(sent) - coulomb) / (2 * viscous))), sent)
            for speed, effort, t in ((v, sent, acts_s), (after, 0.0, elapsed_s - acts_s)):
                energy += (viscous * speed**2 + coulomb * abs(speed) - effort * speed) * t
                x += speed * t
                least = min(least, energy)
        return least

    def test_a_watchdog_that_ends_earlier_than_told_gives_no_energy(self) -> None:
        wrong = {"lease_s": 0.04, "earliest_end_s": 0.04, "delay_s": 0.0}
        self.assertLess(self.watched(0.035, 0.02, 0.4, **wrong), -1.0)
        for times in ({"lease_s": 0.04}, {**wrong, "earliest_end_s": 0.02}):
            for frac in (0.05, 0.1, 0.2, 0.4):
                self.assertGreaterEqual(self.watched(0.035, 0.02, frac, **times), -1e-6)

    def test_an_angle_that_changes_in_no_time_gives_no_credit(self) -> None:
        ports = [Port(coulomb=0.1, viscous=0.02, resolution=0.0015, v_max=6.0, peak_effort=1.0)] * 2
        clamp = JointClamp(self.library, ports, lease_s=0.004, earliest_end_s=0.004, delay_s=0.0)
        for angle, elapsed_s in ((0.0, 0.0), (0.0, 0.002), (6.28, 0.0)):
            clamp.step([angle, 0.0], [-0.05, 0.0], elapsed_s)
        self.assertLessEqual(clamp.output.ledger_energy_joule, 0.0)

    def test_a_torque_that_came_late_costs_what_the_one_before_may_have_drawn(self) -> None:
        def ledger(delay_s: float | None, effort: float = 0.5) -> float:
            ports = [Port(coulomb=0.1, viscous=0.1, v_max=5.0, peak_effort=2.0)]
            clamp = JointClamp(self.library, ports, lease_s=0.02, earliest_end_s=0.02, delay_s=0.001)
            for k in range(200):
                clamp.step([0.002 * k], [0.0], 0.002)
            clamp.step([0.4], [1.0], 0.002)
            clamp.acts([1.0])
            clamp.step([0.4], [effort], 0.002)
            clamp.acts([effort], delay_s)
            clamp.step([0.4], [0.0], 0.002)
            return clamp.output.ledger_energy_joule

        on_time, late = ledger(0.001), ledger(0.0015)
        self.assertEqual(on_time, ledger(None))
        # (1 − 0.1) N·m draws at most 0.9²/(4 · 0.1) W, for 0.5 ms; 0.5 N·m 0.4 W, for 3 ms
        self.assertLess(late, on_time)
        self.assertGreater(late, on_time - 0.0005 * 0.9**2 / 0.4 - 0.003 * 0.4**2 / 0.4 - 6e-3)
        self.assertLessEqual(ledger(0.0015, 0.0), 0.0)
        self.assertLessEqual(ledger(float("nan")), 0.0)


if __name__ == "__main__":
    unittest.main()
