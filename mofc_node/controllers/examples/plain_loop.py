# SPDX-License-Identifier: Apache-2.0
"""A loop of one's own in Python: a wall of 3000 N/m below z = 0 and a hand that shakes.

    plain_loop.py LIBRARY [CONTROLLER]    prints the work of the hand; status 1 if it extracts energy
"""

import math
import sys
from ctypes import byref, pointer

from palpate_controllers import Input, Output, Stretch, load

T, F_D, F_CO, K = 0.001, 0.1, 0.1, 3000.0  # period, friction of the device, wall

if len(sys.argv) < 2:
    print(__doc__)
    sys.exit(2)
library = load(sys.argv[1])
controller = library.palpate_controller_create((sys.argv[2:] or ["guard"])[0].encode())
for name, value in {"rate_hz": 1 / T, "lease_s": T, "viscous_newton_s_per_m": F_D,
                    "coulomb_newton": F_CO}.items():
    if library.palpate_controller_set(controller, name.encode(), value) != 0:
        sys.exit(library.palpate_controller_error(controller).decode())

work_joule = 0.0
last, output = Stretch(duration_s=T), Output()
step = Input(applied=pointer(last))
for k in range(2000):
    z = 0.003 * math.cos(0.1257 * k)  # here the position is read
    d = z - last.hand_position_at_end_m[2] if k else 0.0
    work_joule += F_D * d * d / T + F_CO * abs(d) - last.force_on_hand_newton[2] * d
    last.hand_position_at_end_m[2] = step.hand_position_m[2] = z
    step.applied_count = min(k, 1)
    step.requested_force_on_hand_newton[2] = K * max(0.0, -z)
    step.stored_energy_joule = 0.5 * K * min(0.0, z) ** 2
    assert library.palpate_controller_step(controller, byref(step), byref(output)) == 0
    last.force_on_hand_newton = output.force_on_hand_newton  # here it is commanded
library.palpate_controller_destroy(controller)
print(f"work of the hand: {1e3 * work_joule:.3f} mJ")
sys.exit(work_joule < -1e-6)
