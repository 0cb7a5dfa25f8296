# SPDX-License-Identifier: Apache-2.0
"""A client of Haply's Inverse Service in plain Python, written from the documentation of its messages: no
code in common with the driver. Usage: haply_client.py PORT. Exit status 0: the service behaved as
documented. The device has to be one that nobody holds.
"""

import base64
import json
import os
import socket
import struct
import sys
import time

TEXT, BINARY = 1, 2


class WebSocket:
    """RFC 6455, as far as one unfragmented message at a time needs it."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=120)
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode())
        answer = b""
        while not answer.endswith(b"\r\n\r\n"):
            answer += self.exactly(1)
        assert answer.startswith(b"HTTP/1.1 101"), answer

    def exactly(self, count):
        data = b""
        while len(data) < count:
            piece = self.socket.recv(count - len(data))
            assert piece, "the service closed the connection"
            data += piece
        return data

    def send(self, message, opcode=TEXT):
        payload = json.dumps(message).encode()
        mask = os.urandom(4)
        size = len(payload)
        head = struct.pack("!BB", 0x80 | opcode, 0x80 | size) if size < 126 else struct.pack(
            "!BBH", 0x80 | opcode, 0x80 | 126, size)
        self.socket.sendall(head + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(payload)))

    def receive(self):
        first, size = self.exactly(2)
        assert first == 0x80 | TEXT, f"no whole text message: {first:#x}"
        if size == 126:
            (size,) = struct.unpack("!H", self.exactly(2))
        elif size == 127:
            (size,) = struct.unpack("!Q", self.exactly(8))
        return json.loads(self.exactly(size))


def main():
    service = WebSocket(int(sys.argv[1]))

    # the inventory comes unasked and is a full one
    inventory = service.receive()
    assert "session_id" in inventory
    inverse = inventory["inverse3"][0]
    assert inverse["status"]["ready"] and inverse["config"]["type"] == "inverse3"
    device = inverse["device_id"]

    def force(x, y, z, dialect="vector"):
        return {"device_id": device,
                "commands": {"set_cursor_force": {dialect: {"x": x, "y": y, "z": z}}}}

    def exchange(*commands, opcode=TEXT, **more):
        service.send({"inverse3": list(commands), **more}, opcode)
        return service.receive()

    def state(answer):
        return answer["inverse3"][0]["state"]

    # the first message names the session; zero force keeps it alive; the answer is a state only
    answer = exchange(force(0, 0, 0), session={"configure": {"profile": {"name": "client"}}})
    assert "config" not in answer["inverse3"][0] and "status" not in answer["inverse3"][0]
    grip = answer["wireless_verse_grip"][0]["state"]
    assert abs(sum(q * q for q in grip["orientation"].values()) - 1) < 1e-9
    assert set(grip["buttons"]) == {"a", "b", "c"}

    # both dialects, text and binary messages; forces of one message add up
    for dialect, opcode in (("vector", TEXT), ("values", TEXT), ("vector", BINARY)):
        acting = state(exchange(force(0, 0, 0.5, dialect), opcode=opcode))["current_cursor_force"]
        assert abs(acting["z"] - 0.5) < 1e-6, acting
    acting = state(exchange(force(0, 0, 0.25), force(0, 0.125, 0.25)))["current_cursor_force"]
    assert abs(acting["z"] - 0.5) < 1e-6 and abs(acting["y"] - 0.125) < 1e-6, acting

    # a force moves the device its own way, and holds for one message only
    begin = state(exchange(force(0, 0, 0)))["cursor_position"]["z"]
    until = time.monotonic() + 120
    moved = 0.0
    while moved < 1e-3 and time.monotonic() < until:
        moved = state(exchange(force(0, 0, 0.3)))["cursor_position"]["z"] - begin
    assert moved >= 1e-3, moved
    acting = state(exchange({"device_id": device, "commands": {"probe_position": {}}}))
    assert abs(acting["current_cursor_force"]["z"]) < 1e-6, acting

    # the device of another is left alone; a full frame comes when asked for
    other = force(0, 0, 1)
    other["device_id"] = "nobody"
    assert abs(state(exchange(other))["current_cursor_force"]["z"]) < 1e-6
    full = exchange(force(0, 0, 0), session={"force_render_full_state": {}})
    assert full["inverse3"][0]["config"]["device_info"] and full["session_id"] == inventory["session_id"]
    print(f"device {device}: as documented")


main()
