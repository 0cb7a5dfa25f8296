# SPDX-License-Identifier: Apache-2.0
"""`palpate loopback` for notebooks and the CI of other projects."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any, Iterator, Mapping, Optional, Union

import numpy as np

from .contact import _real
from .errors import EXIT_SETUP_ERROR, SetupError
from .v1 import session_pb2


def loopback(
    session: Union[str, Path],
    sets: Optional[Mapping[str, object]] = None,
    *,
    seconds: Optional[float] = None,
    record: Union[str, Path, None] = None,
    timeout_s: Optional[float] = None,
    program: Union[str, Path, None] = None,
) -> dict[str, Any]:
    """Runs a session on virtual time and returns its figures, as docs/glossary.md defines them.

    Repeatable: the same session gives the same figures.

    :param sets: fields to override, as --set: {"mofc.mode": "paper", "scene.tissue[0].…": 800}; True and
        False also for on and off: {"device.monitor": False}; a list for a list, a dict for the fields of a
        message: {"mofc": {"mode": "paper"}}
    :param seconds: simulated time, s; None: duration_s of the session
    :param timeout_s: longest wall-clock time of the run, s; None: without end
    :param record: also writes the recording there (see Recording)
    :param program: of `palpate`; None: $PALPATE_BIN/palpate, else the one in PATH
    :raises ValueError: a value of `sets` is None or of another type, or seconds is no number
    :raises SetupError: the session is refused, or there is no such program
    :raises TimeoutError: the run took longer than timeout_s
    """
    if program is None:
        folder = os.environ.get("PALPATE_BIN")
        program = f"{folder}/palpate" if folder else shutil.which("palpate")
    if program is None:
        raise SetupError("no program `palpate` in PATH; install Palpate, or set PALPATE_BIN to its folder")
    command = [str(program), "loopback", str(session), "--json", "-"]
    for setting in _settings(sets or {}):
        command += ["--set", setting]
    if seconds is not None:
        command += ["--seconds", repr(float(_real("seconds", seconds)))]
    if record is not None:
        command += ["--record", str(record)]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=timeout_s)
    except subprocess.TimeoutExpired:
        raise TimeoutError(
            f"palpate loopback {session}: not done after {timeout_s:g} s; give less `seconds`, a lower "
            "device.rate_hz, or a longer timeout_s"
        ) from None
    except OSError as error:
        raise SetupError(f"{program}: cannot be started ({error})") from None
    if ended.returncode == EXIT_SETUP_ERROR:
        raise SetupError(ended.stderr.strip())
    if ended.returncode != 0:
        raise RuntimeError(f"palpate loopback ended with status {ended.returncode}: {ended.stderr.strip()}")
    figures: dict[str, Any] = json.loads(ended.stdout)
    return figures


def _settings(sets: Mapping[str, object], around: str = "") -> Iterator[str]:
    """path=value of every field; those of a dict in it one by one."""
    for name, value in sets.items():
        if not isinstance(name, str):
            raise ValueError(f"sets: {around}{name!r}: must be the name of a field")
        path = around + name
        if isinstance(value, Mapping) and value:
            yield from _settings(value, path + ".")
        else:
            yield f"{path}={'{}' if isinstance(value, Mapping) else _text_of(path, value)}"


def _text_of(path: str, value: object) -> str:
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    field = _field_of(path)
    if isinstance(value, (list, tuple)):
        if field is not None and field.message_type is not None:
            raise ValueError(
                f"sets: {path} is a message, not a list of values; give its fields, such as {{'{path}.x': 0.1}}, "
                "or one of several with its index, [0]"
            )
        return f"[{', '.join(_element_of(path, one) for one in value)}]"
    return _scalar_of(path, value, field)


def _element_of(path: str, value: object) -> str:
    # quotes and escapes of JSON are those of the text format
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else _scalar_of(path, value, None)


def _scalar_of(path: str, value: object, field: Any) -> str:
    if isinstance(value, bool):
        names = {"on", "off"}
        if field is not None and field.enum_type is not None and names <= set(field.enum_type.values_by_name):
            return "on" if value else "off"
        return str(value).lower()
    if isinstance(value, (str, int, float, os.PathLike)):
        return str(value)
    raise ValueError(
        f"sets: {path} = {value!r}: must be a number, a text, True, False, a list of them, or a dict of fields; "
        "leave it out for what the session file has"
    )


def _field_of(path: str) -> Any:
    """The descriptor of a field of a session; None: there is no such field."""
    message, field = session_pb2.Session.DESCRIPTOR, None
    for name in path.split("."):
        field = message.fields_by_name.get(name.split("[")[0]) if message is not None else None
        message = field.message_type if field is not None else None
    return field
