#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Starts deploy/audience/start before a running session: nginx serves the page and WebSockets over
TLS from two viewer_nodes, and hides their metrics. Exit status 77: skipped, with the reason.

    check_deployment.py BIN
"""
import contextlib
import os
import pathlib
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import time

kDeadline_s = 240.0  # for events that must happen; only a failing test waits so long
kSource = pathlib.Path(__file__).resolve().parents[3]


def await_line(process, text):
    """The rest of the line that contains the text."""
    for line in process.stdout:
        if text in line:
            return line.split(text, 1)[1].strip()
    raise SystemExit(f"FAILED: {process.args[0]} ended without a line with {text!r}")


def connect(port):
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE  # the script's own certificate
    return context.wrap_socket(socket.create_connection(("127.0.0.1", port), kDeadline_s))


def request(port, path, headers=(), host="localhost"):
    """The connection, and the head of the answer."""
    stream = connect(port)
    lines = [f"GET {path} HTTP/1.1", f"Host: {host}:{port}", *headers, "", ""]
    stream.sendall("\r\n".join(lines).encode())
    head = b""
    while b"\r\n\r\n" not in head:
        more = stream.recv(1)
        if not more:
            break
        head += more
    return stream, head.decode()


def open_websocket(port):
    stream, head = request(port, "/", (
        "Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", f"Origin: https://localhost:{port}",
        "Sec-WebSocket-Protocol: foxglove.sdk.v1"))
    assert head.startswith("HTTP/1.1 101"), head
    for channel in (1, 2, 3):  # scene, meshes, device
        text = b'{"op":"subscribe","subscriptions":[{"id":%d,"channelId":%d}]}' % (channel, channel)
        mask = b"abcd"
        masked = bytes(b ^ mask[i % 4] for i, b in enumerate(text))
        stream.sendall(bytes((0x81, 0x80 | len(text))) + mask + masked)
    return stream


def read_exactly(stream, count):
    data = b""
    while len(data) < count:
        more = stream.recv(count - len(data))
        assert more, "the connection ended"
        data += more
    return data


def await_subscriptions(stream, wanted):
    """Reads messages until each of the subscriptions has sent one."""
    missing = set(wanted)
    while missing:
        first, length = read_exactly(stream, 2)
        if length == 126:
            length = int.from_bytes(read_exactly(stream, 2), "big")
        elif length == 127:
            length = int.from_bytes(read_exactly(stream, 8), "big")
        payload = read_exactly(stream, length)
        if first & 0x0F == 2:
            missing.discard(payload[1])


def clients_of(address):
    """Of one viewer_node, from its metrics."""
    host, port = address.split(":")
    with socket.create_connection((host, int(port)), kDeadline_s) as stream:
        stream.sendall(f"GET /metrics HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n".encode())
        text = b"".join(iter(lambda: stream.recv(65536), b"")).decode()
    return [int(float(line.split()[-1])) for line in text.splitlines()
            if line.startswith("palpate_viewer_clients ")]


def check(environment, folder):
    session = folder / "class.txtpb"
    session.write_text((kSource / "deploy/sessions/default.txtpb").read_text().replace(
        'name: "default"', 'name: "class"'))
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with contextlib.ExitStack() as stack:
        def start(*command):
            process = subprocess.Popen(command, env=environment, text=True, stdout=subprocess.PIPE,
                                       stderr=subprocess.STDOUT)
            def end():
                process.terminate()
                process.wait(kDeadline_s)
            stack.callback(end)
            return process

        nodes = start("palpate", "launch", str(session), "--no-realtime", "--no-viewer")
        await_line(nodes, "event=node_started node=physics")
        audience = start(str(kSource / "deploy/audience/start"), str(session), "--viewers", "2",
                         "--audience", "4", "--port", str(port), "--host", "Class.Example",
                         "--host", "10.0.0.7")
        await_line(audience, "audience at https://Class.Example:")
        viewers = [await_line(audience, "http://").split("/")[0] for _ in range(2)]

        deadline = time.monotonic() + kDeadline_s
        while True:  # nginx may still be starting
            with contextlib.suppress(OSError):
                head = request(port, "/")[1]
                break
            assert time.monotonic() < deadline, "nginx does not answer"
            time.sleep(0.05)
        assert head.startswith("HTTP/1.1 200") and "text/html" in head, head
        assert request(port, "/metrics")[1].startswith("HTTP/1.1 404")
        # by its public name, and by no other
        head = request(port, "/", host="class.example")[1]
        assert head.startswith("HTTP/1.1 200"), head
        head = request(port, "/", host="other.example")[1]
        assert head.startswith("HTTP/1.1 403"), head

        certificate = ssl.get_server_certificate(("127.0.0.1", port))
        names = subprocess.run(["openssl", "x509", "-noout", "-ext", "subjectAltName"],
                               input=certificate, text=True, capture_output=True, check=True).stdout
        assert "DNS:Class.Example" in names and "IP Address:10.0.0.7" in names, names

        streams = [open_websocket(port) for _ in range(6)]
        for stream in streams:
            await_subscriptions(stream, (1, 2, 3))
        while True:  # metrics are written five times a second
            counts = [clients_of(viewer) for viewer in viewers]
            if counts == [[3], [3]]:
                break
            assert time.monotonic() < deadline, f"not balanced: {counts}"
            time.sleep(0.05)
        print(f"6 clients over TLS, {counts} at the viewer_nodes")


def main():
    environment = dict(os.environ, PATH=f"{sys.argv[1]}:{os.environ['PATH']}:/usr/sbin")
    for program in ("nginx", "openssl"):
        if shutil.which(program, path=environment["PATH"]) is None:
            print(f"SKIPPED: {program} is not installed (Debian package {program})")
            return 77
    with tempfile.TemporaryDirectory() as folder:
        environment["PALPATE_RUN_DIR"] = f"{folder}/run"
        check(environment, pathlib.Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
