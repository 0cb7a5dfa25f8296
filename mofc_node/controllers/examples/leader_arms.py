# SPDX-License-Identifier: Apache-2.0
"""A leader arm with force feedback over a slow network: without the clamp, with it, and with a cap of
a fifth. Two simulated arms of seven joints; no real arm has been tried.

    leader_arms.py LIBRARY [--torque-after MS] [DELAY_MS …]

prints a table; status 1 if the clamp gives the hand energy. --torque-after: from a reading until the torque that
answers it acts, in steps of 0.4 ms (default 0.8).
"""

import sys

from palpate_controllers import JointClamp, Port, load
from two_arms import COULOMB, INERTIA, JOINTS, PEAK, Q, VISCOUS, TwoArms, realised

PERIOD_S = 0.002
DELAY_S = 0.0008  # from a reading until the torque that answers it acts
LEASE_S = 2 * PERIOD_S  # when the motors let go by themselves
LEAST = 0.8  # of the friction that was identified: what the clamp may rely on
STIFFNESS = [40.0 * inertia / 0.01 for inertia in INERTIA]  # N·m/rad, of the coupling


def joint_clamp(library, cap, delay_s=DELAY_S):
    """cap: share of the peak torque for one hold of which there is credit."""
    ports = [Port(viscous=LEAST * VISCOUS[i], coulomb=LEAST * COULOMB[i], resolution=Q, v_max=6.0,
                  peak_effort=cap * PEAK[i]) for i in range(JOINTS)]
    return JointClamp(library, ports, lease_s=LEASE_S, earliest_end_s=LEASE_S, delay_s=delay_s)


def teleoperate(arms, clamp, seconds=4.0, delay_s=DELAY_S):
    """Position exchange: the leader's motors pull to where the follower is. Returns the share of the
    torque asked for, beyond 0.2 N·m, that they made."""
    asked = made = 0.0
    acting = [0.0] * JOINTS
    for _ in range(round(seconds / PERIOD_S)):
        q = arms.read_leader()
        q_far = arms.follower_as_seen()  # as old as the network makes it
        torque = [max(-p, min(p, k * (far - x)))
                  for k, far, x, p in zip(STIFFNESS, q_far, q, PEAK)]
        sent = realised(clamp.step(q, torque, PERIOD_S) if clamp else torque)
        if clamp:
            clamp.acts(sent, delay_s)
        arms.run(delay_s, acting)
        acting = sent
        arms.run(PERIOD_S - delay_s, acting)
        asked += sum(abs(x) for x in torque if abs(x) > 0.2)
        made += sum(abs(y) for x, y in zip(torque, sent) if abs(x) > 0.2)
    return made / asked if asked else 1.0


def main():
    if len(sys.argv) < 2:
        print(__doc__)
        return 2
    library, delays_ms, delay_s = load(sys.argv[1]), sys.argv[2:], DELAY_S
    if delays_ms[:1] == ["--torque-after"]:
        delay_s, delays_ms = 1e-3 * float(delays_ms[1]), delays_ms[2:]
    print("delay ms | shake, deg rms      | least energy, mJ       | torque made, %\n"
          "         | none  clamp  fifth  | none    clamp   fifth  | none clamp fifth")
    is_safe = True
    for delay_ms in [float(x) for x in delays_ms] or [0, 5, 10, 20, 30, 50, 100]:
        shake_deg, least_mj, made = [], [], []
        for clamp in (None, joint_clamp(library, 1.0, delay_s), joint_clamp(library, 0.2, delay_s)):
            arms = TwoArms(1e-3 * delay_ms)
            made.append(100.0 * teleoperate(arms, clamp, delay_s=delay_s))
            shake_deg.append(arms.shake_deg(PERIOD_S))
            least_mj.append(1e3 * arms.least_joule)
        print(f"{delay_ms:8.0f} |" + "".join(f"{x:6.2f} " for x in shake_deg) + "| "
              + "".join(f"{x:7.0f} " for x in least_mj) + "|"
              + "".join(f"{x:5.0f} " for x in made), flush=True)
        is_safe = is_safe and min(least_mj[1:]) >= -1e-3
    return 0 if is_safe else 1


if __name__ == "__main__":
    sys.exit(main())
