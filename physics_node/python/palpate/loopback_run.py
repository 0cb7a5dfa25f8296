"""`palpate loopback` for notebooks and the CI of other projects."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any, Mapping, Optional, Union

from .errors import EXIT_SETUP_ERROR, SetupError


def loopback(
    session: Union[str, Path],
    sets: Optional[Mapping[str, object]] = None,
    *,
    seconds: Optional[float] = None,
    record: Union[str, Path, None] = None,
    program: Union[str, Path, None] = None,
) -> dict[str, Any]:
    """Runs a session on virtual time and returns its figures, as docs/glossary.md defines them.

    Repeatable: the same session gives the same figures.

    :param sets: fields to override, as --set: {"mofc.mode": "paper", "scene.tissue[0].…": 800}
    :param seconds: simulated time, s; None: duration_s of the session
    :param record: also writes the recording there (see Recording)
    :param program: of `palpate`; None: $PALPATE_BIN/palpate, else the one in PATH
    :raises SetupError: the session is refused, or there is no such program
    """
    if program is None:
        folder = os.environ.get("PALPATE_BIN")
        program = f"{folder}/palpate" if folder else shutil.which("palpate")
    if program is None:
        raise SetupError("no program `palpate` in PATH; install Palpate, or set PALPATE_BIN to its folder")
    command = [str(program), "loopback", str(session), "--json", "-"]
    for path, value in (sets or {}).items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        command += ["--set", f"{path}={text}"]
    if seconds is not None:
        command += ["--seconds", repr(float(seconds))]
    if record is not None:
        command += ["--record", str(record)]
    try:
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
    except OSError as error:
        raise SetupError(f"{program}: cannot be started ({error})") from None
    if ended.returncode == EXIT_SETUP_ERROR:
        raise SetupError(ended.stderr.strip())
    if ended.returncode != 0:
        raise RuntimeError(f"palpate loopback ended with status {ended.returncode}: {ended.stderr.strip()}")
    figures: dict[str, Any] = json.loads(ended.stdout)
    return figures
