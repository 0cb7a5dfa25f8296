# SPDX-License-Identifier: Apache-2.0
"""Copies of a scene under tools, step by step."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple, Optional

import numpy as np
from numpy.typing import NDArray

from .library import EVERY, FORCE, TOOL, Handle, SurfacePointers, check, lib, view
from .scene import Scene


class Surface(NamedTuple):
    """A surface of triangles. The arrays are the library's memory: the next surface() of the same tissue of
    the same copy changes them."""

    vertices: NDArray[np.float32]  # (n, 3) m; of elastic tissue as the last full solution has them
    strain: Optional[NDArray[np.float32]]  # (n,) equivalent; None: the tissue is not elastic
    triangles: NDArray[np.uint32]  # (m, 3)


class Snapshot:
    """The state of one copy."""

    def __init__(self, handle: Handle) -> None:
        self._handle = handle


class Batch:
    """Copies of a scene, each under its tools and on a time of its own.

    Arrays are views of the library's memory, of shape (copies, tools, …): write `position` (and `velocity`,
    `orientation_wxyz`) before a step, read the others after it. They work with DLPack, so that
    torch.from_dlpack(batch.force) copies nothing.

    :param threads: that make the steps; 0: one for each processor
    :raises TissueError: a number is out of range
    """

    def __init__(self, scene: Scene, copies: int = 1, tools: int = 1, threads: int = 0) -> None:
        for name, number in (("copies", copies), ("tools", tools), ("threads", threads)):
            if number < 0:
                raise ValueError(f"{name} = {number}: must not be negative")
        self.scene = scene
        self._handle = Handle(lib.palpate_batch_create(scene.value, copies, tools, threads),
                              lib.palpate_batch_destroy)
        handle, shape = self._handle, (copies, tools)
        self._tools = view(lib.palpate_batch_tools(handle.value), TOOL, shape, handle)
        self._forces = view(lib.palpate_batch_forces(handle.value), FORCE, shape, handle)
        self.position: NDArray[np.float64] = self._tools["position"]  # m, of the centre of the tip
        self.velocity: NDArray[np.float64] = self._tools["velocity"]  # m/s; used where is_velocity_known
        self.is_velocity_known: NDArray[np.int32] = self._tools["is_velocity_known"]  # 0: that of the way
        self.are_jaws_closed: NDArray[np.int32] = self._tools["are_jaws_closed"]  # of a gripper; 0: open
        self.orientation_wxyz: NDArray[np.float64] = self._tools["orientation_wxyz"]  # zeros: none
        self.force: NDArray[np.float64] = self._forces["force"]  # N, on the tool, of all tissues
        self.torque: NDArray[np.float64] = self._forces["torque"]  # N·m, about the centre of the tip
        self.energy: NDArray[np.float64] = self._forces["energy"]  # J, elastic
        self.error: NDArray[np.float64] = self._forces["error"]  # N, bound of the force's error; NaN: unknown
        self.contact_count: NDArray[np.uint32] = self._forces["contact_count"]
        self.contacts: NDArray[Any] = self._forces["contacts"]  # fields of library.CONTACT, deepest first

    def step(self, dt: float, parts: int = 1) -> None:
        """The tools go on a straight way to `position` in dt seconds, in so many equal parts, as if so many
        steps. A part of 1 ms is usual.

        :raises TissueError: nothing has moved
        """
        if not 0 <= parts < 2**32:
            raise ValueError(f"parts = {parts}: must be 1 to 100000")
        check(lib.palpate_batch_step(self._handle.value, dt, parts))

    def time(self, copy: int = 0) -> float:
        """Seconds that a copy has moved since its time 0."""
        seconds: float = lib.palpate_batch_time_s(self._handle.value, _index(copy))
        return seconds

    def reset(self, copy: Optional[int] = None, time: float = 0.0) -> None:
        """A copy, or all, as before the first step."""
        check(lib.palpate_batch_reset(self._handle.value, _index(copy), time))

    def snapshot(self, copy: int = 0) -> Snapshot:
        """The state of a copy."""
        return Snapshot(Handle(lib.palpate_batch_snapshot(self._handle.value, _index(copy)),
                               lib.palpate_snapshot_destroy))

    def restore(self, snapshot: Snapshot, copy: Optional[int] = None) -> None:
        """A copy, or all, continues from that state, to the bit."""
        check(lib.palpate_batch_restore(self._handle.value, _index(copy), snapshot._handle.value))

    def surface(self, tissue: int = 0, copy: int = 0) -> Surface:
        """The surface of a tissue as it is now."""
        found = SurfacePointers()
        check(lib.palpate_batch_surface(self._handle.value, _index(copy), _index(tissue), ctypes.byref(found)))

        def array(pointer: Any, dtype: str, shape: tuple[int, ...]) -> NDArray[Any]:
            address = ctypes.cast(pointer, ctypes.c_void_p).value or 0
            return view(address, np.dtype(dtype), shape, self._handle)

        vertices = array(found.vertices_m, "f4", (found.vertex_count, 3))
        strain = array(found.strain, "f4", (found.vertex_count,)) if found.strain else None
        return Surface(vertices, strain, array(found.triangles, "u4", (found.triangle_count, 3)))

    def __len__(self) -> int:
        return len(self._tools)


def _index(index: Optional[int]) -> int:
    if index is None:
        return EVERY
    if index < 0:
        raise ValueError(f"index {index}: must not be negative; leave it out for all where that is allowed")
    return index
