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


if __name__ == "__main__":
    unittest.main()
