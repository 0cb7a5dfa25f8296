#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A soft half-space below z = 0: 400 N/m, 1 N·s/m. `palpate launch half_space.txtpb` renders it."""
import sys

import palpate

PATCH = palpate.Surface(  # what viewers draw, m
    "half-space", [(-0.1, -0.1, 0), (0.1, -0.1, 0), (0.1, 0.1, 0), (-0.1, 0.1, 0)], [(0, 1, 2), (0, 2, 3)]
)


def main() -> None:
    with palpate.Physics(sys.argv[1] if len(sys.argv) > 1 else None, surfaces=[PATCH]) as physics:
        for motion in physics:
            depth = -motion.position[2]
            physics.reply(contacts=[palpate.Contact((0, 0, 1), depth, stiffness=400, damping=1)])


palpate.run(main)
