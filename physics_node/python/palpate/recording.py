# SPDX-License-Identifier: Apache-2.0
"""Recordings of Palpate (MCAP) as numpy columns."""

from __future__ import annotations

import mmap
import struct
import warnings
import zlib
from pathlib import Path
from typing import Any, Iterator, Union

import numpy as np
from numpy.typing import NDArray

from .errors import SetupError
from .telemetry import NODES, columns_of
from .wire import MESSAGES, Kind

_MAGIC = b"\x89MCAP0\r\n"
_CHANNEL, _MESSAGE, _CHUNK, _METADATA = 0x04, 0x05, 0x06, 0x0C
_DATA_END = 0x0F
_TOPICS = {**NODES, "scene_state": Kind.SCENE_STATE, "mesh": Kind.MESH_FRAME}


class Recording:
    """A file of `palpate launch|loopback --record`.

        recording = palpate.Recording("run.mcap")
        force = recording.columns("device")["force_on_hand_newton"]  # (ticks, 3)

    What is damaged is left out with a warning, as `palpate info` leaves it out: a file whose writer
    was killed is read up to its last complete chunk.

    :ivar metadata: by name; "palpate" has the session and its overrides
    :ivar sides: names of the sides; [""] with one device
    :ivar is_complete: the writer closed it
    :ivar damage: what is missing of it, "2 damaged chunks, its end"; "": nothing
    :raises SetupError: not a recording, or compressed by another writer
    """

    def __init__(self, file: Union[str, Path]) -> None:
        self.file = Path(file)
        self.metadata: dict[str, dict[str, str]] = {}
        self.is_complete = False
        self._damaged_chunks = 0
        self._topics: dict[int, str] = {}
        self._messages: dict[str, list[tuple[int, memoryview]]] = {}
        try:
            with self.file.open("rb") as opened:
                if self.file.stat().st_size == 0:
                    raise SetupError(f"recording {file}: is empty; give one of --record")
                content = mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise SetupError(f"recording {file}: cannot be read ({error})") from None
        if content[: len(_MAGIC)] != _MAGIC:
            raise SetupError(f"recording {file}: is not an MCAP file; give one of --record")
        try:
            self._read(memoryview(content)[len(_MAGIC) :])
        except (struct.error, UnicodeDecodeError, IndexError):
            self.is_complete = False  # what follows cannot be found
        parts = [f"{self._damaged_chunks} damaged chunks"] if self._damaged_chunks else []
        self.damage = ", ".join(parts + ([] if self.is_complete else ["its end: the file was not closed"]))
        if self.damage:
            warnings.warn(
                f"recording {file} is damaged; missing: {self.damage}; `palpate recover` writes the rest as a "
                "whole recording",
                stacklevel=2,
            )
        run = self.metadata.get("palpate", {})
        self.session: str = run.get("session", "")
        self.sides: list[str] = run.get("sides", "").split(",")

    def __repr__(self) -> str:
        name = self.metadata.get("palpate", {}).get("session_name", "")
        times = [time_ns for messages in self._messages.values() for time_ns, _ in (messages[0], messages[-1])]
        length_s = 1e-9 * (max(times) - min(times)) if times else 0.0
        damaged = f", damaged: {self.damage}" if self.damage else ""
        return f"<Recording {str(self.file)!r}: {name}, {length_s:.3f} s{damaged}>"

    def _read(self, bytes_: memoryview) -> None:
        for opcode, content in _records(bytes_):
            if opcode == _CHANNEL:
                identity, _ = struct.unpack_from("<HH", content)
                self._topics[identity] = _text(content, 4)[0]
            elif opcode == _METADATA:
                name, at = _text(content, 0)
                self.metadata[name] = _strings(content, at)
            elif opcode == _CHUNK:
                self._read_chunk(content)
            elif opcode == _MESSAGE:
                self._keep(content)
            elif opcode == _DATA_END:
                self.is_complete = True
                return

    def _read_chunk(self, content: memoryview) -> None:
        _, _, _, crc = struct.unpack_from("<QQQI", content)
        compression, at = _text(content, 28)
        if compression:
            raise SetupError(
                f"recording {self.file}: its chunks are compressed ({compression}), which Palpate does "
                "not do; rewrite it with `mcap compress --compression none`"
            )
        (length,) = struct.unpack_from("<Q", content, at)
        records = content[at + 8 : at + 8 + length]
        if len(records) < length or (crc and zlib.crc32(records) != crc):
            self._damaged_chunks += 1
            return
        for opcode, message in _records(records):
            if opcode == _MESSAGE:
                self._keep(message)

    def _keep(self, content: memoryview) -> None:
        channel, _, log_time = struct.unpack_from("<HIQ", content)
        self._messages.setdefault(self._topics.get(channel, ""), []).append((log_time, content[22:]))

    def messages(self, topic: str) -> Iterator[tuple[int, Any]]:
        """Time of the recorder in ns, and protobuf message, of everything recorded on a topic.

        :param topic: device, mofc, physics, scene_state or mesh
        """
        if topic not in _TOPICS:
            raise ValueError(f"{topic!r}: must be one of {', '.join(_TOPICS)}")
        for time_ns, payload in self._messages.get(f"/{topic}", ()):
            message = MESSAGES[_TOPICS[topic]]()
            message.ParseFromString(bytes(payload))
            yield time_ns, message

    def columns(self, node: str, side: str = "") -> dict[str, NDArray[Any]]:
        """All ticks of a node: columns by field of telemetry.proto, in the units of their names.

        :param node: device, mofc or physics
        :param side: of the session; "" with one device
        """
        if side not in self.sides:
            raise ValueError(f"side = {side!r}: this recording has {', '.join(map(repr, self.sides))}")
        if node not in NODES:
            raise ValueError(f"node = {node!r}: must be one of {', '.join(NODES)}")
        parts = [columns_of(message) for _, message in self.messages(node) if message.side == side]
        parts = [part for part in parts if next(iter(part.values())).size]
        if not parts:
            return columns_of(MESSAGES[NODES[node]]())
        return {name: _joined([part[name] for part in parts]) for name in parts[0]}

    def frame(self, node: str, side: str = "") -> Any:
        """columns() as a pandas.DataFrame, if pandas is installed; vectors as NAME_x, _y, _z."""
        try:
            import pandas
        except ImportError:
            raise SetupError("pandas is not installed; apt-get install python3-pandas, or use columns()") from None
        flat: dict[str, NDArray[Any]] = {}
        for name, column in self.columns(node, side).items():
            if column.ndim == 1:
                flat[name] = column
                continue
            for i, axis in enumerate("xyz" if column.shape[1] == 3 else "wxyz"):
                flat[f"{name}_{axis}"] = column[:, i]
        return pandas.DataFrame({name: column for name, column in flat.items() if column.size})


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    given = [part for part in parts if part.size]
    return np.concatenate(given) if given else parts[0]


def _records(bytes_: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Opcode and content of each complete record."""
    at = 0
    while at + 9 <= len(bytes_):
        (length,) = struct.unpack_from("<Q", bytes_, at + 1)
        if at + 9 + length > len(bytes_):
            return
        yield bytes_[at], bytes_[at + 9 : at + 9 + length]
        at += 9 + length


def _text(content: memoryview, at: int) -> tuple[str, int]:
    (length,) = struct.unpack_from("<I", content, at)
    end = at + 4 + length
    return str(content[at + 4 : end], "utf-8"), end


def _strings(content: memoryview, at: int) -> dict[str, str]:
    (length,) = struct.unpack_from("<I", content, at)
    at, end = at + 4, at + 4 + length
    strings = {}
    while at < end:
        key, at = _text(content, at)
        strings[key], at = _text(content, at)
    return strings
