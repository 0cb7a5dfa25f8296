# SPDX-License-Identifier: Apache-2.0
"""palpate_tissue as pip installs it: the user's script, arrays without a copy, many scenes, errors, MCAP, the
examples."""

from __future__ import annotations

import gc
import json
import struct
import subprocess
import sys
import tempfile
import unittest
import zlib
from pathlib import Path
from typing import Any, Iterator
from unittest import mock

import numpy as np

from support import ROOT

try:
    import palpate_tissue as pt
except ImportError:  # the library is not built
    pt = None

SESSIONS = ROOT / "deploy/sessions"
EXAMPLES = ROOT / "physics_node/library/examples"
LUMP = """scene {
  tool { tip_radius_m: 0.006 }
  tissue { name: "block" tetrahedral_mesh { file: "small_block.msh" }
    elastic { young_pa: 10e3 viscosity_ms: 5 fixed { half_space { point_m { z: -0.0299 } } } solve_rate_hz: 50
      part { where { box { center_m { x: 0.01 z: -0.005 } size_m { x: 0.022 y: 0.022 z: 0.012 } } } young_pa: 300e3 } } }
}"""
FLOOR = """scene {
  tool { tip_radius_m: 0.005 }
  tissue { name: "floor" half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } }
}"""


def mcap_records(content: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Offset, opcode and content of each record of MCAP."""
    at = 0
    while at < len(content):
        opcode, length = struct.unpack_from("<BQ", content, at)
        yield at, opcode, content[at + 9:at + 9 + length]
        at += 9 + length
    assert at == len(content), "the last record is cut off"


def mcap_strings(content: bytes, count: int) -> tuple[list[str], bytes]:
    found = []
    for _ in range(count):
        length = struct.unpack_from("<I", content)[0]
        found.append(content[4:4 + length].decode())
        content = content[4 + length:]
    return found, content


def read_mcap(file: Path) -> dict[str, Any]:
    """What is in a file, found through its summary alone, as readers that seek do."""
    data = file.read_bytes()
    magic = b"\x89MCAP0\r\n"
    assert data[:8] == data[-8:] == magic
    opcode, length, start, offsets, crc = struct.unpack("<BQQQI", data[-37:-8])
    assert (opcode, length) == (2, 20) and crc == zlib.crc32(data[start:-12])
    schemas, topics, found = {}, {}, {"chunks": 0, "messages": {}, "schemas": {}, "shapes": {}, "metadata": {}}
    for _, opcode, record in mcap_records(data[start:offsets]):
        if opcode == 3:
            (_, encoding, schema), _ = mcap_strings(record[2:], 3)
            assert encoding == "jsonschema"
            schemas[record[:2]] = json.loads(schema)
        elif opcode == 4:
            (topic, encoding), rest = mcap_strings(record[4:], 2)
            assert encoding == "json"
            topics[record[:2]] = topic
            found["schemas"][topic] = schemas[record[2:4]]
            found["shapes"][topic] = json.loads(mcap_strings(rest[4:], 2)[0][1])
            found["messages"][topic] = []
        elif opcode == 0x0B:
            found["count"], *_, found["begin_ns"], found["end_ns"] = struct.unpack_from("<QHIIIIQQ", record)
        elif opcode == 8:
            begin, end, at, size = struct.unpack_from("<QQQQ", record)
            ((_, inside, chunk),) = mcap_records(data[at:at + size])
            records = chunk[40:]
            assert inside == 6 and zlib.crc32(records) == struct.unpack_from("<I", chunk, 24)[0]
            found["chunks"] += 1
            for place in range(36, 36 + struct.unpack_from("<I", record, 32)[0], 10):  # of the index of each channel
                channel, where = struct.unpack_from("<2sQ", record, place)
                _, inside, index = next(mcap_records(data[where:offsets]))
                assert inside == 7 and index[:2] == channel
                for time_ns, offset in struct.iter_unpack("<QQ", index[6:]):
                    message = next(mcap_records(records[offset:]))[2]
                    assert message[:2] == channel and begin <= time_ns <= end
                    number, *times = struct.unpack_from("<IQQ", message, 2)
                    assert times == [time_ns, time_ns] and number == len(found["messages"][topics[channel]])
                    found["messages"][topics[channel]].append((time_ns, json.loads(message[22:])["value"]))
        elif opcode == 0x0D:
            at, size = struct.unpack_from("<QQ", record)
            ((_, _, metadata),) = mcap_records(data[at:at + size])
            (name,), rest = mcap_strings(metadata, 1)
            rest = rest[4:]
            while rest:
                (key, value), rest = mcap_strings(rest, 2)
                found["metadata"][name, key] = value
    # what precedes the summary is whole, too, and has the sum that its last record tells
    *_, (last, opcode, end) = mcap_records(data[8:start])
    assert opcode == 0x0F and struct.unpack("<I", end)[0] == zlib.crc32(data[:8 + last])
    return found


@unittest.skipIf(pt is None, "palpate_tissue has no library: target palpate_tissue_c is not built")
class Tissue(unittest.TestCase):
    def test_the_users_script_prints_the_force(self) -> None:
        script = EXAMPLES / "press.py"
        lines = [line for line in script.read_text().splitlines() if line and not line.startswith(("#", '"'))]
        self.assertLessEqual(len(lines), 15)
        ran = subprocess.run([sys.executable, script, SESSIONS / "default.txtpb"], capture_output=True, text=True)
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertRegex(ran.stdout, r"force: [0-9.]+ N, within 0\.000 N")

    def test_arrays_are_the_memory_of_the_library(self) -> None:
        batch = pt.Batch(pt.Scene.parse(FLOOR), copies=3, tools=2)
        force = batch.force
        batch.position[..., 2] = 0.004
        batch.step(1e-3)
        np.testing.assert_allclose(force[..., 2], 0.4)
        self.assertEqual(batch.contacts.shape, (3, 2, 8))
        np.testing.assert_allclose(batch.contacts["point"][2, 1, 0], [0.0, 0.0, 0.0], atol=1e-12)
        other = np.from_dlpack(force)
        self.assertTrue(np.shares_memory(other, force))
        batch.position[0, 0, 2] = 0.003
        batch.step(1e-3)
        self.assertAlmostEqual(other[0, 0, 2], 0.8)
        # they keep what they are of
        del batch
        gc.collect()
        self.assertAlmostEqual(force[0, 0, 2], 0.8)

    def test_states_are_kept_and_come_back(self) -> None:
        batch = pt.Batch(pt.Scene.parse(LUMP, SESSIONS), copies=2)
        rng = np.random.default_rng(1)

        def press(depths) -> list[bytes]:
            seen = []
            for depth in depths:
                batch.position[:, 0, 2] = 0.006 - depth
                batch.step(0.01, 10)
                seen.append(batch.force.tobytes())
            return seen

        depths = rng.uniform(0.0, 0.002, 30)
        press(depths[:15])
        kept = batch.snapshot(1)
        first = press(depths[15:])
        batch.restore(kept)
        self.assertAlmostEqual(batch.time(0), 0.15)
        batch.position[:, 0, 2] = 0.006 - depths[14]
        self.assertEqual(press(depths[15:]), first)
        surface = batch.surface(0, 1)
        self.assertEqual(surface.vertices.shape[1], 3)
        self.assertEqual(len(surface.strain), len(surface.vertices))
        self.assertLess(surface.triangles.max(), len(surface.vertices))
        batch.reset(1)
        self.assertEqual(batch.time(1), 0.0)
        self.assertAlmostEqual(batch.time(0), 0.30)

    def test_bodies_and_surfaces_come_from_arrays(self) -> None:
        lines = (SESSIONS / "small_block.msh").read_text().split("\n")
        nodes = np.loadtxt(lines[lines.index("$Nodes") + 2:lines.index("$EndNodes")])[:, 1:]
        elements = np.loadtxt(lines[lines.index("$Elements") + 2:lines.index("$EndElements")], dtype=int)[:, -4:] - 1
        in_lump = (np.linalg.norm(nodes[elements].mean(axis=1) - [0.0, 0.0, -0.008], axis=1) < 0.008).astype(int)
        self.assertGreater(in_lump.sum(), 3)

        def force_of(text: str, folder: Path) -> np.ndarray:
            batch = pt.Batch(pt.Scene.parse(text, folder))
            for k in range(40):
                batch.position[0, 0, 2] = 0.006 - 5e-5 * k
                batch.step(1e-3)
            return batch.force[0, 0].copy()

        tagged = LUMP.replace("small_block", "tagged").replace(
            LUMP[LUMP.index("where {"):LUMP.index(" young_pa: 300e3")], 'where { tag: "lump" }')
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            pt.files.write_tetrahedra(folder / "small_block.msh", nodes, elements)
            pt.files.write_tetrahedra(folder / "tagged.msh", nodes, elements, in_lump, ["block", "lump"])
            np.testing.assert_array_equal(force_of(LUMP, folder), force_of(LUMP, SESSIONS))
            soft = force_of(tagged.replace("300e3", "10e3"), folder)
            self.assertGreater(force_of(tagged, folder)[2], 1.02 * soft[2])

            corners = np.array([[x, y, z] for z in (-0.02, 0) for y in (-0.02, 0.02) for x in (-0.02, 0.02)])
            sides = np.array([[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
                              [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]])
            pt.files.write_triangles(folder / "box.stl", corners, sides)
            box = FLOOR.replace("half_space {}", 'triangle_surface { file: "box.stl" }')
            batch = pt.Batch(pt.Scene.parse(box, folder))
            batch.position[0, 0] = (0.003, 0.001, 0.004)
            batch.step(1e-3)
            np.testing.assert_allclose(batch.force[0, 0], [0.0, 0.0, 0.4], atol=1e-6)

            for arrays, words in (((nodes[:, :2], elements), "nodes_m: .*metres"), ((nodes, elements - 1), "-1 to"),
                                  ((nodes, elements, in_lump), "0 names"), ((nodes, elements * 1.0), "whole numbers")):
                with self.assertRaisesRegex(ValueError, words):
                    pt.files.write_tetrahedra(folder / "wrong.msh", *arrays)
            with self.assertRaisesRegex(ValueError, "box.stl"):
                pt.files.write_triangles(folder / "box.obj", corners, sides)
            self.assertFalse((folder / "wrong.msh").exists())

    def test_what_is_wrong_is_an_exception_with_a_remedy(self) -> None:
        with self.assertRaisesRegex(pt.TissueError, r"scene:\d+:\d+.*half_spaze"):
            pt.Scene.parse("scene { tissue { half_spaze {} } }")
        with self.assertRaisesRegex(pt.TissueError, "nowhere.txtpb"):
            pt.Scene.load("nowhere.txtpb")
        with self.assertRaisesRegex(pt.TissueError, "stiffness_newton_per_m"):
            pt.Scene.parse(FLOOR, sets={"scene.tissue[0].kelvin_voigt.stiffness_newton_per_m": -1})
        batch = pt.Batch(pt.Scene.parse(FLOOR))
        with self.assertRaisesRegex(pt.TissueError, "dt_s = .*1e-6 to 10 s"):
            batch.step(0)
        batch.position[0, 0, 1] = np.nan
        with self.assertRaisesRegex(pt.TissueError, "copy 0, tool 0: position_m"):
            batch.step(1e-3)
        with self.assertRaisesRegex(ValueError, "must not be negative"):
            pt.Batch(batch.scene, copies=-1)
        with self.assertRaisesRegex(pt.TissueError, "scenes = 0"):
            pt.Batch(batch.scene, copies=0)

    def test_beside_the_package_that_speaks_the_wire(self) -> None:
        import palpate  # with protobuf's own descriptors

        self.assertEqual(pt.Scene.parse(FLOOR).tissues, ["floor"])
        self.assertTrue(palpate.__version__)

    def test_the_scripted_policy_finds_the_lump_and_chance_does_not(self) -> None:
        sys.path.insert(0, str(EXAMPLES))
        import find_lump

        scene = pt.Scene.parse(LUMP, SESSIONS)
        env = find_lump.FindLump(scene, 3, lump=(0.01, 0.0), spread=0.004)
        policy = find_lump.Scripted(env, reach=0.016, points=3, depth=0.003)
        rows = find_lump.rollout(env, policy, 100)
        found = rows["away"][rows["terminated"]]
        self.assertGreaterEqual(len(found), 3)
        self.assertLess(found.mean(), 0.009)
        again = find_lump.rollout(env, find_lump.Scripted(env, reach=0.016, points=3, depth=0.003), 20)
        self.assertEqual(again["observation"].tobytes(), rows["observation"][:20].tobytes(), "not repeatable")
        chance = find_lump.rollout(env, find_lump.random_policy, 20)
        self.assertEqual(chance["observation"].shape, (20, 3, 6))

    def test_the_environment_has_the_interface_of_gymnasium(self) -> None:
        sys.path.insert(0, str(EXAMPLES))
        import find_lump

        env = find_lump.FindLump(pt.Scene.parse(FLOOR), 2, steps=3)
        self.assertEqual(getattr(env.metadata["autoreset_mode"], "value", env.metadata["autoreset_mode"]), "NextStep")
        for space, shape in ((env.single_observation_space, (6,)), (env.observation_space, (2, 6)),
                             (env.single_action_space, (4,)), (env.action_space, (2, 4))):
            self.assertEqual((space.shape, space.low.shape, np.dtype(space.dtype)), (shape, shape, np.dtype("f8")))
        np.testing.assert_array_equal(env.single_action_space.high, [0.004, 0.004, 0.004, 1.0])
        # where there is Gymnasium, they are its own
        gymnasium = {name: mock.MagicMock() for name in ("gymnasium", "gymnasium.spaces", "gymnasium.vector")}
        with mock.patch.dict(sys.modules, gymnasium):
            its = find_lump.FindLump(env.batch.scene, 2)
        self.assertIs(its.action_space, gymnasium["gymnasium.spaces"].Box.return_value)
        self.assertIs(its.metadata["autoreset_mode"], gymnasium["gymnasium.vector"].AutoresetMode.NEXT_STEP)

        first, info = env.reset(seed=5, options=None)
        self.assertEqual((first.shape, info), ((2, 6), {}))
        with self.assertRaisesRegex(ValueError, "options: reset_mask; there are none"):
            env.reset(options={"reset_mask": [True, False]})

        # copy 0 answers at once; its next action does nothing
        still, answer = [0.0, 0.0, -0.002, 0.0], [0.001, 0.0, 0.0, 1.0]
        last, reward, terminated, truncated, info = env.step(np.array([answer, still]))
        self.assertEqual((terminated.tolist(), truncated.any(), info["is_reset"].any()), ([True, False], False, False))
        np.testing.assert_allclose(last[0, :3] - first[0, :3], answer[:3], atol=1e-12)
        self.assertAlmostEqual(reward[0], -info["away"][0] - 0.001)
        begun, reward, terminated, truncated, info = env.step(np.array([answer, still]))
        self.assertEqual((terminated.any(), truncated.any(), info["is_reset"].tolist()), (False, False, [True, False]))
        self.assertEqual(reward.tolist(), [0.0, -0.001])
        self.assertEqual(env.batch.position[0, 0, 2], env.top)
        np.testing.assert_allclose(begun[0], [0.0, 0.0, env.top, 0.0, 0.0, 0.0], atol=1e-12)
        np.testing.assert_allclose(last[1, :3] + still[:3], begun[1, :3], atol=1e-12)
        # copy 1 has had its three steps, copy 0 one of its new episode
        _, _, terminated, truncated, _ = env.step(np.array([still, still]))
        self.assertEqual((terminated.any(), truncated.tolist(), env.step_count.tolist()), (False, [False, True], [1, 3]))
        env.step(np.array([still, still]))
        self.assertEqual((env.step_count.tolist(), env.batch.position[1, 0, 2]), ([2, 0], env.top))
        env.close()

    def test_the_example_has_help_and_reports_each_episode(self) -> None:
        def run(*arguments: str) -> subprocess.CompletedProcess:
            return subprocess.run([sys.executable, EXAMPLES / "find_lump.py", *arguments], capture_output=True, text=True)

        ran = run("--help")
        self.assertEqual(ran.returncode, 0, ran.stderr)
        self.assertRegex(ran.stdout, r"usage: find_lump.py .*\n(.*\n)*.*--rows FILE.hdf5")
        ran = run("--steps", "30", "--copies", "1")
        self.assertEqual(ran.returncode, 0, ran.stderr)
        lines = ran.stdout.splitlines()
        self.assertEqual(lines[0], "small block: 30 steps of 1 copies with each policy")
        self.assertRegex("\n".join(lines), r"random: step \d+ of 30, copy 0: answer [0-9.]+ mm away after \d+ steps\n")
        self.assertEqual(lines[-1], "scripted: 0 answers")
        for arguments, words in ((["nowhere.txtpb"], "nowhere.txtpb"), (["--copies", "0"], "give at least 1"),
                                 (["--copies", "two"], "invalid int")):
            ran = run(*arguments)
            self.assertEqual(ran.returncode, 2)
            self.assertIn(words, ran.stderr)

    def test_rows_are_written_as_mcap(self) -> None:
        rng = np.random.default_rng(2)
        rows = {"force": rng.normal(size=(50, 2, 3)), "depth": rng.normal(size=50).astype(np.float32),
                "is_done": rng.integers(0, 2, 50).astype(bool), "error": np.full((50, 1), np.nan)}
        rows["error"][1:] = 0.25
        times = 0.5 + 0.001 * np.arange(50)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "rows.mcap"
            with mock.patch("palpate_tissue.mcap_file.CHUNK_BYTES", 2000):
                pt.rows.write_mcap(file, rows, times, {"policy": "scripted", "seed": 3})
            read = read_mcap(file)
        self.assertGreater(read["chunks"], 5)
        self.assertEqual((read["count"], read["begin_ns"], read["end_ns"]), (200, 500_000_000, 549_000_000))
        self.assertEqual(read["metadata"], {("about", "policy"): "scripted", ("about", "seed"): "3"})
        self.assertEqual(read["shapes"], {"force": [2, 3], "depth": [], "is_done": [], "error": [1]})
        self.assertEqual(read["schemas"]["force"], {"type": "object", "properties": {
            "value": {"type": "array", "items": {"type": "number"}}}})
        self.assertEqual(read["schemas"]["is_done"], {"type": "object", "properties": {"value": {"type": "boolean"}}})
        for name, values in rows.items():
            self.assertEqual([time_ns for time_ns, _ in read["messages"][name]], [500_000_000 + 1_000_000 * i for i in range(50)])
            back = np.array([value for _, value in read["messages"][name]], dtype=values.dtype).reshape(values.shape)
            np.testing.assert_array_equal(back, values)
        self.assertEqual(read["messages"]["error"][0][1], [None])

    def test_rows_that_are_wrong_write_no_mcap(self) -> None:
        two = [0.0, 1.0]
        for rows, times, words in (
                ({"a": [1, 2, 3]}, two, "a: 3 rows for 2 times; give one row"), ({"a": 1.0}, two, "a: no rows for 2"),
                ({"a": ["x", "y"]}, two, "a: <U1; give numbers"), ({"a": [[1], [1, 2]]}, two, "a: object; give numbers"),
                ({"a": [1j, 2j]}, two, "complex128; give numbers"), ({"": two}, two, "give each one a name"),
                ({}, two, "give at least one name"), ({"a": two}, [1.0, 1.0], r"times_s\[1\] = 1.0 after 1.0: must ascend"),
                ({"a": two}, [1.0, 0.5], "must ascend.*sort the rows"), ({"a": two}, [0.0, np.nan], r"times_s\[1\] = nan: must be finite"),
                ({"a": two}, [-1.0, 0.0], r"times_s\[0\] = -1.0: .*subtract the first"), ({"a": two}, [0.0, np.inf], "must be finite"),
                ({"a": two}, ["0", "1"], "times_s: <U1"), ({"a": []}, [], r"times_s: float64 \(0,\); give the time of each row")):
            with tempfile.TemporaryDirectory() as folder, self.subTest(words):
                file = Path(folder) / "rows.mcap"
                with self.assertRaisesRegex(ValueError, words):
                    pt.rows.write_mcap(file, rows, times)
                self.assertEqual(list(Path(folder).iterdir()), [])

    def forces_of(self, scene, positions: np.ndarray, parts: int) -> bytes:
        """Of a batch whose tools go to positions (steps, copies, 3), in parts of 1 ms."""
        batch, forces = pt.Batch(scene, copies=positions.shape[1]), []
        for position in positions:
            batch.position[:, 0] = position
            batch.step(1e-3 * parts, parts)
            forces.append(batch.force[:, 0].copy())
        return np.stack(forces, axis=1).tobytes()  # copy by copy

    def test_many_scenes_are_each_that_of_a_run_of_its_own_to_the_bit(self) -> None:
        rng = np.random.default_rng(4)
        rigid = np.empty((10, 1000, 3))
        rigid[..., :2] = rng.uniform(-0.03, 0.03, rigid[..., :2].shape)
        rigid[..., 2] = rng.uniform(-0.002, 0.004, rigid.shape[:2])
        # more than 64, which keep less of each and make it again
        elastic = np.empty((3, 70, 3))
        elastic[..., :2] = rng.uniform(-0.01, 0.01, (1, 70, 2))
        elastic[..., 2] = 0.006 - np.outer([0.5e-3, 1e-3, 1.5e-3], rng.uniform(0.5, 1.0, 70))
        for name, load, positions, parts in (
                ("rigid", lambda: pt.Scene.load(SESSIONS / "default.txtpb"), rigid, 1),
                ("elastic", lambda: pt.Scene.parse(LUMP, SESSIONS), elastic, 20)):
            together, alone = self.forces_of(load(), positions, parts), load()
            size = len(together) // positions.shape[1]
            self.assertTrue(np.frombuffer(together).any(), "nothing is touched")
            for i in range(positions.shape[1]):
                self.assertEqual(self.forces_of(alone, positions[:, i:i + 1], parts), together[i * size:(i + 1) * size],
                                 f"{name}: scene {i}")


if __name__ == "__main__":
    unittest.main()
