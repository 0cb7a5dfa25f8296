# SPDX-License-Identifier: Apache-2.0
"""A leader arm in a hand and a follower arm far away, simulated: nothing here is of the clamp."""

import math
from collections import deque

JOINTS = 7
STEP_S = 0.0004
Q = math.radians(0.09)  # encoders of 4096 steps
INERTIA = [0.020, 0.020, 0.012, 0.012, 0.005, 0.005, 0.003]  # kg·m², with what the gears reflect
COULOMB = [0.12, 0.12, 0.08, 0.08, 0.05, 0.05, 0.03]  # N·m
VISCOUS = [0.04, 0.04, 0.03, 0.03, 0.02, 0.02, 0.01]  # N·m·s/rad
PEAK = [3.0, 3.0, 2.0, 2.0, 1.0, 1.0, 0.6]  # N·m
CURRENT_STEP = 0.003  # N·m


class Arm:
    """Joints with inertia and friction; moves by momentum, so that its energies are exact."""

    def __init__(self):
        self.q, self.v = [0.0] * JOINTS, [0.0] * JOINTS

    def move(self, i, torque):
        """One step of joint i. Returns how far it moved and what its kinetic energy gained."""
        gain = STEP_S / (2.0 * INERTIA[i])
        v0 = self.v[i]
        free = v0 + gain * torque
        mean = v1 = 0.0
        if abs(free) > gain * COULOMB[i]:
            mean = (free - math.copysign(gain * COULOMB[i], free)) / (1.0 + gain * VISCOUS[i])
            v1 = 2.0 * mean - v0
        self.q[i] += mean * STEP_S
        self.v[i] = v1
        return mean * STEP_S, 0.5 * INERTIA[i] * (v1 * v1 - v0 * v0)


class TwoArms:
    """A hand leads to a pose in a second, rests, and leads on until the follower's joints meet a
    stop; all of it with a loose grip, a spring and a damper."""

    GRIP = 4.0  # of the inertia per 0.01 kg·m²: N·m/rad
    GRIP_DAMPING = 0.03  # N·m·s/rad
    STOP_RAD, STOP = 0.7, 150.0  # N·m/rad

    def __init__(self, delay_s):
        self.leader, self.follower = Arm(), Arm()
        self.time_s = 0.0
        steps = round(delay_s / STEP_S) + 1
        self._to_follower = deque([([0.0] * JOINTS, [0.0] * JOINTS)] * steps, maxlen=steps)
        self._to_leader = deque([[0.0] * JOINTS] * steps, maxlen=steps)
        self.energy_joule = self.least_joule = 0.0
        self.trace = []

    def read_leader(self):
        self.trace.append(self.leader.q[:])
        return [Q * round(x / Q) for x in self.leader.q]

    def follower_as_seen(self):
        """The follower's angles, as old as the network makes them."""
        return self._to_leader[0]

    def target_rad(self, i):
        t = self.time_s
        reach = 0.5 * min(1.0, max(0.0, t)) + 0.4 * min(1.0, max(0.0, t - 2.0))
        return reach * (1.0 if i % 2 == 0 else -0.8)

    def run(self, seconds, torque):
        """Lets the leader's motors make this torque; in steps of current, no more than their peak."""
        for _ in range(round(seconds / STEP_S)):
            goal, goal_speed = self._to_follower[0]
            for i in range(JOINTS):
                scale = INERTIA[i] / 0.01
                q, v = self.leader.q[i], self.leader.v[i]
                hand = scale * (self.GRIP * (self.target_rad(i) - q) - self.GRIP_DAMPING * v)
                moved, gained = self.leader.move(i, torque[i] + hand)
                # what the hand has put in: its work, less what the inertia holds
                self.energy_joule += hand * moved - gained
                q, v = self.follower.q[i], self.follower.v[i]
                servo = scale * (60.0 * (goal[i] - q) + 1.2 * (goal_speed[i] - v))
                stop = -self.STOP * math.copysign(max(0.0, abs(q) - self.STOP_RAD), q)
                self.follower.move(i, servo + stop)
            self.least_joule = min(self.least_joule, self.energy_joule)
            self._to_follower.append((self.leader.q[:], self.leader.v[:]))
            self._to_leader.append(self.follower.q[:])
            self.time_s += STEP_S

    def shake_deg(self, period_s):
        """rms of the leader's angles about their mean over a quarter of a second."""
        half = round(0.125 / period_s)
        total = count = 0
        for k in range(half, len(self.trace) - half):
            window = self.trace[k - half : k + half + 1]
            for i in range(JOINTS):
                mean = sum(row[i] for row in window) / len(window)
                total += (self.trace[k][i] - mean) ** 2
                count += 1
        return math.degrees(math.sqrt(total / count))


def realised(torque):
    """What the motors make of a command."""
    return [math.trunc(max(-p, min(p, x)) / CURRENT_STEP) * CURRENT_STEP
            for x, p in zip(torque, PEAK)]
