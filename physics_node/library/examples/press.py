# SPDX-License-Identifier: Apache-2.0
"""Presses a tool 2 mm into the first tissue of a session, and prints the force: python3 press.py SESSION"""

import sys

import palpate_tissue

scene = palpate_tissue.Scene.load(sys.argv[1])
batch = palpate_tissue.Batch(scene)
for k in range(201):
    batch.position[0, 0, 2] = scene.tip_radius - 1e-5 * k
    batch.step(0.001)
print(f"force: {batch.force[0, 0, 2]:.3f} N, within {batch.error[0, 0]:.3f} N")
