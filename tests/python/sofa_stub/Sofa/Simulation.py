# SPDX-License-Identifier: Apache-2.0
from Sofa.Core import Node


def initRoot(root: Node) -> None:
    root.is_ready = True  # type: ignore[attr-defined]


def animate(root: Node, dt: float) -> None:
    """The tool follows its goal and rests on the floor, z = 0."""
    assert root.is_ready and dt == 1e-3  # type: ignore[attr-defined]
    pose = root.goal.state.position.array().copy()  # type: ignore[attr-defined]
    assert abs(abs(pose[0, 6]) - 1.0) < 1e-6, "quaternions of SOFA are x, y, z, w"
    pose[0, 2] = max(pose[0, 2], 0.0)
    root.tool.state.position.array()[:] = pose  # type: ignore[attr-defined]
    root.tissue.visual.position.array()[0, 2] = -1.0  # type: ignore[attr-defined]
