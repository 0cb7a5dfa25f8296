# SPDX-License-Identifier: Apache-2.0
"""A leader arm of Damiao motors on a CAN bus, as OpenArm's, with force feedback through the clamp. Without
hardware, in another terminal: `palpate emulate --leader /tmp/leader --bus openarm`. Never run on hardware.

    openarm_leader.py LIBRARY PORT [SECONDS]    status 1 for a fault of the arm, which is limp then
"""

import sys

from dynamixel_leader import run
from palpate_controllers import DamiaoJoint, DamiaoLeader

MODELS = ["DM8009", "DM8009", "DM4340", "DM4340", "DM4310", "DM4310", "DM4310"]
# measured on the arm: angle at the motor's 0, range, play; here those of the emulator
JOINTS = [DamiaoJoint(i + 1, model, offset_rad=-0.3, torque_limit_newton_m=1.0, lowest_rad=-1.6,
                      highest_rad=1.6, fastest_rad_per_s=3.0, play_rad=0.001)
          for i, model in enumerate(MODELS)]

if __name__ == "__main__":
    sys.exit(run(lambda library, port: DamiaoLeader(library, JOINTS, port), JOINTS))
