# SPDX-License-Identifier: Apache-2.0
"""A Python program as the physics of `palpate launch`: it renders, dies, stops and refuses like
physics_node."""

import json
import os
import signal
import subprocess
import sys

import numpy as np

import palpate
from palpate.v1.scene_pb2 import TissueSurface
from machine import QuietMachine
from support import (
    BIN, DEADLINE_S, EXAMPLE, PATIENT, RESTING, TestCase, force_z_until, is_limp, recorded, rests, until,
)


class Launch(TestCase):
    def test_the_example_runs_as_documented(self) -> None:
        summary = self.folder / "run.json"
        session = EXAMPLE.with_suffix(".txtpb")
        pressed_ticks = 0

        def has_pressed(force: np.ndarray) -> bool:
            nonlocal pressed_ticks
            pressed_ticks += np.count_nonzero(force > 0.5)
            return pressed_ticks > 50

        with palpate.Telemetry(session) as telemetry, self.running(
            "palpate", "launch", session, *PATIENT, "--no-realtime", "--no-viewer", "--json", summary
        ) as launch:
            self.assertIsNotNone(force_z_until(telemetry, has_pressed), launch.err)
            self.assertEqual(launch.stop(), 0, launch.err)
        run = json.loads(summary.read_text())
        self.assertGreater(run["in_contact_ticks"], 20)
        self.assertGreater(run["max_force_n"], 0.5)
        self.assertGreaterEqual(run["min_true_energy_j"], -1e-6)
        self.assertEqual(run["restarts"]["physics"], 0)

    def test_the_example_conforms(self) -> None:
        with QuietMachine() as machine, self.running("palpate", "conform", "physics", "--", EXAMPLE) as conform:
            status = conform.process.wait(2 * DEADLINE_S)
            if status != 1 or machine.may_check("conformance of half_space.py"):
                self.assertEqual(status, 0, conform.err)

    def test_renders_ends_the_force_when_killed_and_renders_again_when_restarted(self) -> None:
        session = self.python_session()
        with palpate.Telemetry(session) as telemetry, self.running(
            "palpate", "launch", session, "--no-realtime", "--no-viewer"
        ) as launch:
            self.assertIsNotNone(force_z_until(telemetry, rests), launch.err)

            os.kill(launch.node("physics"), signal.SIGKILL)
            self.assertIsNotNone(force_z_until(telemetry, is_limp), "force without physics")
            launch.node("physics", 2)
            self.assertIsNotNone(force_z_until(telemetry, rests), launch.err)

            # silent but connected: limp as well, until it goes on
            physics = launch.node("physics", 2)
            os.kill(physics, signal.SIGSTOP)
            self.assertIsNotNone(force_z_until(telemetry, is_limp), "force of a stopped physics")
            os.kill(physics, signal.SIGCONT)
            self.assertIsNotNone(force_z_until(telemetry, rests), launch.err)

            with QuietMachine() as machine:
                self.assertEqual(launch.stop(), 0, launch.err)
                self.assertIn("event=node_stopped node=physics", launch.err)
                if machine.may_check("physics stops within its grace"):
                    self.assertIn('event=node_stopped node=physics how="exit status 0"', launch.err)
        self.assertEqual(list((self.folder / "run").iterdir()), [], "files are left")

    def test_viewers_draw_its_surfaces_as_they_move(self) -> None:
        program = self.folder / "moves.py"
        program.write_text(
            "import palpate\n"
            "corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]\n"
            "with palpate.Physics(surfaces=[palpate.Surface('sheet', corners, [(0, 1, 2)])]) as physics:\n"
            "    for motion in physics:\n"
            "        physics.show(0, [(0, 0, -0.25), (1, 0, 0), (0, 1, 0)])\n"
            "        physics.reply(force=(0, 0, 0))\n"
        )
        record = self.folder / "run.mcap"
        session = self.python_session("scene { tool { tip_radius_m: 0.003 } }", program)
        with self.running(
            "palpate", "launch", session, "--no-realtime", "--no-viewer", "--record", record
        ) as launch:
            self.assertTrue(until(lambda: len(recorded(record, "mesh")) >= 30), launch.err)
            self.assertEqual(launch.stop(), 0, launch.err)
        recording = palpate.Recording(record)
        scene = next(message for _, message in recording.messages("scene_state"))
        self.assertEqual((scene.session_name, scene.tip_radius_m), ("test", 0.003))
        self.assertEqual(scene.device_rate_hz, 200)
        self.assertIn("tip_radius_m: 0.003", scene.session_text)
        self.assertEqual(scene.tissues[0].name, "sheet")
        self.assertEqual(np.frombuffer(scene.tissues[0].triangles, "<u4").tolist(), [0, 1, 2])
        frames = [message for _, message in recording.messages("mesh")]
        length_s = 1e-9 * (frames[-1].header.sampled_at_ns - frames[0].header.sampled_at_ns)
        self.assertLessEqual(len(frames), 30.01 * length_s + 1)
        self.assertEqual(np.frombuffer(frames[0].vertices_m, "<f4")[2], -0.25)

    def test_surfaces_that_cannot_be_drawn_are_refused(self) -> None:
        for surface, complaint in (
            (palpate.Surface("s", [(0, 0)], []), "must be \\(n, 3\\)"),
            (palpate.Surface("s", [(0, 0, 1e9)], []), "within ±1000 m"),
            (palpate.Surface("s", np.zeros((3, 3)), [(0, 1, 3)]), "does not exist"),
            (palpate.Surface("s", np.zeros((3, 3)), [(0.0, 1, 2)]), "integers"),
        ):
            with self.assertRaisesRegex(palpate.SetupError, complaint):
                surface.fill(TissueSurface())

    def test_a_refused_set_up_ends_the_launch(self) -> None:
        program = self.folder / "wrong.py"
        program.write_text(
            "import palpate\ndef main(): raise palpate.SetupError('no such organ; give one')\npalpate.run(main)\n"
        )
        with self.running(
            "palpate", "launch", self.python_session(program=program), "--no-realtime", "--no-viewer"
        ) as launch:
            self.assertEqual(launch.process.wait(DEADLINE_S), 2)
            self.assertIn("no such organ; give one", launch.err)

    def test_the_program_gets_links_session_and_folder_of_the_session(self) -> None:
        program = self.folder / "show.py"
        program.write_text(
            "import os, sys\n"
            "print('given', sys.argv[1:], os.getcwd(), os.environ['PALPATE_PHYSICS'], file=sys.stderr)\n"
            "sys.exit(2)\n"
        )
        session = self.session(
            f'{RESTING}physics {{ command: ["{sys.executable}", "show.py", "a b", "$HOME"] }}\n'
            'side { name: "left" } side { name: "right" links { tool_motion: "tcp://127.0.0.1:17171" } }\n'
        )
        with self.running(
            "palpate", "launch", session, "--no-realtime", "--no-viewer", "--set", "physics.rate_hz=250"
        ) as launch:
            self.assertEqual(launch.process.wait(DEADLINE_S), 2)
            self.assertIn(f"given ['a b', '$HOME'] {self.folder} ", launch.err)
            for part in (
                '"rate_hz":250.0', '"overrides":["physics.rate_hz=250"]', f'"session":"{session}"',
                '"tool_motion":"tcp://127.0.0.1:17171"', '"name":"left"', '"insecure":false',
            ):
                self.assertIn(part, launch.err)

    def test_a_program_that_does_not_exist_is_refused(self) -> None:
        for command, complaint in (
            ("no-such-program", "no program of that name in PATH"),
            ("./no-such-file", "is not a program that you may run"),
            ("./", "is not a program that you may run"),
        ):
            session = self.session(f'physics {{ command: ["{command}"] }}')
            with self.running("palpate", "launch", session, "--no-viewer") as launch:
                self.assertEqual(launch.process.wait(DEADLINE_S), 2)
                self.assertIn(complaint, launch.err)

    def test_only_launch_starts_it(self) -> None:
        session = self.python_session()
        for program, *arguments in (
            ("palpate", "loopback", session), ("physics_node", "--session", session)
        ):
            ended = subprocess.run(
                [BIN / program, *arguments], capture_output=True, text=True, timeout=DEADLINE_S
            )
            self.assertEqual(ended.returncode, 2)
            self.assertIn("physics.command", ended.stderr)
