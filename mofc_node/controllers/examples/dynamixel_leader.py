# SPDX-License-Identifier: Apache-2.0
"""A leader arm on a Dynamixel bus with force feedback through the clamp. Without hardware, in another
terminal: `palpate emulate --leader /tmp/leader`. Never run on hardware.

    dynamixel_leader.py LIBRARY PORT [SECONDS]    status 1 for a fault of the arm, which is limp then
"""

import sys
import time

from palpate_controllers import DynamixelJoint, DynamixelLeader, JointClamp, LeaderFault, Port, load

PERIOD_S = 0.005
STIFFNESS = 2.0  # N·m/rad, of the coupling
PEAK_NEWTON_M = 0.25  # of the credit: one hold of it
# measured on the arm: angle at the servo's 0, N·m/A, range, play; here those of the emulator
JOINTS = [DynamixelJoint(id=i + 1, offset_rad=-3.14, torque_newton_m_per_ampere=0.354,
                         current_limit_ampere=1.0, lowest_rad=-1.6, highest_rad=1.6,
                         fastest_rad_per_s=3.0, play_rad=0.0044) for i in range(7)]
COULOMB, VISCOUS = 0.8 * 0.09, 0.8 * 0.015  # identified without a hand, and less of it


class Follower:
    """An arm that meets a stop at 0.25 rad on every joint; yours goes here."""

    def angles(self, leader_rad):
        return [max(-0.25, min(0.25, x)) for x in leader_rad]


def clamp_for(library, leader, joints):
    return JointClamp(library, [
        Port(coulomb=COULOMB, viscous=VISCOUS, resolution=leader.resolution_rad(i),
             v_max=joint.fastest_rad_per_s, peak_effort=PEAK_NEWTON_M)
        for i, joint in enumerate(joints)], **leader.clamp_times)


def teleoperate(leader, clamp, follower, seconds):
    """Returns the cycles, and of the torque requested the share that was commanded, and the share that
    the motors made by their own measure of their currents."""
    cycles, asked, commanded, reported = 0, 1e-9, 0.0, 0.0
    leader.enable()  # limp until here: the person holds the arm
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        begin = time.monotonic()
        q, elapsed_s, is_known = leader.read()
        reported += sum(map(abs, leader.reported_newton_m))
        torque = [STIFFNESS * (far - x) for far, x in zip(follower.angles(q), q)]
        sent = clamp.step(q, torque, elapsed_s, is_known)
        acted = leader.write(sent)
        clamp.acts(acted)
        cycles += 1
        asked += sum(map(abs, torque))
        commanded += sum(map(abs, acted))
        time.sleep(max(0.0, PERIOD_S - (time.monotonic() - begin)))
    return cycles, commanded / asked, reported / asked


def run(make_leader, joints):
    """make_leader(library, port) is of palpate_controllers. Returns the status of the program."""
    if len(sys.argv) < 3:
        print(sys.modules["__main__"].__doc__)
        return 2
    library = load(sys.argv[1])
    seconds = float(sys.argv[3]) if len(sys.argv) > 3 else 10.0
    try:
        with make_leader(library, sys.argv[2]) as leader:
            print(leader.description, end="", flush=True)
            clamp = clamp_for(library, leader, joints)
            cycles, share, reported = teleoperate(leader, clamp, Follower(), seconds)
            print(f"{cycles / seconds:.0f} Hz; of the torque requested {100 * share:.0f} % was commanded; the "
                  f"motors report {100 * reported:.0f} %", flush=True)
            if reported < 0.5 * share:
                print("the motors make less than they are told: is their supply on?", flush=True)
    except LeaderFault as fault:
        print(f"limp: {fault}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(run(lambda library, port: DynamixelLeader(library, JOINTS, port,
                                                       bits_per_second=4_000_000), JOINTS))
