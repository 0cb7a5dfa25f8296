# SPDX-License-Identifier: Apache-2.0
"""The physics side of the loop: hop 2 in, hop 3 out, hop 5 for viewers."""

from __future__ import annotations

import asyncio
import secrets
import signal
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any, AsyncIterator, Iterator, Optional, Sequence, Union

import numpy as np
import zmq
import zmq.asyncio
from numpy.typing import ArrayLike, NDArray

from .contact import Contact, _number, _put, _vector
from .errors import SetupError
from .links import Keys, Links, Subscribers
from .look_ahead import ForceAt
from .points import TissueEstimators
from .scene import SceneDisplay, Surface
from .session import SideLinks, session_links
from .v1 import interaction_pb2, telemetry_pb2, tool_motion_pb2
from .wire import MAX_FORCE_NEWTON, Kind, Refused, check_motion, decode, encode, fill_header

MAX_CONTACTS = 8
_WRITER_SILENCE_NS = 100_000_000
_QUEUE = 256
_IDLE_MS = 50
_BATCH_NS = 20_000_000
_BATCH_MOST = 1000


@dataclass
class Motion:
    """Pose and velocity of the tool, as mofc_node knows them. Frame W."""

    position: NDArray[Any]  # (3,) m, tool tip
    orientation: NDArray[Any]  # (4,) unit quaternion w, x, y, z: W from T
    velocity: NDArray[Any]  # (3,) m/s
    buttons: int  # bit i: button i is held
    is_new: bool  # False: no motion arrived for one period, this one is to be answered again
    side: str  # of the session; "" with one device
    sequence: int  # of the DeviceState
    sampled_at_ns: int  # of the DeviceState, clock of the device
    received_at_ns: int  # time.monotonic_ns() of this program


class _Side:
    """Hops 2 and 3 of one device."""

    def __init__(self, links: Links, side: SideLinks, force_at: Optional[ForceAt]) -> None:
        self.name = side.name
        self.motions = links.open("tool_motion", side.tool_motion, binds=True)
        interactions = links.open("interaction", side.interaction, binds=True)
        self.receivers = Subscribers(interactions)
        self.estimators = TissueEstimators(force_at)
        self.newest: Optional[tool_motion_pb2.ToolMotion] = None
        self.motion: Optional[Motion] = None
        self.session_id = 0
        self.heard_at_ns = 0
        self.offered_at_ns = 0
        self.sequence = 0
        self.step = 0
        self.interaction = interaction_pb2.Interaction()
        self.link = telemetry_pb2.LinkCounters()
        self.refused: Counter[str] = Counter()
        self.contact_steps = 0
        self.worst_compute_ns = 0
        self.batches = 0
        self.batch = telemetry_pb2.PhysicsTelemetry()

    def take(self, now_ns: int) -> bool:
        """Reads the whole queue and keeps the newest motion; true if there is a new one."""
        is_new = False
        for _ in range(_QUEUE):  # a flood does not hold up the physics
            try:
                parts = self.motions.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                break
            try:
                if len(parts) != 1:
                    raise Refused("malformed")
                _, message = decode(parts[0], (Kind.TOOL_MOTION,))
                check_motion(message)
                is_new |= self._accept(message, now_ns)
            except Refused as refused:
                self.refused[refused.args[0]] += 1
                self.link.rejected += 1
        return is_new

    def _accept(self, message: tool_motion_pb2.ToolMotion, now_ns: int) -> bool:
        header = message.header
        if self.newest is None or header.session_id != self.session_id:
            if self.newest is not None and now_ns - self.heard_at_ns < _WRITER_SILENCE_NS:
                raise Refused("another_writer")
            self.link.sessions += 1
        else:
            last = self.newest.header.sequence
            self.heard_at_ns = now_ns
            if header.sequence == last:
                self.link.duplicates += 1
                return False
            if header.sequence < last:
                self.link.out_of_order += 1
                return False
            self.link.skipped += header.sequence - last - 1
        self.session_id, self.heard_at_ns, self.newest = header.session_id, now_ns, message
        self.link.accepted += 1
        return True

    def offer(self, is_new: bool, now_ns: int) -> Motion:
        """The newest motion, to be answered."""
        assert self.newest is not None
        p, q, v = (
            self.newest.tool_position_world_m,
            self.newest.tool_orientation_world,
            self.newest.tool_velocity_world_m_per_s,
        )
        self.offered_at_ns = now_ns
        self.motion = Motion(
            position=np.array((p.x, p.y, p.z)),
            orientation=np.array((q.w, q.x, q.y, q.z)),
            velocity=np.array((v.x, v.y, v.z)),
            buttons=self.newest.buttons,
            is_new=is_new,
            side=self.name,
            sequence=self.newest.device.sequence,
            sampled_at_ns=self.newest.device.sampled_at_ns,
            received_at_ns=self.heard_at_ns,
        )
        return self.motion


@dataclass
class Counts:
    """Since the start, over all sides."""

    motions: int = 0  # accepted
    replies: int = 0  # made, whether or not anybody received them
    refused: Counter[str] = field(default_factory=Counter)  # by reason


class Physics:
    """One physics for mofc_node: yields the newest motion of the tool, takes the force on it.

        with palpate.Physics() as physics:
            for motion in physics:
                physics.reply(contacts=[…])

    Binds hops 2 and 3 of every side of the session and its physics_telemetry. A motion is yielded
    as soon as it arrives, and again after one period of physics.rate_hz without a new one, so that
    mofc_node can tell a slow hand from a stopped physics. What arrived while the program computed is
    skipped but for the newest. mofc_node and viewers may come, go and restart at any time.

    The iteration, plain or `async for`, ends at SIGTERM, SIGINT or stop(); a second signal kills.

    :param session: session file; None: what `palpate launch` gave (physics.command)
    :param surfaces: what viewers draw, under `palpate launch` only
    :param insecure: allow tcp beyond loopback without keys
    :param estimate: make a contact model of what reply() gives as a force alone
    :param force_at: for forces alone: N on a tool that would rest at a place, (3,) m → (3,) N, W, without
        an effect on what reply() gives. Tissue is then known before it is touched
    :raises SetupError: wrong session, endpoint in use, keys that do not fit
    """

    def __init__(
        self,
        session: Union[str, Path, None] = None,
        *,
        surfaces: Sequence[Surface] = (),
        insecure: bool = False,
        estimate: bool = True,
        force_at: Optional[ForceAt] = None,
    ) -> None:
        config = session_links(session, insecure)
        self.rate_hz = config.rate_hz
        if not 0.0 < self.rate_hz < 1e5:
            raise SetupError(f"{config.source}: physics.rate_hz = {self.rate_hz}: must be > 0; give Hz")
        self._period_ns = round(1e9 / self.rate_hz)
        self._session_id = secrets.randbits(64) or 1
        self._is_stopped = False
        self._has_estimate = estimate
        keys = Keys(config.key_folder, "physics") if config.key_folder is not None else None
        self._links = Links(keys, config.insecure)
        try:
            self._sides = [_Side(self._links, side, force_at) for side in config.sides]
            self._viewers = Subscribers(
                self._links.open("physics_telemetry", config.physics_telemetry, binds=True)
            )
            self._display = SceneDisplay(config.scene, surfaces, self._viewers, self._session_id)
        except BaseException:
            self._links.close()
            raise
        self._answering: Optional[_Side] = None
        self._next_side = 0
        self._batch_due_ns = 0

    # --- motions

    def __iter__(self) -> Iterator[Motion]:
        poller = self._watching(zmq.Poller())
        previous = self._watch_signals()
        try:
            while not self._is_stopped:
                motion = self._next()
                if motion is not None:
                    yield motion
                else:
                    poller.poll(self._wait_ms())
        finally:
            self._restore_signals(previous)

    def _watching(self, poller: Any) -> Any:
        for side in self._sides:
            poller.register(side.motions, zmq.POLLIN)
        return poller

    async def __aiter__(self) -> AsyncIterator[Motion]:
        poller = self._watching(zmq.asyncio.Poller())
        previous = self._watch_signals()
        try:
            while not self._is_stopped:
                motion = self._next()
                if motion is not None:
                    yield motion
                    await asyncio.sleep(0)  # other tasks run even if motions never stop
                else:
                    await poller.poll(self._wait_ms())
        finally:
            self._restore_signals(previous)

    def _next(self) -> Optional[Motion]:
        now = time.monotonic_ns()
        self._serve(now)
        for _ in self._sides:  # in turn
            side = self._sides[self._next_side]
            self._next_side = (self._next_side + 1) % len(self._sides)
            is_new = side.take(now)
            is_due = side.newest is not None and now - side.offered_at_ns >= self._period_ns
            if is_new or is_due:
                self._answering = side
                return side.offer(is_new, now)
        return None

    def _wait_ms(self) -> int:
        if all(side.newest is None for side in self._sides):
            return _IDLE_MS
        now = time.monotonic_ns()
        due = min(side.offered_at_ns for side in self._sides if side.newest is not None) + self._period_ns
        return max(1, min(_IDLE_MS, (due - now) // 1_000_000))

    # --- replies

    def reply(
        self,
        force: Optional[ArrayLike] = None,
        contacts: Sequence[Contact] = (),
        stored_energy: Optional[float] = None,
    ) -> None:
        """Answers the motion that was yielded last.

        :param force: (3,) N on the tool, W, of all tissues, ±1e4; None: the sum of the contacts
        :param contacts: models of the tissues touched or near, or an engine's contact points, at most
            8. What has no stiffness is estimated from the forces so far (docs/extending.md)
        :param stored_energy: J, elastic, of all tissues, 0 … 1000; None: the sum of the contacts
        :raises ValueError: a value is not finite or out of range; nothing was sent
        """
        side = self._answering
        if side is None or side.newest is None or side.motion is None:
            raise RuntimeError("no motion to answer: call reply() in the loop over the motions")
        if len(contacts) > MAX_CONTACTS:
            raise ValueError(f"{len(contacts)} contacts: must be at most {MAX_CONTACTS}; give the deepest")
        for one in contacts:
            one.check()
        motion = side.motion
        given = None if force is None else _vector("force", force, MAX_FORCE_NEWTON)
        points = (one.force(motion.velocity) for one in contacts)
        total = _vector("force", sum(points, np.zeros(3)), MAX_FORCE_NEWTON) if given is None else given
        if stored_energy is not None:
            _number("stored_energy", stored_energy, 0.0, 1e3)
        modelled = (
            side.estimators.step(motion.position, motion.velocity, contacts, given)
            if self._has_estimate
            else []
        )
        wires: list[interaction_pb2.Contact] = []
        for contact in contacts:
            if contact.stiffness is not None:
                wires.append(interaction_pb2.Contact())
                contact.fill(wires[-1], motion.velocity)
        for one in modelled:
            wires.append(interaction_pb2.Contact(tissue=one.tissue))
            one.model.fill(wires[-1], one.force)
        touching = [wire for wire in wires if wire.penetration_m > 0.0]
        energy = stored_energy
        if energy is None:
            energy = _number("stored_energy", sum(wire.stored_energy_joule for wire in touching), 0.0, 1e3)
        message = side.interaction
        message.Clear()
        message.contacts.extend(sorted(wires, key=lambda wire: -wire.penetration_m)[:MAX_CONTACTS])
        message.contact_count = len(touching)
        message.answers.CopyFrom(side.newest.device)
        message.tool_position_world_m.CopyFrom(side.newest.tool_position_world_m)
        message.tool_orientation_world.CopyFrom(side.newest.tool_orientation_world)
        _put(message.force_on_tool_newton, total)
        message.stored_energy_joule = energy
        now = time.monotonic_ns()
        fill_header(message.header, self._session_id, side.sequence, side.offered_at_ns)
        side.receivers.take()
        if side.receivers.has(Kind.INTERACTION):
            side.receivers.send(Kind.INTERACTION, encode(Kind.INTERACTION, message))
        side.sequence += 1
        self._note(side, motion, message, total, now)

    def show(self, surface: int, vertices: ArrayLike) -> None:
        """What viewers draw from now on: index in `surfaces`, (n, 3) m in W. At most 30 times a second
        it is sent, and only if somebody watches."""
        self._display.show(surface, vertices)

    def stop(self) -> None:
        """Ends the iteration. May be called from any thread."""
        self._is_stopped = True

    @property
    def counts(self) -> Counts:
        """What has arrived and been answered so far."""
        counts = Counts()
        for side in self._sides:
            counts.motions += side.link.accepted
            counts.replies += side.sequence
            counts.refused.update(side.refused)
        return counts

    # --- telemetry

    def _note(
        self,
        side: _Side,
        motion: Motion,
        message: interaction_pb2.Interaction,
        force: NDArray[Any],
        now_ns: int,
    ) -> None:
        compute_ns = now_ns - side.offered_at_ns
        side.worst_compute_ns = max(side.worst_compute_ns, compute_ns)
        side.contact_steps += message.contact_count > 0
        batch = side.batch
        batch.sequence.append(side.step)
        side.step += 1
        if len(batch.sequence) > _BATCH_MOST:
            batch.records_lost += 1
            del batch.sequence[-1]
            return
        batch.stepped_at_ns.append(side.offered_at_ns)
        batch.device_sequence.append(motion.sequence)
        batch.tool_position_world_m.extend(motion.position)
        batch.force_on_tool_newton.extend(force)
        batch.stored_energy_joule.append(message.stored_energy_joule)
        batch.contact_count.append(message.contact_count)
        batch.compute_time_ns.append(compute_ns)

    def _serve(self, now_ns: int) -> None:
        """Viewers, and receivers that have come or gone."""
        if now_ns < self._batch_due_ns:
            return
        self._batch_due_ns = now_ns + _BATCH_NS
        self._viewers.take()
        newest = self._sides[0].newest
        self._display.publish(now_ns, 0 if newest is None else newest.device.sequence)
        for side in self._sides:
            side.receivers.take()
            if self._viewers.has(Kind.PHYSICS_TELEMETRY):
                self._send_batch(side, now_ns)
            lost = side.batch.records_lost
            side.batch.Clear()
            side.batch.records_lost = lost

    def _send_batch(self, side: _Side, now_ns: int) -> None:
        batch = side.batch
        fill_header(batch.header, self._session_id, side.batches, now_ns)
        side.batches += 1
        batch.node_version = "python"
        batch.side = side.name
        counters = batch.counters
        counters.loop.ticks = side.step
        counters.tool_motion.CopyFrom(side.link)
        counters.contact_steps = side.contact_steps
        counters.worst_compute_time_ns = side.worst_compute_ns
        self._viewers.send(Kind.PHYSICS_TELEMETRY, encode(Kind.PHYSICS_TELEMETRY, batch))

    # --- life

    def _watch_signals(self) -> dict[int, Any]:
        """The first SIGTERM or SIGINT ends the iteration, the next one has its former effect."""
        if threading.current_thread() is not threading.main_thread():
            return {}
        previous: dict[int, Any] = {}

        def on_signal(number: int, _: Optional[FrameType]) -> None:
            self._is_stopped = True
            self._restore_signals(previous)

        for number in (signal.SIGTERM, signal.SIGINT):
            previous[number] = signal.signal(number, on_signal)
        return previous

    @staticmethod
    def _restore_signals(previous: dict[int, Any]) -> None:
        while previous:
            signal.signal(*previous.popitem())

    def close(self) -> None:
        """Releases the links. mofc_node notices at once, and the force fades."""
        self.stop()
        self._links.close()

    def __enter__(self) -> "Physics":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()
