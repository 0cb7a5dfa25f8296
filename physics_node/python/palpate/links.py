# SPDX-License-Identifier: Apache-2.0
"""Sockets of the links: options, exclusive ipc paths, keys, subscriptions. What docs/wire.md says
under Hops and Keys."""

from __future__ import annotations

import fcntl
import ipaddress
import os
import re
import stat
import time
from pathlib import Path
from typing import IO, Iterable, Optional

import zmq
import zmq.auth.thread

from .errors import SetupError
from .wire import Kind, subscribed_kinds, subscription

# link: (role of the binding end, role of the connecting end)
ROLES = {
    "tool_motion": ("physics", "device"),
    "interaction": ("physics", "device"),
    "device_telemetry": ("device", "viewer"),
    "mofc_telemetry": ("device", "viewer"),
    "physics_telemetry": ("physics", "viewer"),
}
_ROLES = ("device", "physics", "standby", "viewer", "pointer", "relay", "audience")
_ZAP_ENFORCE_DOMAIN = 93
_SUBSCRIPTION_BYTES = 1 << 10
_Z85 = re.compile(r"[0-9a-zA-Z.\-:+=^!/*?&<>()\[\]{}@%$#]{40}")

# socket type, send queue, receive queue, kernel buffers, linger in ms, longest frame in bytes
_SETTINGS: dict[tuple[str, bool], tuple[int, int, int, int, int, int]] = {
    ("tool_motion", True): (zmq.PULL, 1, 256, 8 << 10, 0, 16 << 10),
    ("interaction", True): (zmq.ROUTER, 4, 4, 8 << 10, 0, _SUBSCRIPTION_BYTES),
    ("physics_telemetry", True): (zmq.ROUTER, 32, 4, 64 << 10, 200, _SUBSCRIPTION_BYTES),
    ("device_telemetry", False): (zmq.DEALER, 4, 128, 64 << 10, 0, 17 << 20),
    ("mofc_telemetry", False): (zmq.DEALER, 4, 128, 64 << 10, 0, 17 << 20),
    ("physics_telemetry", False): (zmq.DEALER, 4, 128, 64 << 10, 0, 17 << 20),
}


class Keys:
    """allowed.keys of a folder of `palpate keygen`, and the key pair of one role. Raises SetupError."""

    def __init__(self, folder: Path, role: str) -> None:
        self.role = role
        allowed = folder / "allowed.keys"
        self.allowed: dict[str, str] = {}  # key: role
        for number, words in enumerate(map(str.split, _private_text(allowed, False)), 1):
            if not words or words[0].startswith("#"):
                continue
            if len(words) != 2 or words[0] not in _ROLES or not _Z85.fullmatch(words[1]):
                raise SetupError(
                    f"{allowed}:{number}: must be {', '.join(_ROLES[:-1])} or {_ROLES[-1]} and a "
                    "key of 40 characters; copy the line of `palpate keygen`"
                )
            self.allowed[words[1]] = words[0]
        secret = folder / f"{role}.key_secret"
        pair = dict(
            re.findall(r'^\s*(public|secret)-key\s*=\s*"(.{40})"', "\n".join(_private_text(secret, True)), re.M)
        )
        if set(pair) != {"public", "secret"} or not all(map(_Z85.fullmatch, pair.values())):
            raise SetupError(f"{secret}: lacks a public-key or a secret-key; copy the whole file")
        if self.allowed.get(pair["public"]) != role:
            raise SetupError(f"{secret}: its public key is not listed for {role} in {allowed}; copy that file")
        self.public = pair["public"].encode()
        self.secret = pair["secret"].encode()

    def server_key(self, role: str) -> bytes:
        """The only key of a role that binds."""
        keys = [key for key, of in self.allowed.items() if of == role]
        if len(keys) != 1:
            raise SetupError(f"allowed.keys must list exactly one key of {role}, not {len(keys)}")
        return keys[0].encode()


def _private_text(file: Path, is_secret: bool) -> list[str]:
    try:
        status = file.stat()
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SetupError(
            f"{file}: cannot be read ({error}); make keys with `palpate keygen FOLDER`, or check "
            "security.key_folder"
        ) from None
    others = 0o077 if is_secret else 0o022
    if status.st_uid not in (0, os.geteuid()) or status.st_mode & others:
        raise SetupError(
            f"{file}: other users may {'read' if is_secret else 'change'} it; chown it to yourself and "
            f"chmod {'600' if is_secret else '644'}"
        )
    return text.splitlines()


class _Admitted:
    """Credentials for pyzmq's ZAP handler: the keys of the roles that may connect to one link."""

    def __init__(self, keys: Keys, role: str) -> None:
        self._keys, self._role = keys, role

    def callback(self, domain: str, key: bytes) -> bool:
        return self._keys.allowed.get(key.decode()) == self._role


class Links:
    """Makes the sockets of one program. Close it after its sockets."""

    def __init__(self, keys: Optional[Keys], insecure: bool) -> None:
        self._context = zmq.Context()
        self._keys, self._insecure = keys, insecure
        self._claims: list[tuple[IO[str], Path]] = []
        self._sockets: list[zmq.Socket[bytes]] = []
        self._zap: Optional[zmq.auth.thread.ThreadAuthenticator] = None

    def open(self, link: str, endpoint: str, binds: bool) -> zmq.Socket[bytes]:
        """Binds or connects `link`. Raises SetupError."""
        kind, send_queue, receive_queue, buffers, linger, longest = _SETTINGS[link, binds]
        socket = self._context.socket(kind)
        self._sockets.append(socket)
        socket.setsockopt(zmq.IPV6, 1)
        socket.setsockopt(zmq.LINGER, linger)
        socket.setsockopt(zmq.SNDHWM, send_queue)
        socket.setsockopt(zmq.RCVHWM, receive_queue)
        socket.setsockopt(zmq.MAXMSGSIZE, longest)
        socket.setsockopt(zmq.RECONNECT_IVL, 10)
        socket.setsockopt(zmq.CONNECT_TIMEOUT, 500)
        socket.setsockopt(zmq.HANDSHAKE_IVL, 2000)
        if kind == zmq.ROUTER:
            socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
        name = f"links.{link} = {endpoint}"
        if endpoint.startswith("tcp://"):
            socket.setsockopt(zmq.TCP_MAXRT, 500)
            socket.setsockopt(zmq.TCP_KEEPALIVE, 1)
            for option in (zmq.TCP_KEEPALIVE_IDLE, zmq.TCP_KEEPALIVE_INTVL):
                socket.setsockopt(option, 1)
            socket.setsockopt(zmq.TCP_KEEPALIVE_CNT, 3)
            socket.setsockopt(zmq.SNDBUF, buffers)
            socket.setsockopt(zmq.RCVBUF, buffers)
            self._protect(socket, link, endpoint, binds)
        elif endpoint.startswith("ipc:///"):
            path = Path(endpoint[len("ipc://") :])
            _make_private(path.parent, name)
            if binds:
                self._claim(path, name)
        else:
            raise SetupError(f"{name}: is not an endpoint; give ipc:///PATH or tcp://HOST:PORT")
        try:
            (socket.bind if binds else socket.connect)(endpoint)
        except zmq.ZMQError as error:
            raise SetupError(
                f"{name}: cannot {'bind' if binds else 'connect'} ({error.strerror}); stop the program "
                "that uses it, or give another endpoint"
            ) from None
        return socket

    def _protect(self, socket: zmq.Socket[bytes], link: str, endpoint: str, binds: bool) -> None:
        server, client = ROLES[link]
        if self._keys is None:
            if self._insecure or _is_loopback(endpoint):
                return
            raise SetupError(
                f"links.{link} = {endpoint}: would send plain text and be open to other machines; make "
                "keys with `palpate keygen DIR` and give security { key_folder: \"DIR\" } to the session, "
                "or use insecure=True on an isolated network"
            )
        socket.setsockopt(zmq.CURVE_PUBLICKEY, self._keys.public)
        socket.setsockopt(zmq.CURVE_SECRETKEY, self._keys.secret)
        if not binds:
            socket.setsockopt(zmq.CURVE_SERVERKEY, self._keys.server_key(server))
            return
        if self._zap is None:
            self._zap = zmq.auth.thread.ThreadAuthenticator(self._context)
            self._zap.start()
        domain = f"links.{link}"
        self._zap.configure_curve_callback(domain, credentials_provider=_Admitted(self._keys, client))
        socket.setsockopt(zmq.CURVE_SERVER, 1)
        socket.setsockopt(zmq.ZAP_DOMAIN, domain.encode())
        socket.setsockopt(_ZAP_ENFORCE_DOMAIN, 1)

    def _claim(self, path: Path, name: str) -> None:
        """libzmq takes over an ipc path in use without a word: hold a lock beside it."""
        lock_path = Path(f"{path}.lock")
        while True:
            descriptor = os.open(lock_path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o600)
            lock = os.fdopen(descriptor, "r+")
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                holder = lock.read().strip() or "?"
                lock.close()
                raise SetupError(
                    f"{name}: in use by process {holder}; stop it or give another endpoint"
                ) from None
            try:
                if os.path.samestat(os.fstat(descriptor), lock_path.stat()):
                    break
            except FileNotFoundError:
                pass
            lock.close()  # its last holder removed it between opening and locking
        lock.truncate(0)
        lock.write(str(os.getpid()))
        lock.flush()
        self._claims.append((lock, path))
        if path.exists() and not path.is_socket():
            raise SetupError(f"{name}: this path is a file that is not a socket; remove it")
        path.unlink(missing_ok=True)

    def close(self) -> None:
        """Closes all sockets and removes their ipc files."""
        for socket in self._sockets:
            socket.close()
        if self._zap is not None:
            self._zap.stop()
        self._context.term()
        for lock, path in self._claims:
            for file in (path, Path(f"{path}.lock")):
                if file.is_socket() or file.suffix == ".lock":
                    file.unlink(missing_ok=True)
            lock.close()
        self._claims.clear()


def _is_loopback(endpoint: str) -> bool:
    host = endpoint[len("tcp://") :].rpartition(":")[0].strip("[]")
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _make_private(folder: Path, name: str) -> None:
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        status = folder.lstat()
    except OSError as error:
        raise SetupError(f"{name}: {error}; give a path in a folder of your own") from None
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.geteuid() or status.st_mode & 0o022:
        raise SetupError(f"{name}: {folder} is not a folder that you alone may write; give another")
    for above in folder.resolve().parents:
        status = above.stat()
        is_open = status.st_mode & 0o022 and not status.st_mode & stat.S_ISVTX
        if is_open or status.st_uid not in (0, os.geteuid()):
            raise SetupError(f"{name}: another user may replace what is in {above}; give a folder of your own")


class Subscribers:
    """The receivers of a ROUTER that binds, and the kinds that each of them wants."""

    MOST = 32
    SILENCE_S = 1.0

    def __init__(self, socket: zmq.Socket[bytes]) -> None:
        self._socket = socket
        self._peers: dict[bytes, tuple[frozenset[int], float]] = {}
        self._news: set[int] = set()

    def take(self) -> None:
        """Reads the subscriptions that have arrived."""
        now = time.monotonic()
        for _ in range(self.MOST):
            try:
                peer, *frames = self._socket.recv_multipart(zmq.NOBLOCK)
            except zmq.Again:
                break
            kinds = subscribed_kinds(frames[0]) if len(frames) == 1 else None
            if kinds is not None and (peer in self._peers or len(self._peers) < self.MOST):
                self._news |= kinds - self._peers.get(peer, (frozenset(), 0.0))[0]
                self._peers[peer] = (kinds, now)
        for peer in [p for p, (_, at) in self._peers.items() if now - at >= self.SILENCE_S]:
            del self._peers[peer]

    def has(self, kind: Kind) -> bool:
        return any(kind in kinds for kinds, _ in self._peers.values())

    def has_new(self, kind: Kind) -> bool:
        """Whether somebody has subscribed to it since the last call."""
        is_new = kind in self._news
        self._news.discard(kind)
        return is_new

    def send(self, kind: Kind, frame: bytes) -> bool:
        """To all that want the kind; one whose queue is full misses it. False: none wants it."""
        is_wanted = False
        for peer in [p for p, (kinds, _) in self._peers.items() if kind in kinds]:
            try:
                self._socket.send_multipart((peer, frame), zmq.NOBLOCK)
            except zmq.Again:
                pass
            except zmq.ZMQError:  # EHOSTUNREACH: it has gone
                del self._peers[peer]
                continue
            is_wanted = True
        return is_wanted


class Subscription:
    """Tells the sender, every 100 ms, which kinds a DEALER wants."""

    INTERVAL_S = 0.1

    def __init__(self, socket: zmq.Socket[bytes], kinds: Iterable[Kind]) -> None:
        self._socket, self._frame = socket, subscription(kinds)
        self._due = 0.0

    def send_if_due(self) -> None:
        now = time.monotonic()
        if now < self._due:
            return
        try:
            self._socket.send(self._frame, zmq.NOBLOCK)
        except zmq.Again:
            pass  # four wait for the connection
        self._due = now + self.INTERVAL_S
