# SPDX-License-Identifier: Apache-2.0
"""The controllers through ctypes: what a callback gets and gives, with values."""

from __future__ import annotations

import os
import sys
import unittest
from ctypes import byref, pointer
from pathlib import Path

from support import BIN, ROOT

sys.path.insert(0, str(ROOT / "mofc_node/controllers/examples"))
from leader_arms import PERIOD_S, joint_clamp, teleoperate  # noqa: E402
from palpate_controllers import Input, JointClamp, Output, Port, Stretch, Tissue, load  # noqa: E402
from two_arms import JOINTS, TwoArms  # noqa: E402

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
        clamp = JointClamp(self.library, [port], lease_s=0.002)
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
        with self.assertRaises(ValueError):
            JointClamp(self.library, [Port(v_max=0.0)])
        with self.assertRaises(ValueError):
            JointClamp(self.library, [Port(v_max=1.0)], lease_s=-1.0)
        self.assertEqual(JOINTS, 7)


if __name__ == "__main__":
    unittest.main()
