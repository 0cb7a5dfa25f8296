# SPDX-License-Identifier: Apache-2.0
"""The MCAP container, version 0 (mcap.dev/spec): chunks without compression, with indexes and a summary, so that
readers can seek. Little-endian; strings, arrays and maps have their length in bytes before them."""

from __future__ import annotations

import json
import struct
import zlib
from typing import Any, BinaryIO, Mapping

MAGIC = b"\x89MCAP0\r\n"
CHUNK_BYTES = 1 << 20  # a chunk ends when it has so many

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(0x0B, 0x10)


def _bytes(content: bytes) -> bytes:
    return struct.pack("<I", len(content)) + content


def _text(text: str) -> bytes:
    return _bytes(text.encode())


def _strings(strings: Mapping[str, str]) -> bytes:
    return _bytes(b"".join(_text(key) + _text(value) for key, value in strings.items()))


def _record(opcode: int, content: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(content)) + content


class McapFile:
    """Written from the beginning to the end: channels, then metadata and messages in the order of their times,
    then finish()."""

    def __init__(self, out: BinaryIO, library: str) -> None:
        self._out = out
        self._at = 0
        self._crc = 0
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._metadata_indexes: list[bytes] = []
        self._chunk_indexes: list[bytes] = []
        self._counts: list[int] = []  # messages of each channel
        self._chunk = bytearray()
        self._index: dict[int, list[tuple[int, int]]] = {}  # of the chunk: time and offset, by channel
        self._times_ns: list[int] = []  # first and last message
        self._chunk_times_ns: list[int] = []
        self._put(MAGIC + _record(HEADER, _text("") + _text(library)))

    def add_channel(self, topic: str, schema_name: str, schema: Mapping[str, Any], about: Mapping[str, str]) -> int:
        """A channel of JSON messages; schema as JSON Schema. Returns its number."""
        number = len(self._channels) + 1
        self._schemas.append(_record(SCHEMA, struct.pack("<H", number) + _text(schema_name) + _text("jsonschema")
                                     + _text(json.dumps(schema))))
        self._channels.append(_record(CHANNEL, struct.pack("<HH", number, number) + _text(topic) + _text("json")
                                      + _strings(about)))
        self._counts.append(0)
        self._put(self._schemas[-1] + self._channels[-1])
        return number

    def add_metadata(self, name: str, strings: Mapping[str, str]) -> None:
        record = _record(METADATA, _text(name) + _strings(strings))
        self._metadata_indexes.append(_record(METADATA_INDEX, struct.pack("<QQ", self._at, len(record)) + _text(name)))
        self._put(record)

    def write(self, channel: int, time_ns: int, message: bytes) -> None:
        self._times_ns = [*self._times_ns[:1], time_ns] if self._times_ns else [time_ns, time_ns]
        self._chunk_times_ns = [self._chunk_times_ns[0] if self._chunk_times_ns else time_ns, time_ns]
        self._index.setdefault(channel, []).append((time_ns, len(self._chunk)))
        head = struct.pack("<HIQQ", channel, self._counts[channel - 1], time_ns, time_ns)
        self._chunk += _record(MESSAGE, head + message)
        self._counts[channel - 1] += 1
        if len(self._chunk) >= CHUNK_BYTES:
            self._end_chunk()

    def finish(self) -> None:
        self._end_chunk()
        self._put(_record(DATA_END, struct.pack("<I", self._crc)))
        first_ns, last_ns = self._times_ns or (0, 0)
        counts = b"".join(struct.pack("<HQ", number, count) for number, count in enumerate(self._counts, 1))
        statistics = _record(STATISTICS, struct.pack(
            "<QHIIIIQQ", sum(self._counts), len(self._schemas), len(self._channels), 0, len(self._metadata_indexes),
            len(self._chunk_indexes), first_ns, last_ns) + _bytes(counts))
        start = self._at
        summary, offsets = b"", b""
        for opcode, records in ((SCHEMA, self._schemas), (CHANNEL, self._channels), (STATISTICS, [statistics]),
                                (CHUNK_INDEX, self._chunk_indexes), (METADATA_INDEX, self._metadata_indexes)):
            group = b"".join(records)
            if group:
                offsets += _record(SUMMARY_OFFSET, struct.pack("<BQQ", opcode, start + len(summary), len(group)))
            summary += group
        footer = struct.pack("<BQQQ", FOOTER, 20, start, start + len(summary))
        end = summary + offsets + footer
        self._put(end + struct.pack("<I", zlib.crc32(end)) + MAGIC)

    def _end_chunk(self) -> None:
        if not self._chunk:
            return
        records = bytes(self._chunk)
        begin_ns, end_ns = self._chunk_times_ns
        chunk = _record(CHUNK, struct.pack("<QQQI", begin_ns, end_ns, len(records), zlib.crc32(records)) + _text("")
                        + struct.pack("<Q", len(records)) + records)
        indexes, places = b"", b""
        for channel, entries in self._index.items():
            places += struct.pack("<HQ", channel, self._at + len(chunk) + len(indexes))
            indexes += _record(MESSAGE_INDEX, struct.pack("<H", channel)
                               + _bytes(b"".join(struct.pack("<QQ", *entry) for entry in entries)))
        self._chunk_indexes.append(_record(CHUNK_INDEX, struct.pack(
            "<QQQQ", begin_ns, end_ns, self._at, len(chunk)) + _bytes(places) + struct.pack("<Q", len(indexes))
            + _text("") + struct.pack("<QQ", len(records), len(records))))
        self._put(chunk + indexes)
        self._chunk.clear()
        self._index.clear()
        self._chunk_times_ns.clear()

    def _put(self, content: bytes) -> None:
        self._out.write(content)
        self._at += len(content)
        self._crc = zlib.crc32(content, self._crc)
