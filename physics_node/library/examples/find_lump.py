# SPDX-License-Identifier: Apache-2.0
"""Find the hard ball in a block by touch: many copies at once, in the shape of a Gymnasium vector environment
(reset, step), with a random and a scripted policy.

    python3 find_lump.py SESSION [COPIES] [ROWS.hdf5]

Where the block lies is not known to the policy: each copy has its own offset, so that all share one scene."""

from __future__ import annotations

import sys
from typing import Any, Optional

import numpy as np
from numpy.typing import NDArray

import palpate_tissue

Array = NDArray[Any]


class FindLump:
    """One action per copy: (dx, dy, dz, here), the way of the tool in a step in m, at most 4 mm, and whether
    the lump is said to be below (> 0). One observation: (x, y, z, fx, fy, fz), m and N, in a frame that lies
    anywhere. The reward is minus the distance of the answer from the lump across the surface, in m, and minus
    a millimetre for each step."""

    def __init__(self, scene: palpate_tissue.Scene, copies: int, *, lump: tuple[float, float] = (0.0, 0.0),
                 spread: float = 0.012, steps: int = 400, period: float = 0.02, threads: int = 0) -> None:
        self.num_envs = copies
        self.batch = palpate_tissue.Batch(scene, copies, threads=threads)
        self.lump, self.spread, self.steps, self.period = np.array(lump), spread, steps, period
        self.top = scene.tip_radius + 0.001
        self.rng = np.random.default_rng()
        self.offset = np.zeros((copies, 3))
        self.step_count = np.zeros(copies, int)

    def reset(self, *, seed: Optional[int] = None) -> tuple[Array, dict[str, Any]]:
        if seed is not None:
            self.rng = np.random.default_rng(seed)
        self.batch.reset()
        self._begin(np.ones(self.num_envs, bool))
        self.batch.step(self.period)
        return self._observe(), {}

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        way = np.clip(actions[:, :3], -0.004, 0.004)
        self.batch.position[:, 0] += way
        self.batch.position[:, 0, 2] = np.clip(self.batch.position[:, 0, 2], self.top - 0.009, self.top)
        self.batch.step(self.period, round(self.period / 1e-3))
        self.step_count += 1
        place = self.batch.position[:, 0, :2]
        terminated = actions[:, 3] > 0
        away = np.linalg.norm(place - self.lump, axis=1)
        reward = np.where(terminated, -away, 0.0) - 0.001
        truncated = (self.step_count >= self.steps) & ~terminated
        observation = self._observe()
        info = {"error": self.batch.error[:, 0].copy(), "away": away}
        done = terminated | truncated
        for copy in np.flatnonzero(done):  # the next step begins anew there
            self.batch.reset(int(copy))
        self._begin(done)
        return observation, reward, terminated, truncated, info

    def _begin(self, which: Array) -> None:
        count = int(which.sum())
        self.step_count[which] = 0
        self.offset[which, :2] = self.rng.uniform(-self.spread, self.spread, (count, 2))
        self.batch.position[which, 0] = 0.0
        self.batch.position[which, 0, :2] = -self.offset[which, :2]
        self.batch.position[which, 0, 2] = self.top

    def _observe(self) -> Array:
        return np.concatenate([self.batch.position[:, 0] + self.offset, self.batch.force[:, 0]], axis=1)


def random_policy(env: FindLump, observation: Array) -> Array:
    actions = env.rng.uniform(-0.004, 0.004, (env.num_envs, 4))
    actions[:, 3] = env.rng.uniform(size=env.num_envs) - 0.99
    return actions


class Scripted:
    """Presses at the points of a grid, and says that the lump is where the force was greatest."""

    def __init__(self, env: FindLump, reach: float = 0.018, points: int = 5, depth: float = 0.005) -> None:
        line = np.linspace(-reach, reach, points)
        self.grid = np.array([(x, y) for x in line for y in line])
        self.depth, self.top = depth, env.top
        self.at = np.zeros(env.num_envs, int)
        self.pressed = np.zeros((env.num_envs, len(self.grid)))
        self.is_up = np.ones(env.num_envs, bool)

    def __call__(self, env: FindLump, observation: Array) -> Array:
        actions = np.zeros((env.num_envs, 4))
        for i, (place, newton) in enumerate(zip(observation[:, :3], observation[:, 5])):
            is_sure = self.at[i] == len(self.grid)
            goal = self._answer(self.pressed[i]) if is_sure else self.grid[self.at[i]]
            across = goal - place[:2]
            if np.abs(across).max() > 1e-6:  # over the surface
                if place[2] < self.top - 1e-6:
                    actions[i, 2] = self.top - place[2]
                else:
                    actions[i, :2] = across
            elif is_sure:
                actions[i, 3] = 1.0
                self.at[i], self.pressed[i] = 0, 0.0
            elif place[2] > self.top - 0.001 - self.depth + 1e-6:
                actions[i, 2] = self.top - 0.001 - self.depth - place[2]
            else:
                self.pressed[i, self.at[i]] = newton
                self.at[i] += 1
        return actions

    def _answer(self, pressed: Array) -> Array:
        weight = np.maximum(pressed - np.quantile(pressed, 0.8), 0.0) + 1e-9
        return (weight[:, None] * self.grid).sum(axis=0) / weight.sum()


def rollout(env: FindLump, policy: Any, steps: int, seed: int = 0) -> dict[str, Array]:
    """Rows of a run: of each step and copy the observation, the action, the reward and the ends."""
    observation, _ = env.reset(seed=seed)
    rows: dict[str, list[Array]] = {name: [] for name in ("observation", "action", "reward", "terminated",
                                                          "truncated", "error", "away")}
    for _ in range(steps):
        action = policy(env, observation)
        rows["observation"].append(observation)
        rows["action"].append(action)
        observation, reward, terminated, truncated, info = env.step(action)
        for name, value in (("reward", reward), ("terminated", terminated), ("truncated", truncated),
                            ("error", info["error"]), ("away", info["away"])):
            rows[name].append(value)
    return {name: np.stack(values) for name, values in rows.items()}


def main() -> None:
    scene = palpate_tissue.Scene.load(sys.argv[1])
    copies = int(sys.argv[2]) if len(sys.argv) > 2 else 4
    env = FindLump(scene, copies)
    for name, policy in (("random", random_policy), ("scripted", Scripted(env))):
        rows = rollout(env, policy, 300)
        found = rows["away"][rows["terminated"]]
        print(f"{name}: {len(found)} answers, in the mean {1e3 * found.mean() if len(found) else np.nan:.1f} mm away")
    if len(sys.argv) > 3:
        palpate_tissue.rows.write_hdf5(sys.argv[3], rows)


if __name__ == "__main__":
    main()
