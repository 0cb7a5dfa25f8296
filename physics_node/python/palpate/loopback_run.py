# SPDX-License-Identifier: Apache-2.0
"""`palpate loopback` for notebooks and the CI of other projects."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any, Mapping, Optional, Union

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
        False also for on and off: {"device.monitor": False}
    :param seconds: simulated time, s; None: duration_s of the session
    :param timeout_s: longest wall-clock time of the run, s; None: without end
    :param record: also writes the recording there (see Recording)
    :param program: of `palpate`; None: $PALPATE_BIN/palpate, else the one in PATH
    :raises SetupError: the session is refused, or there is no such program
    :raises TimeoutError: the run took longer than timeout_s
    """
    if program is None:
        folder = os.environ.get("PALPATE_BIN")
        program = f"{folder}/palpate" if folder else shutil.which("palpate")
    if program is None:
        raise SetupError("no program `palpate` in PATH; install Palpate, or set PALPATE_BIN to its folder")
    command = [str(program), "loopback", str(session), "--json", "-"]
    for path, value in (sets or {}).items():
        command += ["--set", f"{path}={_text_of(path, value)}"]
    if seconds is not None:
        command += ["--seconds", repr(float(seconds))]
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


def _text_of(path: str, value: object) -> str:
    if not isinstance(value, bool):
        return str(value)
    message, field = session_pb2.Session.DESCRIPTOR, None
    for name in path.split("."):
        field = message.fields_by_name.get(name.split("[")[0]) if message is not None else None
        message = field.message_type if field is not None else None
    names = {"on", "off"}
    if field is not None and field.enum_type is not None and names <= set(field.enum_type.values_by_name):
        return "on" if value else "off"
    return str(value).lower()
