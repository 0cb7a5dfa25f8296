# SPDX-License-Identifier: Apache-2.0
"""Rows of palpate_tissue for other programs: HDF5, LeRobot, and the haptic device of Isaac Lab."""

from __future__ import annotations

import sys
import tempfile
import types
import unittest
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

try:
    import palpate_tissue as pt
except ImportError:  # the library is not built
    pt = None
try:
    import h5py
except ImportError:
    h5py = None

FLOOR = """scene {
  tool { tip_radius_m: 0.005 }
  tissue { name: "floor" half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } }
}"""
WRONG = (({"a": [0.0, 1.0], "b": ["x", "y"]}, "b: <U1; give numbers"),
         ({"a": [[1], [1, 2]]}, "a: object; give numbers or truth values, each row of the same shape"),
         ({"a": 1.0}, "a: no rows; give an array, the rows first"), ({"a": [1j, 2j]}, "complex128; give numbers"),
         ({"a": [0.0, 1.0], "b": [1.0]}, "b: 1 rows, and 2 of a; give equally many"),
         ({"": [0.0]}, "give each one a name"), ({}, "give at least one name"))


def validate_frame(frame: dict[str, Any], features: dict[str, dict[str, Any]]) -> None:
    """What LeRobotDataset.add_frame() asks of numbers, in our words: validate_frame() of huggingface/lerobot
    034693f724f6, src/lerobot/datasets/feature_utils.py."""
    filled_in = {"timestamp", "frame_index", "episode_index", "index", "task_index"}
    if "task" not in frame:
        raise ValueError("no task")
    if set(frame) - {"task"} != set(features) - filled_in:
        raise ValueError("missing or extra features")
    for name in set(frame) - {"task"}:
        value, feature = frame[name], features[name]
        if not isinstance(value, np.ndarray):
            raise ValueError(f"{name}: no array")
        if value.dtype != np.dtype(feature["dtype"]) or value.shape != feature["shape"]:
            raise ValueError(f"{name}: {value.dtype} {value.shape}")


class Haply:
    """The device of Isaac Lab as it is published, isaac-sim/IsaacLab 116089fb07da,
    source/isaaclab/isaaclab/devices/haply/se3_haply.py: `position` has the indices of the forces that it adds up;
    it limits each component."""

    limit_force = 2.0

    def push_force(self, forces, position) -> None:
        self.forces, self.position = forces, position
        total = np.asarray(forces)[np.asarray(position)].sum(axis=0)
        self.pushed = np.clip(total, -self.limit_force, self.limit_force)


@unittest.skipIf(pt is None, "palpate_tissue has no library: target palpate_tissue_c is not built")
class TissueRows(unittest.TestCase):
    def rows(self) -> dict[str, np.ndarray]:
        rng = np.random.default_rng(3)
        return {"observation.state": rng.normal(size=(20, 6)), "next.reward": rng.normal(size=20),
                "next.done": rng.integers(0, 2, 20).astype(bool), "next.stage": rng.integers(0, 5, (20, 1))}

    @unittest.skipIf(h5py is None, "no h5py (apt-get install python3-h5py)")
    def test_rows_are_written_as_hdf5(self) -> None:
        rows = self.rows()
        with tempfile.TemporaryDirectory() as name:
            file = Path(name) / "rows.hdf5"
            for policy in ("random", "scripted"):  # the second in place of the first
                pt.rows.write_hdf5(file, rows, {"policy": policy, "seed": 3})
            with h5py.File(file) as read:
                self.assertEqual(set(read), set(rows))
                for key, values in rows.items():
                    self.assertEqual(read[key].dtype, values.dtype)
                    np.testing.assert_array_equal(read[key], values)
                self.assertEqual(dict(read.attrs), {"policy": "scripted", "seed": 3})
            self.assertEqual(list(Path(name).iterdir()), [file])

    @unittest.skipIf(h5py is None, "no h5py (apt-get install python3-h5py)")
    def test_rows_that_are_wrong_leave_the_old_hdf5_as_it_is(self) -> None:
        with tempfile.TemporaryDirectory() as name:
            file = Path(name) / "rows.hdf5"
            pt.rows.write_hdf5(file, self.rows())
            old = file.read_bytes()
            for rows, words in WRONG:
                with self.subTest(words), self.assertRaisesRegex(ValueError, words):
                    pt.rows.write_hdf5(file, rows)
            with self.assertRaises(TypeError):  # of h5py, while it writes
                pt.rows.write_hdf5(file, self.rows(), {"about": object()})
            self.assertEqual(file.read_bytes(), old)
            self.assertEqual(list(Path(name).iterdir()), [file])

    def test_without_h5py_the_error_names_the_package(self) -> None:
        with tempfile.TemporaryDirectory() as name, mock.patch.dict(sys.modules, {"h5py": None}):
            with self.assertRaisesRegex(ImportError, "apt-get install python3-h5py"):
                pt.rows.write_hdf5(Path(name) / "rows.hdf5", self.rows())

    def test_frames_are_what_lerobot_accepts(self) -> None:
        rows = self.rows()
        features = pt.rows.lerobot_features(rows, {"observation.state": ["x", "y", "z", "fx", "fy", "fz"]})
        self.assertEqual(features["observation.state"],
                         {"dtype": "float32", "shape": (6,), "names": ["x", "y", "z", "fx", "fy", "fz"]})
        self.assertEqual([(features[key]["dtype"], features[key]["shape"]) for key in list(rows)[1:]],
                         [("float32", (1,)), ("bool", (1,)), ("int64", (1,))])
        frames = pt.rows.lerobot_frames(rows, "find the lump")
        self.assertEqual(len(frames), 20)
        for i, frame in enumerate(frames):
            validate_frame(frame, features)
            self.assertEqual(frame["task"], "find the lump")
            for key, values in rows.items():
                np.testing.assert_array_equal(frame[key].reshape(values[i].shape), values[i].astype(frame[key].dtype))
        # a row as it is would not do
        with self.assertRaises(ValueError):
            validate_frame({**frames[0], "next.reward": rows["next.reward"][0]}, features)

    def test_frames_that_lerobot_would_refuse_are_not_made(self) -> None:
        rows = self.rows()
        for wrong, words in (*WRONG, ({**rows, "timestamp": np.zeros(20)}, "timestamp: LeRobot fills in"),
                             ({"a/b": [0.0]}, "give it another name")):
            with self.subTest(words), self.assertRaisesRegex(ValueError, words):
                pt.rows.lerobot_frames(wrong, "find the lump")
        for task in ("", None):
            with self.assertRaisesRegex(ValueError, "task: .*; give it in words"):
                pt.rows.lerobot_frames(rows, task)
        with self.assertRaisesRegex(ValueError, "5 names for 6 numbers"):
            pt.rows.lerobot_features(rows, {"observation.state": list("abcde")})

    def test_a_device_gets_a_force_that_is_short_enough(self) -> None:
        batch, device = pt.Batch(pt.Scene.parse(FLOOR), tools=2), Haply()
        batch.position[0, 0, 2], batch.position[0, 1, 2] = -0.045, 0.004
        batch.step(1e-3)
        with mock.patch.dict(sys.modules, {"torch": None}):
            pt.rows.push_force(device, batch)
            self.assertEqual((device.forces.dtype, device.position.dtype), (np.dtype("f4"), np.dtype("i8")))
            np.testing.assert_allclose(device.forces, np.array([[0, 0, 20.0], [0, 0, 0.4]]) * 2 / 20.4, rtol=1e-6)
            self.assertEqual(device.position.tolist(), [0, 1])
            np.testing.assert_allclose(device.pushed, [0.0, 0.0, 2.0], rtol=1e-6)
            pt.rows.push_force(device, batch, tools=[1])
            np.testing.assert_allclose(device.pushed, [0.0, 0.0, 0.4], rtol=1e-6)
            for tools in ([2], [-1], []):
                with self.assertRaisesRegex(ValueError, "give indices from 0 to 1"):
                    pt.rows.push_force(device, batch, tools=tools)
        self.assertAlmostEqual(batch.force[0, 0, 2], 20.0)

    def test_a_device_gets_tensors_where_there_is_torch(self) -> None:
        class Tensor:
            def __init__(self, array: np.ndarray) -> None:
                self.array = array

            def __array__(self, *_: Any) -> np.ndarray:
                return self.array

        torch = types.ModuleType("torch")
        torch.from_numpy = Tensor
        batch, device = pt.Batch(pt.Scene.parse(FLOOR)), Haply()
        batch.position[0, 0, 2] = 0.004
        batch.step(1e-3)
        with mock.patch.dict(sys.modules, {"torch": torch}):
            pt.rows.push_force(device, batch)
        self.assertIsInstance(device.forces, Tensor)
        self.assertIsInstance(device.position, Tensor)
        self.assertEqual((device.forces.array.dtype, device.position.array.dtype), (np.dtype("f4"), np.dtype("i8")))
        np.testing.assert_allclose(device.pushed, [0.0, 0.0, 0.4], rtol=1e-6)


if __name__ == "__main__":
    unittest.main()
