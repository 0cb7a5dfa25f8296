# SPDX-License-Identifier: Apache-2.0
"""What viewers draw: the surfaces of a physics from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Optional, Sequence

import numpy as np
from google.protobuf import json_format
from numpy.typing import ArrayLike, NDArray

from .errors import SetupError
from .links import Subscribers
from .v1 import scene_pb2
from .wire import MAX_POSITION_M, Kind, encode, fill_header

_FRAME_NS = 1_000_000_000 // 30


@dataclass
class Surface:
    """A tissue as viewers draw it, undeformed. Frame W."""

    name: str
    vertices: ArrayLike  # (n, 3) m
    triangles: ArrayLike  # (m, 3) indices, counter-clockwise seen from outside; none: points

    def __repr__(self) -> str:
        vertices, triangles = len(np.asarray(self.vertices)), len(np.asarray(self.triangles))
        return f"<Surface {self.name!r}: {vertices} vertices, {triangles} triangles>"

    def fill(self, wire: scene_pb2.TissueSurface) -> None:
        """Writes itself into a message. SetupError if it cannot be drawn."""
        wire.name = self.name
        wire.shape = scene_pb2.TissueSurface.triangle_surface
        wire.vertices_m = packed_vertices(self.vertices)
        triangles = np.asarray(self.triangles)
        if not triangles.size:
            return
        if triangles.ndim != 2 or triangles.shape[1] != 3 or triangles.dtype.kind not in "iu":
            raise SetupError(f"surface {self.name}: triangles must be (m, 3) integers, not {triangles.shape}")
        if not 0 <= triangles.min() <= triangles.max() < len(np.asarray(self.vertices)):
            raise SetupError(f"surface {self.name}: a triangle names a vertex that does not exist")
        wire.triangles = triangles.astype("<u4").tobytes()


def packed_vertices(vertices: ArrayLike) -> bytes:
    """(n, 3) m as the wire packs them. SetupError if they are not finite and within ±1000 m."""
    array: NDArray[Any] = np.asarray(vertices, "<f4")
    if array.ndim != 2 or array.shape[1] != 3 or not np.all(np.abs(array) <= MAX_POSITION_M):
        raise SetupError(f"vertices of shape {array.shape}: must be (n, 3), finite, within ±1000 m")
    return array.tobytes()


class SceneDisplay:
    """SceneState to every new viewer, MeshFrames of what has moved, at most 30 times a second."""

    def __init__(
        self, scene: Optional[dict[str, Any]], surfaces: Sequence[Surface], viewers: Subscribers, session_id: int
    ) -> None:
        self._viewers, self._session_id = viewers, session_id
        self._scene: Optional[scene_pb2.SceneState] = None
        self._vertices = [len(np.asarray(surface.vertices)) for surface in surfaces]
        self._moved: dict[int, bytes] = {}  # newest vertices of each surface that ever moved
        self._due: set[int] = set()
        self._due_at_ns = 0
        self._sent = {Kind.SCENE_STATE: 0, Kind.MESH_FRAME: 0}
        if scene is None:  # started by hand: nothing is known of device and controller
            return
        self._scene = json_format.ParseDict(scene, scene_pb2.SceneState(), ignore_unknown_fields=True)
        self._scene.revision = 1
        for surface in surfaces:
            surface.fill(self._scene.tissues.add())

    def show(self, surface: int, vertices: ArrayLike) -> None:
        """The vertices of a surface as they are now."""
        if not 0 <= surface < len(self._vertices):
            raise ValueError(f"surface {surface}: there are {len(self._vertices)}")
        if len(np.asarray(vertices)) != self._vertices[surface]:
            raise ValueError(f"surface {surface} has {self._vertices[surface]} vertices, not {len(np.asarray(vertices))}")
        self._moved[surface] = packed_vertices(vertices)
        self._due.add(surface)

    def publish(self, now_ns: int, device_sequence: int) -> None:
        if self._scene is None:
            return
        if self._viewers.has_new(Kind.SCENE_STATE):
            self._send(Kind.SCENE_STATE, self._scene, now_ns)
        if self._viewers.has_new(Kind.MESH_FRAME):
            self._due |= set(self._moved)
        if now_ns < self._due_at_ns or not self._viewers.has(Kind.MESH_FRAME):
            return
        self._due_at_ns = now_ns + _FRAME_NS
        for surface in sorted(self._due):
            frame = scene_pb2.MeshFrame(
                scene_revision=1, tissue=surface, vertices_m=self._moved[surface], device_sequence=device_sequence
            )
            self._send(Kind.MESH_FRAME, frame, now_ns)
        self._due.clear()

    def _send(self, kind: Kind, message: Any, now_ns: int) -> None:
        fill_header(message.header, self._session_id, self._sent[kind], now_ns)
        self._sent[kind] += 1
        self._viewers.send(kind, encode(kind, message))
