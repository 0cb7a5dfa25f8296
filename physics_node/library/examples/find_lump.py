# SPDX-License-Identifier: Apache-2.0
"""Find the hard ball in a block by touch: many copies at once, with the interface of a Gymnasium vector
environment (spaces, reset, step, autoreset in the next step), and a random and a scripted policy.

    python3 find_lump.py [SESSION] [--copies N] [--steps N] [--rows FILE.hdf5]

Without a SESSION it is a small block, for which both policies take seconds; block_with_tumour.txtpb takes minutes.
Where the block lies is not known to the policy: each copy has its own offset, so that all share one scene.
Gymnasium is not needed; where it can be imported, the spaces are its own."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, Callable, NamedTuple, Optional

import numpy as np
from numpy.typing import NDArray

import palpate_tissue

Array = NDArray[Any]
SESSIONS = Path(__file__).resolve().parents[3] / "deploy/sessions"
SMALL_BLOCK = """scene {
  tool { tip_radius_m: 0.006 }
  tissue { name: "block" tetrahedral_mesh { file: "small_block.msh" }
    elastic { young_pa: 10e3 viscosity_ms: 5 fixed { half_space { point_m { z: -0.0299 } } } solve_rate_hz: 50
      part { where { box { center_m { x: 0.01 z: -0.005 } size_m { x: 0.022 y: 0.022 z: 0.012 } } } young_pa: 300e3 } } }
}"""  # the lump below x = 0.01 m


class Box(NamedTuple):
    """Stands in for gymnasium.spaces.Box where there is no Gymnasium."""

    low: Array
    high: Array
    shape: tuple[int, ...]
    dtype: Any


def box(low: Array, high: Array) -> Any:
    """A space of numbers between low and high, of their shape."""
    try:
        from gymnasium.spaces import Box as GymnasiumBox
    except ImportError:
        return Box(low, high, low.shape, low.dtype.type)
    return GymnasiumBox(low, high, low.shape, low.dtype.type)


def next_step_autoreset() -> Any:
    try:
        from gymnasium.vector import AutoresetMode
    except ImportError:
        return "NextStep"  # the value of Gymnasium's AutoresetMode.NEXT_STEP
    return AutoresetMode.NEXT_STEP


class FindLump:
    """One action per copy: (dx, dy, dz, here), the way of the tool in a step in m, at most 4 mm, and whether
    the lump is said to be below (> 0). One observation: (x, y, z, fx, fy, fz), m and N, in a frame that lies
    anywhere. The reward is minus the distance of the answer from the lump across the surface, in m, and minus
    a millimetre for each step.

    After the end of an episode the next step ignores the action of that copy, begins its next episode and
    returns the first observation, with reward 0 and no end, as Gymnasium's AutoresetMode.NEXT_STEP."""

    def __init__(self, scene: palpate_tissue.Scene, copies: int, *, lump: tuple[float, float] = (0.0, 0.0),
                 spread: float = 0.012, steps: int = 400, period: float = 0.02, threads: int = 0) -> None:
        self.num_envs = copies
        self.metadata = {"autoreset_mode": next_step_autoreset()}
        self.batch = palpate_tissue.Batch(scene, copies, threads=threads)
        self.lump, self.spread, self.steps, self.period = np.array(lump), spread, steps, period
        self.top = scene.tip_radius + 0.001
        most = np.array([0.004, 0.004, 0.004, 1.0])
        everything = np.full(6, np.inf)
        self.single_action_space, self.single_observation_space = box(-most, most), box(-everything, everything)
        self.action_space = box(np.tile(-most, (copies, 1)), np.tile(most, (copies, 1)))
        self.observation_space = box(np.tile(-everything, (copies, 1)), np.tile(everything, (copies, 1)))
        self.rng = np.random.default_rng()
        self.offset = np.zeros((copies, 3))
        self.step_count = np.zeros(copies, int)
        self.is_over = np.zeros(copies, bool)

    def reset(self, *, seed: Optional[int] = None,
              options: Optional[dict[str, Any]] = None) -> tuple[Array, dict[str, Any]]:
        """All copies begin an episode.

        :param options: none are known
        :raises ValueError: there are options
        """
        if options:
            raise ValueError(f"options: {', '.join(options)}; there are none, leave them out")
        if seed is not None:
            self.rng = np.random.default_rng(seed)
        self._begin(np.ones(self.num_envs, bool))
        self.batch.step(self.period)
        return self._observe(), {}

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Observations, rewards, terminated, truncated and info, each with the copies first."""
        is_reset = self.is_over
        self._begin(is_reset)
        way = np.where(is_reset[:, None], 0.0, np.clip(actions[:, :3], -0.004, 0.004))
        self.batch.position[:, 0] += way
        self.batch.position[:, 0, 2] = np.clip(self.batch.position[:, 0, 2], self.top - 0.009, self.top)
        self.batch.step(self.period, round(self.period / 1e-3))
        self.step_count[~is_reset] += 1
        away = np.linalg.norm(self.batch.position[:, 0, :2] - self.lump, axis=1)
        terminated = (actions[:, 3] > 0) & ~is_reset
        truncated = (self.step_count >= self.steps) & ~terminated & ~is_reset
        reward = np.where(is_reset, 0.0, np.where(terminated, -away, 0.0) - 0.001)
        self.is_over = terminated | truncated
        info = {"error": self.batch.error[:, 0].copy(), "away": away, "is_reset": is_reset}
        return self._observe(), reward, terminated, truncated, info

    def close(self) -> None:
        """Nothing is open."""

    def _begin(self, which: Array) -> None:
        count = int(which.sum())
        for copy in np.flatnonzero(which):
            self.batch.reset(int(copy))
        self.is_over = np.where(which, False, self.is_over)
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

    def __call__(self, env: FindLump, observation: Array) -> Array:
        begins = env.step_count == 0
        self.at[begins], self.pressed[begins] = 0, 0.0
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
            elif place[2] > self.top - 0.001 - self.depth + 1e-6:
                actions[i, 2] = self.top - 0.001 - self.depth - place[2]
            else:
                self.pressed[i, self.at[i]] = newton
                self.at[i] += 1
        return actions

    def _answer(self, pressed: Array) -> Array:
        weight = np.maximum(pressed - np.quantile(pressed, 0.8), 0.0) + 1e-9
        return (weight[:, None] * self.grid).sum(axis=0) / weight.sum()


def rollout(env: FindLump, policy: Any, steps: int, seed: int = 0,
            report: Callable[[str], None] = lambda line: None) -> dict[str, Array]:
    """Rows of a run, (steps, copies, …): of each step the observation before it, the action, the reward, the ends,
    the bound of the error in N, the distance from the lump in m, and whether it only began an episode.

    :param report: gets a line for each end of an episode
    """
    observation, _ = env.reset(seed=seed)
    rows: dict[str, list[Array]] = {name: [] for name in ("observation", "action", "reward", "terminated",
                                                          "truncated", "error", "away", "is_reset")}
    for step in range(1, steps + 1):
        action = policy(env, observation)
        rows["observation"].append(observation)
        rows["action"].append(action)
        observation, reward, terminated, truncated, info = env.step(action)
        for name, value in (("reward", reward), ("terminated", terminated), ("truncated", truncated),
                            *((key, info[key]) for key in ("error", "away", "is_reset"))):
            rows[name].append(value)
        for copy in np.flatnonzero(terminated | truncated):
            end = f"answer {1e3 * info['away'][copy]:.1f} mm away" if terminated[copy] else "no answer"
            report(f"step {step} of {steps}, copy {copy}: {end} after {env.step_count[copy]} steps")
    return {name: np.stack(values) for name, values in rows.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description="Finds the hard ball in a block by touch, with a random and a "
                                                 "scripted policy.")
    parser.add_argument("session", nargs="?", help="file of a session, with the lump below the origin, as "
                                                   "block_with_tumour.txtpb, which takes minutes (default: a small block)")
    parser.add_argument("--copies", type=int, default=2, help="scenes at once (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=120,
                        help="of 20 ms, of each policy; an episode of the scripted one has about 80 in the small block, "
                             "240 in block_with_tumour (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="default: %(default)s")
    parser.add_argument("--rows", metavar="FILE.hdf5", help="write the rows of the scripted policy (needs python3-h5py)")
    given = parser.parse_args()
    if given.copies < 1 or given.steps < 1:
        parser.error(f"--copies {given.copies} --steps {given.steps}: give at least 1 of each")
    if given.rows:
        try:
            import h5py  # noqa: F401  # now rather than after the run
        except ImportError:
            parser.error("--rows: no h5py; apt-get install python3-h5py")
    print(f"{given.session or 'small block'}: {given.steps} steps of {given.copies} copies with each policy", flush=True)
    try:
        scene = (palpate_tissue.Scene.load(given.session) if given.session
                 else palpate_tissue.Scene.parse(SMALL_BLOCK, SESSIONS))
    except palpate_tissue.TissueError as error:
        parser.error(str(error))
    if given.session:
        env = FindLump(scene, given.copies)
        scripted = Scripted(env)
    else:
        env = FindLump(scene, given.copies, lump=(0.01, 0.0), spread=0.004)
        scripted = Scripted(env, reach=0.016, points=3, depth=0.003)
    for name, policy in (("random", random_policy), ("scripted", scripted)):
        rows = rollout(env, policy, given.steps, given.seed, lambda line: print(f"{name}: {line}", flush=True))
        found = rows["away"][rows["terminated"]]
        mean = f", in the mean {1e3 * found.mean():.1f} mm away" if len(found) else ""
        print(f"{name}: {len(found)} answers{mean}", flush=True)
    if given.rows:
        palpate_tissue.rows.write_hdf5(given.rows, rows, {"policy": "scripted", "seed": given.seed})


if __name__ == "__main__":
    main()
