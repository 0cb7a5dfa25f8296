# SPDX-License-Identifier: Apache-2.0
"""Frames: one kind byte, then one protobuf message. What docs/wire.md says under Frames."""

from __future__ import annotations

import math
from enum import IntEnum
from typing import Iterable, Optional

from google.protobuf.message import DecodeError, Message

from .v1 import common_pb2, interaction_pb2, scene_pb2, telemetry_pb2, tool_motion_pb2

PROTOCOL_MAJOR = 1
MAX_TIME_NS = 1 << 61
MAX_POSITION_M = 1e3
MAX_VELOCITY_M_PER_S = 1e3
MAX_FORCE_NEWTON = 1e4
UNIT_TOLERANCE = 1e-6


class Kind(IntEnum):
    """The first byte of a frame."""

    TOOL_MOTION = 3
    INTERACTION = 4
    DEVICE_TELEMETRY = 5
    MOFC_TELEMETRY = 6
    PHYSICS_TELEMETRY = 7
    SCENE_STATE = 8
    MESH_FRAME = 9
    SUBSCRIPTION = 11


MESSAGES = {
    Kind.TOOL_MOTION: tool_motion_pb2.ToolMotion,
    Kind.INTERACTION: interaction_pb2.Interaction,
    Kind.DEVICE_TELEMETRY: telemetry_pb2.DeviceTelemetry,
    Kind.MOFC_TELEMETRY: telemetry_pb2.MofcTelemetry,
    Kind.PHYSICS_TELEMETRY: telemetry_pb2.PhysicsTelemetry,
    Kind.SCENE_STATE: scene_pb2.SceneState,
    Kind.MESH_FRAME: scene_pb2.MeshFrame,
}
LONGEST_FRAME = {
    Kind.TOOL_MOTION: 4 << 10,
    Kind.INTERACTION: 8 << 10,
    Kind.DEVICE_TELEMETRY: 1 << 20,
    Kind.MOFC_TELEMETRY: 1 << 20,
    Kind.PHYSICS_TELEMETRY: 1 << 20,
    Kind.SCENE_STATE: 16 << 20,
    Kind.MESH_FRAME: 4 << 20,
}


class Refused(Exception):
    """A frame with an error; `args[0]` is the reason as docs/wire.md names it."""


def encode(kind: Kind, message: Message) -> bytes:
    """The frame of a message. ValueError if it is longer than the receiver accepts."""
    frame: bytes = bytes((kind,)) + message.SerializeToString()
    if len(frame) > LONGEST_FRAME[kind]:
        raise ValueError(f"{kind.name}: {len(frame)} bytes; at most {LONGEST_FRAME[kind]}")
    return frame


def decode(frame: bytes, kinds: Iterable[Kind]) -> tuple[Kind, Message]:
    """The message of a frame of one of `kinds`, its header checked. Raises Refused."""
    if not frame:
        raise Refused("malformed")
    try:
        kind = Kind(frame[0])
    except ValueError:
        raise Refused("wrong_kind") from None
    if kind not in kinds:
        raise Refused("wrong_kind")
    if len(frame) > LONGEST_FRAME[kind]:
        raise Refused("too_large")
    message = MESSAGES[kind]()
    try:
        message.ParseFromString(frame[1:])
    except DecodeError:
        raise Refused("malformed") from None
    header = message.header
    if header.protocol_major == 0:
        raise Refused("missing_field")
    if header.protocol_major != PROTOCOL_MAJOR:
        raise Refused("wrong_version")
    if header.session_id == 0 or abs(header.sampled_at_ns) > MAX_TIME_NS:
        raise Refused("out_of_range")
    return kind, message


def check_motion(motion: tool_motion_pb2.ToolMotion) -> None:
    """The rules of tool_motion.proto. Raises Refused."""
    for field in (
        "device",
        "tool_position_world_m",
        "tool_orientation_world",
        "tool_velocity_world_m_per_s",
    ):
        if not motion.HasField(field):
            raise Refused("missing_field")
    p, q, v = (
        motion.tool_position_world_m,
        motion.tool_orientation_world,
        motion.tool_velocity_world_m_per_s,
    )
    position, velocity, turn = (p.x, p.y, p.z), (v.x, v.y, v.z), (q.w, q.x, q.y, q.z)
    if not all(math.isfinite(x) for x in (*position, *velocity, *turn)):
        raise Refused("not_finite")
    if (
        motion.device.session_id == 0
        or abs(motion.device.sampled_at_ns) > MAX_TIME_NS
        or any(abs(x) > MAX_POSITION_M for x in position)
        or any(abs(x) > MAX_VELOCITY_M_PER_S for x in velocity)
        or abs(math.hypot(*turn) - 1.0) > UNIT_TOLERANCE
    ):
        raise Refused("out_of_range")


def subscription(kinds: Iterable[Kind]) -> bytes:
    """The frame by which a receiver of hop 3 or 5 says which kinds it wants."""
    return bytes((Kind.SUBSCRIPTION, *sorted(kinds)))


def subscribed_kinds(frame: bytes) -> Optional[frozenset[int]]:
    """The kinds of a subscription; None if the frame is none."""
    if not frame or len(frame) > len(Kind) + 8 or frame[0] != Kind.SUBSCRIPTION:
        return None
    return frozenset(frame[1:])


def fill_header(header: common_pb2.Header, session_id: int, sequence: int, now_ns: int) -> None:
    """`session_id`: random per process start, not 0; `now_ns`: the sender's monotonic clock."""
    header.protocol_major = PROTOCOL_MAJOR
    header.session_id = session_id
    header.sequence = sequence
    header.sampled_at_ns = now_ns
