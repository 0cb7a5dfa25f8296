#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The type hashes of ROS 2 (RIHS01, REP-2011) of the messages in ros_messages.idl: SHA-256 of the JSON of
a type's description, its fields in order, followed by those of the types that it uses, by name.

    type_hashes.py            prints them
    type_hashes.py --header   prints type_hashes.h, as it is to be
"""
import hashlib
import json
import pathlib
import re
import sys

NESTED, STRING = 1, 17
# type_description_interfaces/msg/FieldType: what the .msg files call int32, uint8, bool, …
NUMBERS = {"octet": 3, "long": 6, "unsigned long": 7, "float": 10, "double": 11, "boolean": 15}
UNBOUNDED_SEQUENCE = 144  # is added
# Those that are sent or received as a whole.
TOPICS = ("crtk_msgs/msg/OperatingState", "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/TwistStamped",
          "geometry_msgs/msg/WrenchStamped", "sensor_msgs/msg/JointState", "sensor_msgs/msg/Joy",
          "std_msgs/msg/Float64", "tf2_msgs/msg/TFMessage", "visualization_msgs/msg/Marker")


def types_of(idl):
    """Every struct by its name in ROS 2: a list of (field, type, is a sequence)."""
    types = {}
    idl = re.sub(r"//.*", "", idl)
    for package, body in re.findall(r"module (\w+) \{ module msg \{ module dds_ \{(.*?)\}; \}; \};", idl, re.S):
        for name, fields in re.findall(r"struct (\w+)_ \{(.*?)\};", body, re.S):
            described = []
            for kind, field in re.findall(r"\s*(.+?)\s+(\w+);", fields):
                sequence = re.fullmatch(r"sequence<(.+)>", kind)
                kind = sequence.group(1) if sequence else kind
                if kind not in NUMBERS and kind != "string":
                    kind = kind.replace("::msg::dds_::", "/msg/").removesuffix("_")
                    kind = kind if "/" in kind else f"{package}/msg/{kind}"
                described.append((field, kind, bool(sequence)))
            types[f"{package}/msg/{name}"] = described
    return types


def description(types, name):
    """As type_description_interfaces/msg/IndividualTypeDescription, without default values."""
    fields = []
    for field, kind, is_sequence in types[name]:
        is_nested = kind in types
        type_id = NESTED if is_nested else STRING if kind == "string" else NUMBERS[kind]
        fields.append({"name": field, "type": {
            "type_id": type_id + (UNBOUNDED_SEQUENCE if is_sequence else 0), "capacity": 0, "string_capacity": 0,
            "nested_type_name": kind if is_nested else ""}})
    return {"type_name": name, "fields": fields}


def used_by(types, name):
    direct = {kind for _, kind, _ in types[name] if kind in types}
    return direct.union(*(used_by(types, kind) for kind in direct))


def type_hash(types, name):
    text = json.dumps({"type_description": description(types, name),
                       "referenced_type_descriptions": [description(types, used)
                                                        for used in sorted(used_by(types, name))]})
    return "RIHS01_" + hashlib.sha256(text.encode()).hexdigest()


def header(hashes):
    lines = ["// SPDX-License-Identifier: Apache-2.0",
             "// type_hashes.h — the type hashes of ROS 2 of the messages in ros_messages.idl. Written by",
             "// type_hashes.py --header; a test computes them again.",
             "#pragma once", "", "namespace palpate::ros {", ""]
    for name, value in hashes.items():
        lines += [f"inline constexpr const char* k{name.rsplit('/', 1)[1]}Hash =", f'    "{value}";']
    return "\n".join(lines + ["", "}  // namespace palpate::ros", ""])


def main():
    types = types_of((pathlib.Path(__file__).parent / "ros_messages.idl").read_text())
    hashes = {name: type_hash(types, name) for name in TOPICS}
    if "--header" in sys.argv:
        sys.stdout.write(header(hashes))
    else:
        for name, value in hashes.items():
            print(name, value)


if __name__ == "__main__":
    main()
