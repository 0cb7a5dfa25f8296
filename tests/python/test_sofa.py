# SPDX-License-Identifier: Apache-2.0
"""sofa_physics.py as the physics of `palpate launch`, with a stub in place of SOFA."""

import os
import sys
from pathlib import Path

import numpy as np

import palpate
from support import DEADLINE_S, RESTING, ROOT, TestCase, force_z_until, recorded, rests, until

PROGRAM = ROOT / "physics_node/engines/sofa/sofa_physics.py"
# In millimetres; the coupling is the tissue of RESTING.
SCENE = """
METRE = 1000.0
COUPLING_NEWTON_PER_M = 400.0
SURFACES = ["tissue.visual"]

def createScene(root):
    for name in ("goal", "tool"):
        root.addChild(name).addObject("MechanicalObject", name="state", position=[[0.0, 0, 0, 0, 0, 0, 1]])
    root.addChild("tissue").addObject(
        "OglModel", name="visual", position=[[0.0, 0, 0], [9, 0, 0], [0, 9, 0]], triangles=[[0, 1, 2]])
"""


class Sofa(TestCase):
    def setUp(self) -> None:
        super().setUp()
        os.environ["PYTHONPATH"] = str(Path(__file__).parent / "sofa_stub")
        self.addCleanup(os.environ.pop, "PYTHONPATH")

    def sofa_session(self, scene: str) -> Path:
        (self.folder / "scene.py").write_text(scene)
        command = f'command: ["{sys.executable}", "{PROGRAM}", "scene.py"]'
        return self.session(f"{RESTING}physics {{ rate_hz: 1000 {command} }}\n")

    def test_renders_the_coupling_and_shows_the_tissue(self) -> None:
        session = self.sofa_session(SCENE)
        record = self.folder / "run.mcap"
        with palpate.Telemetry(session) as telemetry, self.running(
            "palpate", "launch", session, "--no-realtime", "--no-viewer", "--record", record
        ) as launch:
            self.assertIsNotNone(force_z_until(telemetry, rests), launch.err)
            self.assertTrue(until(lambda: bool(recorded(record, "mesh"))), launch.err)
            self.assertEqual(launch.stop(), 0, launch.err)
        frames = recorded(record, "mesh")
        np.testing.assert_allclose(np.frombuffer(frames[-1].vertices_m, "<f4")[2], -1e-3)

    def test_a_scene_that_lacks_something_is_refused(self) -> None:
        for scene, complaint in (
            ("", "no createScene(root); define it"),
            ("def createScene(root): pass\n", "the scene has no goal.state; add it"),
        ):
            with self.running(
                "palpate", "launch", self.sofa_session(scene), "--no-realtime", "--no-viewer"
            ) as launch:
                self.assertEqual(launch.process.wait(DEADLINE_S), 2)
                self.assertIn(complaint, launch.err)
