#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the generated parts of docs/wire.md: the fields of every message, and two frames byte by byte.

  proto/wire_reference.py            refreshes the page
  proto/wire_reference.py --check    status 1 if the page differs from the protos
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from pathlib import Path

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message

PROTO = Path(__file__).resolve().parent
PAGE = PROTO.parent / "docs/wire.md"
FILES = ("common", "exchange", "tool_motion", "interaction", "telemetry", "scene", "hand_target", "run",
         "tissue_change", "acknowledgement")
KINDS = {"ToolMotion": 3, "Interaction": 4}
F = descriptor_pb2.FieldDescriptorProto


def descriptor_set() -> descriptor_pb2.FileDescriptorSet:
    with tempfile.NamedTemporaryFile() as file:
        subprocess.run(
            ["protoc", f"-I{PROTO}", "--include_imports", "--include_source_info",
             f"--descriptor_set_out={file.name}", *(f"palpate/v1/{name}.proto" for name in FILES)],
            check=True,
        )
        return descriptor_pb2.FileDescriptorSet.FromString(Path(file.name).read_bytes())


# --- fields


class Comments:
    """Comments of one file by the path of the element."""

    def __init__(self, file: descriptor_pb2.FileDescriptorProto) -> None:
        self._of = {tuple(one.path): one for one in file.source_code_info.location}

    def text(self, *path: int) -> str:
        one = self._of.get(path)
        parts = () if one is None else (one.leading_comments, one.trailing_comments)
        joined = [" ".join(part.split()) for part in parts if part.strip()]
        return " ".join(text if text.endswith((".", ":")) or i + 1 == len(joined) else f"{text}."
                        for i, text in enumerate(joined))


def type_text(field: F) -> str:
    name = field.type_name.rsplit(".", 1)[-1]
    text = f"[{name}](#{name.lower()})" if name else F.Type.Name(field.type)[len("TYPE_"):].lower()
    if field.label == F.LABEL_REPEATED:
        return f"repeated {text}"
    return text


def table(message: descriptor_pb2.DescriptorProto, comments: Comments, path: tuple[int, ...]) -> list[str]:
    lines = [f"### {message.name}", ""]
    if about := comments.text(*path):
        lines += [about, ""]
    lines += ["| field | number | type | meaning |", "|---|---|---|---|"]
    for i, field in enumerate(message.field):
        meaning = comments.text(*path, 2, i).replace("|", "\\|") or "–"
        lines.append(f"| `{field.name}` | {field.number} | {type_text(field)} | {meaning} |")
    lines.append("")
    for i, nested in enumerate(message.nested_type):
        lines += table(nested, comments, (*path, 3, i))
    for i, enum in enumerate(message.enum_type):
        values = (
            f"{value.number} `{value.name}`" + (f" ({about})" if (about := comments.text(*path, 4, i, 2, j)) else "")
            for j, value in enumerate(enum.value)
        )
        lines += [f"### {enum.name}", "", ", ".join(values) + ".", ""]
    return lines


def fields(files: descriptor_pb2.FileDescriptorSet) -> str:
    by_name = {file.name: file for file in files.file}
    lines = []
    for name in FILES:
        file = by_name[f"palpate/v1/{name}.proto"]
        comments = Comments(file)
        for i, message in enumerate(file.message_type):
            lines += table(message, comments, (4, i))
    return "\n".join(lines)


# --- example frames


def example(message: Message) -> None:
    """Numbers that are easy to find in the bytes."""
    message.header.protocol_major = 1
    message.header.session_id = 0x0807060504030201
    message.header.sequence = 5
    message.header.sampled_at_ns = 1_000_000_000
    stamp = message.device if message.DESCRIPTOR.name == "ToolMotion" else message.answers
    stamp.session_id, stamp.sequence, stamp.sampled_at_ns = 0x1817161514131211, 42, 2_000_000_000
    message.tool_position_world_m.z = -0.002
    message.tool_orientation_world.w = 1.0
    if message.DESCRIPTOR.name == "ToolMotion":
        message.tool_velocity_world_m_per_s.z = -0.1
        message.buttons = 1
        return
    message.force_on_tool_newton.z = 0.8
    message.stored_energy_joule = 0.0008
    contact = message.contacts.add(penetration_m=0.002, stored_energy_joule=0.0008, trust_radius_m=1.0)
    contact.normal_world.z = 1.0
    contact.force_on_tool_newton.z = 0.8
    contact.surface_velocity_world_m_per_s.SetInParent()
    contact.elastic_force_on_tool_newton.z = 0.8
    contact.d_force_d_position.extend(8 * [0.0] + [-400.0])
    message.contact_count = 1


def varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes((*out, value))


def annotated(message: Message, depth: int) -> list[tuple[bytes, str]]:
    rows: list[tuple[bytes, str]] = []
    indent = "  " * depth
    for field, value in message.ListFields():
        if field.message_type is None:
            alone = type(message)()
            if field.label == field.LABEL_REPEATED:
                getattr(alone, field.name).extend(value)
                text = ", ".join(f"{one:g}" for one in value)
            else:
                setattr(alone, field.name, value)
                text = f"{value:#x}" if field.name == "session_id" else f"{value}"
            rows.append((alone.SerializeToString(), f"{indent}{field.name} = {text}"))
            continue
        for one in value if field.label == field.LABEL_REPEATED else (value,):
            content = one.SerializeToString()
            rows.append((varint(field.number << 3 | 2) + varint(len(content)),
                         f"{indent}{field.name}, {len(content)} bytes"))
            rows += annotated(one, depth + 1)
    return rows


def frame_text(name: str, message: Message) -> str:
    example(message)
    rows = [(bytes((KINDS[name],)), f"kind byte: {name}"), *annotated(message, 0)]
    assert b"".join(row for row, _ in rows)[1:] == message.SerializeToString()
    lines = [f"`{name}`, {1 + message.ByteSize()} bytes:", "", "```"]
    for content, meaning in rows:
        for at in range(0, len(content), 16):
            text = content[at : at + 16].hex(" ")
            lines.append(f"{text:<47} ; {meaning}" if at == 0 else f"{text:<47} ;")
    return "\n".join([*lines, "```", ""])


def frames(files: descriptor_pb2.FileDescriptorSet) -> str:
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    factory = message_factory.MessageFactory(pool)
    return "\n".join(
        frame_text(name, factory.GetPrototype(pool.FindMessageTypeByName(f"palpate.v1.{name}"))())
        for name in KINDS
    )


def refreshed(page: str) -> str:
    files = descriptor_set()
    for name, text in (("frames", frames(files)), ("fields", fields(files))):
        begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
        if page.count(begin) != 1 or page.count(end) != 1:
            sys.exit(f"{PAGE}: needs one pair of markers {begin} … {end}")
        page = re.sub(f"{begin}.*{end}", lambda _: f"{begin}\n\n{text}\n{end}", page, flags=re.S)
    return page


def main() -> None:
    if sys.argv[1:] not in ([], ["--check"]):
        sys.exit(__doc__)
    page = PAGE.read_text(encoding="utf-8")
    new = refreshed(page)
    if sys.argv[1:] and new != page:
        sys.exit(f"{PAGE} differs from the protos; refresh it with proto/wire_reference.py")
    if not sys.argv[1:]:
        PAGE.write_text(new, encoding="utf-8")


main()
