# SPDX-License-Identifier: Apache-2.0
"""palpate.Physics alone, against a mofc_node of this test: echoes, refusals, restarts, keys, signals,
rate."""

import asyncio
import contextlib
import dataclasses
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from typing import Any, Iterator, Optional

import numpy as np
import zmq

import palpate
from palpate.v1 import interaction_pb2, tool_motion_pb2
from palpate.wire import Kind, decode, encode, subscription
from machine import measure_slowness
from support import BIN, DEADLINE_S, EXAMPLE, TestCase, until


class Mofc:
    """The other end of hops 2 and 3."""

    def __init__(self, session: palpate.session.SessionLinks, session_id: int = 7, role: str = "") -> None:
        self.context = zmq.Context()
        self.session_id, self.sequence = session_id, 0
        self.motions = self._open(zmq.PUSH, session, role)
        self.interactions = self._open(zmq.DEALER, session, role)
        self.motions.connect(session.sides[0].tool_motion)
        self.interactions.connect(session.sides[0].interaction)
        self.subscribe()

    def _open(self, kind: int, session: palpate.session.SessionLinks, role: str) -> zmq.Socket:
        end = self.context.socket(kind)
        end.setsockopt(zmq.LINGER, 0)
        if role:
            keys = palpate.links.Keys(session.key_folder, role)
            end.setsockopt(zmq.CURVE_PUBLICKEY, keys.public)
            end.setsockopt(zmq.CURVE_SECRETKEY, keys.secret)
            end.setsockopt(zmq.CURVE_SERVERKEY, keys.server_key("physics"))
        return end

    def subscribe(self) -> None:
        self.interactions.send(subscription((Kind.INTERACTION,)), zmq.NOBLOCK)

    def motion(self, z: float = 0.0) -> tool_motion_pb2.ToolMotion:
        motion = tool_motion_pb2.ToolMotion()
        palpate.wire.fill_header(motion.header, self.session_id, self.sequence, 1)
        self.sequence += 1
        motion.device.session_id, motion.device.sequence = self.session_id + 100, self.sequence
        motion.device.sampled_at_ns = 12
        motion.tool_position_world_m.z = z
        motion.tool_orientation_world.w = 1.0
        motion.tool_velocity_world_m_per_s.x = 0.5
        return motion

    def send(self, motion: tool_motion_pb2.ToolMotion) -> None:
        self.motions.send(encode(Kind.TOOL_MOTION, motion))

    def receive(self, timeout_ms: int = int(1e3 * DEADLINE_S)) -> Optional[interaction_pb2.Interaction]:
        if not self.interactions.poll(timeout_ms):
            return None
        message = decode(self.interactions.recv(), (Kind.INTERACTION,))[1]
        assert isinstance(message, interaction_pb2.Interaction)
        return message

    def answer_to(self, motion: tool_motion_pb2.ToolMotion) -> interaction_pb2.Interaction:
        """Sends it, every 100 ms like the subscription, until it is answered."""
        deadline = time.monotonic() + DEADLINE_S
        while time.monotonic() < deadline:
            self.send(motion)
            while (answer := self.receive(100)) is not None:
                if answer.answers == motion.device:
                    return answer
            self.subscribe()
            motion.header.sequence, self.sequence = self.sequence, self.sequence + 1
        raise AssertionError("no answer")

    def close(self) -> None:
        self.context.destroy(0)


class PhysicsCase(TestCase):
    def setUp(self) -> None:
        super().setUp()
        self.file = self.session("physics { rate_hz: 100 }")
        self.links = palpate.session.session_links(self.file, False)

    @contextlib.contextmanager
    def serving(self, answer=None) -> Iterator[palpate.Physics]:
        """A physics in a thread of its own; 1 N up, unless `answer(physics, motion)` replies."""
        physics = palpate.Physics(self.file)

        def serve() -> None:
            for motion in physics:
                if answer is None:
                    physics.reply(force=(0.0, 0.0, 1.0))
                else:
                    answer(physics, motion)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield physics
        finally:
            physics.stop()
            thread.join(DEADLINE_S)
            physics.close()

    def mofc(self, session_id: int = 7) -> Mofc:
        mofc = Mofc(self.links, session_id)
        self.addCleanup(mofc.close)
        return mofc


class Replies(PhysicsCase):
    def test_echo_the_stamp_and_the_pose_and_count_up(self) -> None:
        mofc = self.mofc()
        with self.serving():
            motion = mofc.motion(z=-0.001)
            first = mofc.answer_to(motion)
            second = mofc.answer_to(mofc.motion())
        self.assertEqual(first.answers, motion.device)
        self.assertEqual(first.tool_position_world_m, motion.tool_position_world_m)
        self.assertEqual(first.tool_orientation_world, motion.tool_orientation_world)
        self.assertNotEqual(first.header.session_id, 0)
        self.assertEqual(first.header.session_id, second.header.session_id)
        self.assertGreater(second.header.sequence, first.header.sequence)
        self.assertGreater(second.header.sampled_at_ns, first.header.sampled_at_ns)
        self.assertEqual(first.force_on_tool_newton.z, 1.0)

    def test_repeat_the_newest_motion_once_a_period_without_a_new_one(self) -> None:
        mofc, seen = self.mofc(), []

        def answer(physics: palpate.Physics, motion: palpate.Motion) -> None:
            seen.append(motion.is_new)
            physics.reply(force=(0, 0, 0))

        with self.serving(answer):
            begin = time.monotonic()
            mofc.answer_to(mofc.motion())
            for _ in range(5):
                mofc.subscribe()
                self.assertIsNotNone(mofc.receive())
            self.assertGreater(time.monotonic() - begin, 0.04)  # 100 Hz
            # a motion without a timely answer was sent again
            wanted = [True] + 5 * [False]
            self.assertTrue(until(lambda: any(seen[i : i + 6] == wanted for i in range(len(seen)))), seen)
        self.assertTrue(seen[0])

    def test_carry_contacts_deepest_first_with_their_sum(self) -> None:
        mofc = self.mofc()

        def answer(physics: palpate.Physics, motion: palpate.Motion) -> None:
            physics.reply(contacts=[
                palpate.Contact((1, 0, 0), -0.01, stiffness=100, tissue=1),
                palpate.Contact((0, 0, 1), 0.002, stiffness=400, damping=2, tissue=2),
            ])

        with self.serving(answer):
            got = mofc.answer_to(mofc.motion())
        self.assertEqual([one.tissue for one in got.contacts], [2, 1])
        self.assertEqual(got.contact_count, 1)
        self.assertAlmostEqual(got.force_on_tool_newton.z, 0.8)
        self.assertAlmostEqual(got.contacts[0].d_force_d_position[8], -400)
        self.assertAlmostEqual(got.contacts[0].d_force_d_velocity[8], -2)
        self.assertAlmostEqual(got.stored_energy_joule, 0.5 * 400 * 0.002**2)
        self.assertEqual(got.contacts[1].force_on_tool_newton.x, 0.0)

    def test_model_contact_points_without_stiffness(self) -> None:
        """Two points of a tissue of 400 N/m, pressed 1 and 2 mm; then out of it, where it is expected."""
        mofc = self.mofc()

        def answer(physics: palpate.Physics, motion: palpate.Motion) -> None:
            depth = -motion.position[2]
            force = (0, 0, 200 * max(0.0, depth))
            physics.reply(contacts=[
                palpate.Contact((0, 0, 1), depth, tissue=3, force_on_tool=force),
                palpate.Contact((0, 0, 1), depth, tissue=3, force_on_tool=force),
            ])

        with self.serving(answer):
            for depth_m in (-0.001, 0.001, 0.002):
                got = mofc.answer_to(mofc.motion(z=-depth_m))
            near = mofc.answer_to(mofc.motion(z=0.001))
        [contact] = got.contacts
        self.assertEqual((contact.tissue, got.contact_count), (3, 1))
        self.assertAlmostEqual(got.force_on_tool_newton.z, 0.8)
        self.assertAlmostEqual(contact.force_on_tool_newton.z, 0.8)
        self.assertAlmostEqual(contact.d_force_d_position[8], -400, delta=1)
        self.assertAlmostEqual(contact.penetration_m, 0.002, delta=1e-5)
        [contact] = near.contacts
        self.assertEqual((near.contact_count, near.force_on_tool_newton.z), (0, 0.0))
        self.assertAlmostEqual(contact.penetration_m, -0.001)

    def test_refuse_what_the_wire_would_refuse(self) -> None:
        mofc, errors = self.mofc(), []
        flat = palpate.Contact((0, 0, 1), 0.001, stiffness=0)

        def wrong(**values: Any) -> palpate.Contact:
            """Right when it is made, changed afterwards."""
            contact = palpate.Contact((0, 0, 1), 0.001)
            for name, value in values.items():
                setattr(contact, name, value)
            return contact

        def answer(physics: palpate.Physics, motion: palpate.Motion) -> None:
            for arguments in (
                {"force": (0, 0, float("nan"))}, {"force": (0, 0, 2e4)}, {"force": (0, 1)},
                {"force": (0, 0, 1), "stored_energy": -1.0}, {"contacts": 9 * [flat]},
                {"contacts": [wrong(normal=(0, 0, 2))]},
                {"contacts": [wrong(penetration=float("inf"))]},
                {"contacts": [wrong(stiffness=2e6)]},
                {"contacts": [wrong(curvature=np.ones((2, 2)))]},
                {"contacts": [palpate.Contact((0, 0, 1), 0.001)]},  # neither stiffness nor force
                {"force": (0, 0, 1), "contacts": [flat, palpate.Contact((0, 0, 1), 0.001)]},
                {"contacts": [wrong(force_on_tool=(0, 0, 2e4))]},
                {"contacts": [wrong(stiffness=1, force_on_tool=(0, 0, 1))]},
            ):
                try:
                    physics.reply(**arguments)
                except ValueError as error:
                    errors.append(str(error))
            physics.stop()

        with self.serving(answer):
            mofc.send(mofc.motion())
            self.assertTrue(until(lambda: len(errors) == 13), errors)
            self.assertIsNone(mofc.receive(300), "a refused reply was sent")
        self.assertIn("±10000", errors[1])

    def test_sustain_500_per_second_and_say_the_rate(self) -> None:
        """The example as a process, one motion at a time. Demanded of its processor time: other programs
        may run too."""
        mofc = self.mofc()
        count = 1500
        with subprocess.Popen([sys.executable, EXAMPLE, self.file]) as process:
            try:
                first = mofc.answer_to(mofc.motion()).header.sequence
                begin, begin_cpu = time.monotonic(), cpu_seconds_of(process.pid)
                for _ in range(count):
                    last = mofc.answer_to(mofc.motion(z=-0.001)).header.sequence
                    if mofc.sequence % 50 == 0:
                        mofc.subscribe()
                rate = count / (time.monotonic() - begin)
                # with repeated answers, of which a busy machine makes more
                most = (last - first) / (cpu_seconds_of(process.pid) - begin_cpu)
                slowness = max(1.0, measure_slowness().of_processor)
            finally:
                process.terminate()
        print(
            f"\nhalf_space.py: {rate:.0f} answers per second, one at a time; {most:.0f} per second of its processor",
            file=sys.stderr,
        )
        self.assertEqual(process.returncode, 0)
        self.assertGreater(most * slowness, 500)


def cpu_seconds_of(process: int) -> float:
    """Processor time of a running process so far."""
    with open(f"/proc/{process}/stat", encoding="ascii") as file:
        fields = file.read().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Motions(PhysicsCase):
    def test_refuse_bad_frames_and_go_on(self) -> None:
        mofc = self.mofc()
        good = encode(Kind.TOOL_MOTION, mofc.motion())
        with self.serving() as physics:
            mofc.answer_to(mofc.motion())
            broken = {
                "malformed": [b"", b"\x03\xff\xff", (good, good)],
                "wrong_kind": [b"\x04" + good[1:], b"\xff"],
                "too_large": [good + bytes(5000)],
            }
            for reason, change in {
                "wrong_version": lambda m: setattr(m.header, "protocol_major", 2),
                "missing_field": lambda m: m.ClearField("device"),
                "not_finite": lambda m: setattr(m.tool_position_world_m, "x", float("nan")),
                "out_of_range": lambda m: setattr(m.tool_orientation_world, "w", 2.0),
            }.items():
                motion = mofc.motion()
                change(motion)
                broken[reason] = [encode(Kind.TOOL_MOTION, motion)]
            for frames in broken.values():
                for frame in frames:
                    if isinstance(frame, tuple):
                        mofc.motions.send_multipart(frame)
                    else:
                        mofc.motions.send(frame)
            mofc.answer_to(mofc.motion())
            self.assertEqual(physics.counts.refused, {reason: len(frames) for reason, frames in broken.items()})

    def test_refuse_a_second_writer_and_accept_a_restarted_one_after_silence(self) -> None:
        first, second = self.mofc(7), self.mofc(8)
        with self.serving() as physics:
            deadline = time.monotonic() + DEADLINE_S
            while not physics.counts.refused["another_writer"]:
                self.assertLess(time.monotonic(), deadline)
                first.answer_to(first.motion())
                second.send(second.motion())
            self.assertEqual(second.answer_to(second.motion(z=0.5)).tool_position_world_m.z, 0.5)

    def test_skip_to_the_newest_and_drop_what_is_older(self) -> None:
        mofc, seen = self.mofc(), []
        go_on = threading.Event()
        go_on.set()

        def answer(physics: palpate.Physics, motion: palpate.Motion) -> None:
            if motion.is_new:
                seen.append(motion.position[2])
            physics.reply(force=(0, 0, 0))
            go_on.wait(DEADLINE_S)

        with self.serving(answer):
            mofc.answer_to(mofc.motion(z=1))
            go_on.clear()
            old = mofc.motion(z=2)
            for motion in (mofc.motion(z=3), old, mofc.motion(z=4)):
                mofc.send(motion)
            go_on.set()

            def newest_is_answered() -> bool:
                mofc.subscribe()
                answer = mofc.receive(100)
                return answer is not None and answer.tool_position_world_m.z == 4

            self.assertTrue(until(newest_is_answered), seen)
        self.assertEqual((seen[0], seen[-1]), (1, 4))
        self.assertNotIn(2, seen)

    def test_come_in_an_asyncio_loop_beside_other_tasks(self) -> None:
        mofc = self.mofc()
        beats = 0
        is_answered = threading.Event()

        async def beat() -> None:
            nonlocal beats
            while True:
                beats += 1
                await asyncio.sleep(0.001)

        async def serve() -> None:
            beating = asyncio.create_task(beat())
            with palpate.Physics(self.file) as physics:
                async for _ in physics:
                    physics.reply(force=(0, 0, 2))
                    if is_answered.is_set():
                        physics.stop()
            beating.cancel()

        thread = threading.Thread(target=lambda: asyncio.run(serve()))
        thread.start()
        self.assertEqual(mofc.answer_to(mofc.motion()).force_on_tool_newton.z, 2.0)
        until(lambda: beats > 2)
        is_answered.set()
        thread.join(DEADLINE_S)
        self.assertFalse(thread.is_alive())
        self.assertGreater(beats, 2)


class Sides(PhysicsCase):
    def test_are_served_by_one_physics_each_by_its_own_links(self) -> None:
        self.file = self.session('physics { rate_hz: 100 } side { name: "left" } side { name: "right" }')
        config = palpate.session.session_links(self.file, False)
        self.assertIn("left.tool_motion.ipc", config.sides[0].tool_motion)

        def answer(physics: palpate.Physics, motion: palpate.Motion) -> None:
            physics.reply(force=(1, 0, 0) if motion.side == "left" else (2, 0, 0))

        with self.serving(answer):
            for side, newton in zip(config.sides, (1.0, 2.0)):
                mofc = Mofc(dataclasses.replace(config, sides=(side,)))
                self.addCleanup(mofc.close)
                self.assertEqual(mofc.answer_to(mofc.motion()).force_on_tool_newton.x, newton)


class Ends(PhysicsCase):
    def test_a_signal_ends_the_program_with_status_0_and_leaves_no_file(self) -> None:
        for number in (signal.SIGTERM, signal.SIGINT):
            mofc = self.mofc()
            with subprocess.Popen([sys.executable, EXAMPLE, self.file]) as process:
                mofc.answer_to(mofc.motion())
                process.send_signal(number)
                self.assertEqual(process.wait(DEADLINE_S), 0)
            left = [path.name for path in (self.folder / "run").rglob("*") if not path.is_dir()]
            self.assertEqual(left, [])

    def test_an_endpoint_in_use_is_refused_with_the_process_that_has_it(self) -> None:
        with palpate.Physics(self.file):
            with self.assertRaisesRegex(palpate.SetupError, f"in use by process {os.getpid()}"):
                palpate.Physics(self.file)
        palpate.Physics(self.file).close()

    def test_a_folder_that_others_may_write_is_refused(self) -> None:
        shared = self.folder / "shared"
        shared.mkdir()
        shared.chmod(0o777)
        session = self.session(f'links {{ tool_motion: "ipc://{shared}/own/motion.ipc" }}')
        with self.assertRaisesRegex(palpate.SetupError, "another user may replace what is in .*shared"):
            palpate.Physics(session)

    def test_wrong_sessions_are_refused_with_place_and_remedy(self) -> None:
        for text, complaint in (
            ("nonsense { }", r"test.txtpb:2:1 : .*nonsense"),
            ('links { tool_motion: "udp://x" }', "links.tool_motion = udp://x: is not an endpoint"),
            ('links { tool_motion: "tcp://0.0.0.0:5" }', "would send plain text.*palpate keygen"),
            ('security { key_folder: "none" }', "allowed.keys: cannot be read.*palpate keygen"),
        ):
            with self.assertRaisesRegex(palpate.SetupError, complaint):
                palpate.Physics(self.session(text))
        os.environ.pop("PALPATE_PHYSICS", None)
        with self.assertRaisesRegex(palpate.SetupError, "start the program by `palpate launch`"):
            palpate.Physics()


class Keys(PhysicsCase):
    def setUp(self) -> None:
        super().setUp()
        keys = self.folder / "keys"
        subprocess.run([BIN / "palpate", "keygen", keys], check=True, capture_output=True)
        with contextlib.ExitStack() as held:
            ports = []
            for _ in range(3):
                port = held.enter_context(socket.create_server(("127.0.0.1", 0)))
                ports.append(port.getsockname()[1])
        self.file = self.session(
            'security { key_folder: "keys" } links {'
            f'  tool_motion: "tcp://127.0.0.1:{ports[0]}" interaction: "tcp://127.0.0.1:{ports[1]}"'
            f'  physics_telemetry: "tcp://127.0.0.1:{ports[2]}" }}'
        )
        self.links = palpate.session.session_links(self.file, False)

    def test_admit_the_device_and_nobody_else(self) -> None:
        with self.serving():
            device = Mofc(self.links, role="device")
            self.assertEqual(device.answer_to(device.motion()).force_on_tool_newton.z, 1.0)
            device.close()
            for role in ("viewer", ""):
                other = Mofc(self.links, session_id=99, role=role)
                with contextlib.suppress(zmq.Again):
                    other.motions.send(encode(Kind.TOOL_MOTION, other.motion()), zmq.NOBLOCK)
                self.assertIsNone(other.receive(300), f"role {role!r} was admitted")
                other.close()

    def test_secret_that_others_may_read_is_refused(self) -> None:
        (self.folder / "keys/physics.key_secret").chmod(0o644)
        with self.assertRaisesRegex(palpate.SetupError, "other users may read it.*chmod 600"):
            palpate.Physics(self.file)
