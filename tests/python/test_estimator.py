# SPDX-License-Identifier: Apache-2.0
"""The estimator of contact models: the same as the one in C++ on the same data, and on the wire."""

import csv
import unittest
from pathlib import Path

import numpy as np

import palpate
from palpate.v1 import interaction_pb2

TABLE = Path(__file__).parent / "data/estimated.csv"


class Estimator(unittest.TestCase):
    # tests/unit/physics_node/foreign/contact_estimator_test.cpp compares the table with C++
    def test_agrees_with_the_one_in_cpp(self) -> None:
        estimator = palpate.ContactEstimator()
        with TABLE.open() as file:
            for row in csv.DictReader(file):
                position, velocity, force = (
                    [float(row[prefix + axis]) for axis in "xyz"] for prefix in ("", "v", "f")
                )
                estimate = estimator.step(position, velocity, force)
                self.assertEqual(estimate is not None, row["has"] == "1")
                found = [estimator.stiffness, estimator.damping]
                wanted = [float(row["stiffness"]), float(row["damping"])]
                if estimate is not None:
                    found += [estimate.penetration, estimate.trust_radius]
                    wanted += [float(row["penetration"]), float(row["trust"])]
                np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-9)

    def test_holds_a_force_that_pulls(self) -> None:
        estimate = palpate.ContactEstimator().step(np.zeros(3), np.zeros(3), (0, 0, -2), (0, 0, 1), 1e-3)
        assert estimate is not None
        self.assertTrue(estimate.is_held)
        wire = interaction_pb2.Contact()
        estimate.fill(wire, np.array((0.0, 0.0, -2.0)))
        self.assertTrue(wire.is_adhesive)
        self.assertEqual(wire.elastic_force_on_tool_newton.z, -2.0)


class Ahead(unittest.TestCase):
    """As tests/unit/physics_node/foreign/foreign_engine_test.cpp: 2 kN/m below z = 0."""

    @staticmethod
    def force_at(position: np.ndarray) -> np.ndarray:
        return np.array((0.0, 0.0, 2000.0 * max(0.0, -position[2])))

    def test_tissue_is_known_before_it_is_touched(self) -> None:
        estimators = palpate.points.TissueEstimators(self.force_at)
        down = np.array((0.0, 0.0, -0.1))
        [ahead] = estimators.step(np.array((0.0, 0.0, 0.005)), down, [], np.zeros(3))
        self.assertAlmostEqual(ahead.model.penetration, -0.005, delta=0.05e-3)
        self.assertAlmostEqual(ahead.model.stiffness, 2000.0, delta=40.0)
        self.assertGreater(ahead.model.trust_radius, 0.01)
        # 3 N·s/m that no force at rest has
        place = np.array((0.0, 0.0, -0.004))
        [touched] = estimators.step(place, down, [], self.force_at(place) + (0.0, 0.0, 0.3))
        self.assertAlmostEqual(touched.model.stiffness, 2000.0)
        self.assertAlmostEqual(touched.model.damping, 3.0)

    def test_nothing_is_foreseen_where_nothing_is(self) -> None:
        estimators = palpate.points.TissueEstimators(self.force_at)
        up = np.array((0.0, 0.0, 0.1))
        self.assertEqual(estimators.step(np.array((0.0, 0.0, 0.005)), up, [], np.zeros(3)), [])

    def test_a_surface_is_not_expected_where_there_is_none(self) -> None:
        down = np.array((0.0, 0.0, -0.1))
        for force_at in (None, lambda x: self.force_at(x) * (x[0] < 0.0)):  # a table that ends at x = 0
            estimators = palpate.points.TissueEstimators(force_at)
            for z in (0.001, -0.001, -0.002, -0.001, 0.001):
                place = np.array((-0.003, 0.0, z))
                self.assertIn(len(estimators.step(place, down, [], self.force_at(place))), (0, 1))
            beside = estimators.step(np.array((0.003, 0.0, 0.001)), down, [], np.zeros(3))
            self.assertEqual(len(beside), 1 if force_at is None else 0)

    def test_a_force_that_is_not_finite_is_refused(self) -> None:
        estimators = palpate.points.TissueEstimators(lambda _: (0.0, 0.0, float("nan")))
        with self.assertRaisesRegex(ValueError, "force_at"):
            estimators.step(np.zeros(3), np.array((0.0, 0.0, -0.1)), [], np.zeros(3))


if __name__ == "__main__":
    unittest.main()
