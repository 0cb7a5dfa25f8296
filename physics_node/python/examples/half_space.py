#!/usr/bin/env python3
"""A soft half-space below z = 0: 400 N/m, 1 N·s/m. `palpate launch half_space.txtpb` renders it."""
import sys

import palpate

STIFFNESS, DAMPING = 400.0, 1.0  # N/m, N·s/m


def main() -> None:
    with palpate.Physics(sys.argv[1] if len(sys.argv) > 1 else None) as physics:
        for motion in physics:
            depth = -motion.position[2]
            physics.reply(
                contacts=[palpate.Contact((0, 0, 1), depth, stiffness=STIFFNESS, damping=DAMPING)]
            )


palpate.run(main)
