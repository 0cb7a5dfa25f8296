# SPDX-License-Identifier: Apache-2.0
"""Loopback runs, recordings and live telemetry as Python data."""

import importlib.util
import json
import subprocess
import unittest

import numpy as np

import palpate
import support
from support import RESTING, TestCase, force_z_until, rests

TISSUE = "scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } } }\n"


class Data(TestCase):
    def setUp(self) -> None:
        super().setUp()
        self.file = self.session(RESTING + TISSUE)

    def test_loopback_gives_figures_and_a_recording(self) -> None:
        record = self.folder / "run.mcap"
        figures = palpate.loopback(self.file, {"mofc.controller": "none"}, seconds=2, record=record)
        self.assertEqual(figures["ticks"], 400)
        again = palpate.loopback(self.file, {"mofc.controller": "none"}, seconds=2)
        self.assertEqual(figures["max_force_n"], again["max_force_n"])

        recording = palpate.Recording(record)
        self.assertTrue(recording.is_complete)
        self.assertEqual(recording.sides, [""])
        self.assertIn("controller: none", recording.session)
        device = recording.columns("device")
        self.assertEqual(device["sequence"].tolist(), list(range(400)))
        self.assertEqual(device["force_on_hand_newton"].shape, (400, 3))
        self.assertAlmostEqual(
            float(np.linalg.norm(device["force_on_hand_newton"], axis=1).max()), figures["max_force_n"], 9
        )
        self.assertTrue(rests(device["force_on_hand_newton"][-50:, 2]))
        self.assertEqual(len(recording.columns("mofc")["device_sequence"]), 400)
        with self.assertRaisesRegex(ValueError, "device, mofc, physics"):
            recording.columns("organ")
        with self.assertRaisesRegex(ValueError, "side = 'left'"):
            recording.columns("device", "left")

    @unittest.skipUnless(importlib.util.find_spec("pandas"), "no pandas")
    def test_a_recording_is_a_frame_of_pandas(self) -> None:
        record = self.folder / "run.mcap"
        palpate.loopback(self.file, seconds=0.1, record=record)
        self.assertEqual(len(palpate.Recording(record).frame("device")["force_on_hand_newton_z"]), 20)

    def test_recordings_cut_or_damaged(self) -> None:
        record = self.folder / "run.mcap"
        palpate.loopback(self.file, seconds=6, record=record)
        whole = record.read_bytes()

        cut = self.folder / "cut.mcap"
        cut.write_bytes(whole[: len(whole) // 2])
        with self.assertWarnsRegex(UserWarning, "its end"):
            recording = palpate.Recording(cut)
        self.assertFalse(recording.is_complete)
        ticks = recording.columns("device")["sequence"].size
        self.assertGreater(ticks, 0)
        self.assertLess(ticks, 1200)

        at = len(whole) // 3
        cut.write_bytes(whole[:at] + bytes([whole[at] ^ 0xFF]) + whole[at + 1 :])
        with self.assertWarnsRegex(UserWarning, "1 damaged chunks.*palpate recover"):
            recording = palpate.Recording(cut)
        self.assertEqual(recording.damage, "1 damaged chunks")
        self.assertIn("damaged: 1 damaged chunks", repr(recording))
        rest = recording.columns("device")["sequence"].size
        self.assertGreater(rest, 0)
        self.assertLess(rest, 1200)
        # the command line reads the same
        program = support.BIN / "palpate"
        info = subprocess.run([program, "info", cut, "--json"], capture_output=True, text=True, check=False)
        self.assertEqual(json.loads(info.stdout)["ticks"]["device"], rest)
        self.assertIn("1 damaged chunks", info.stderr)
        cut.write_bytes(b"no recording")
        with self.assertRaisesRegex(palpate.SetupError, "is not an MCAP file"):
            palpate.Recording(cut)

    def test_what_is_printed_is_short(self) -> None:
        self.assertRegex(palpate.__version__, r"^\d+\.\d+\.\d+$")
        contact = palpate.Contact(normal=[0, 0, 1], penetration=0.001, stiffness=400.0)
        self.assertEqual(repr(contact), "Contact(normal=[0, 0, 1], penetration=0.001, stiffness=400.0)")
        surface = palpate.Surface("liver", np.zeros((5000, 3)), np.zeros((0, 3), int))
        self.assertEqual(repr(surface), "<Surface 'liver': 5000 vertices, 0 triangles>")
        record = self.folder / "run.mcap"
        palpate.loopback(self.file, seconds=1, record=record)
        with palpate.Telemetry(self.file, ("device", "mofc")) as telemetry:
            self.assertEqual(repr(telemetry), f"<Telemetry of {str(self.file)!r}: device, mofc>")
        self.assertRegex(repr(telemetry), ", closed>$")
        self.assertRegex(repr(palpate.Recording(record)), r"^<Recording '.*run.mcap': \w+, [01]\.\d+ s>$")

    def test_a_contact_is_checked_when_it_is_made(self) -> None:
        with self.assertRaisesRegex(ValueError, "contact.normal.*length 1"):
            palpate.Contact(normal=[0, 0.6, 0.6], penetration=0.001)
        with self.assertRaisesRegex(ValueError, "contact.stiffness = -1"):
            palpate.Contact(normal=[0, 0, 1], penetration=0.001, stiffness=-1)

    def test_a_contact_takes_numbers_only_and_names_what_is_none(self) -> None:
        for name, value in (
            ("penetration", True), ("penetration", None), ("penetration", "0.001"), ("stiffness", False),
            ("normal", "up"), ("normal", (0, 0, True)), ("normal", [[0, 0], [1]]), ("damping", np.bool_(True)),
            ("surface_velocity", None), ("curvature", "flat"), ("tissue", -1), ("tissue", 0.5), ("tissue", True),
        ):
            with self.assertRaisesRegex(ValueError, f"^contact.{name}.* must be "):
                palpate.Contact(**{"normal": (0, 0, 1), "penetration": 0.001, name: value})
        palpate.Contact(np.array([0, 0, 1]), np.float32(0.001), stiffness=np.int64(400), tissue=np.uint8(1))
        with self.assertRaisesRegex(ValueError, "seconds = True: must be a number"):
            palpate.loopback(self.file, seconds=True)

    def test_overrides_are_dicts_lists_and_numbers_or_refused(self) -> None:
        figures = palpate.loopback(
            self.file,
            {"mofc": {"controller": "none", "mode": "paper"}, "seed": np.int64(7), "hand": {"hold": {}}},
            seconds=0.1,
        )
        self.assertEqual(figures["ticks"], 20)
        self.assertEqual(figures["controller"], "none")
        with self.assertRaisesRegex(palpate.SetupError, "physics.command names a program"):  # it was taken
            palpate.loopback(self.file, {"physics.command": ["a, b", 'c"d']}, seconds=0.1)
        for value in (None, object(), {"mode": None}):
            with self.assertRaisesRegex(ValueError, r"^sets: mofc.* must be a number, a text"):
                palpate.loopback(self.file, {"mofc": value}, seconds=0.1)
        with self.assertRaisesRegex(ValueError, "is a message, not a list"):
            palpate.loopback(self.file, {"hand.hold.position_m": [0, 0, 0.1]}, seconds=0.1)

    def test_booleans_stand_for_on_and_off(self) -> None:
        on = palpate.loopback(self.file, {"device.monitor": True}, seconds=0.1)
        self.assertEqual(on["monitor"], "on")
        self.assertEqual(palpate.loopback(self.file, {"device.monitor": False}, seconds=0.1)["monitor"], "off")

    def test_silence_has_a_hint(self) -> None:
        with palpate.Telemetry(self.file, timeout_s=0.2) as telemetry:
            with self.assertRaisesRegex(TimeoutError, "is `palpate launch .* running"):
                next(iter(telemetry))
        with self.assertRaisesRegex(TimeoutError, "less `seconds`"):
            palpate.loopback(self.file, seconds=10_000, timeout_s=0.2)

    def test_a_refused_loopback_says_why(self) -> None:
        with self.assertRaisesRegex(palpate.SetupError, "must be > 0"):
            palpate.loopback(self.file, {"duration_s": -1})
        with self.assertRaisesRegex(palpate.SetupError, "cannot be started"):
            palpate.loopback(self.file, program=self.folder / "none")

    def test_live_telemetry_of_the_nodes_of_a_launch(self) -> None:
        with palpate.Telemetry(self.file) as telemetry, self.running(
            "palpate", "launch", self.file, "--no-realtime", "--no-viewer"
        ) as launch:
            nodes = set()
            self.assertIsNotNone(force_z_until(telemetry, rests), launch.err)
            for batch in telemetry:
                nodes.add(batch.node)
                self.assertEqual(batch.side, "")
                if batch.node == "physics" and batch.columns["sequence"].size:
                    self.assertEqual(batch.columns["force_on_tool_newton"].shape[1], 3)
                if nodes == {"device", "mofc", "physics"}:
                    break
            self.assertEqual(telemetry.refused, 0)
