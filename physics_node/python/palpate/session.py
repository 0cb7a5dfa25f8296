# SPDX-License-Identifier: Apache-2.0
"""Which endpoints and keys a program uses: from `palpate launch`, or from a session file."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Optional, Union

from google.protobuf import text_format

from .errors import SetupError
from .v1 import session_pb2

ENVIRONMENT = "PALPATE_PHYSICS"
"""Set by `palpate launch` for the program of `physics.command`."""

_ONE_SIDE = ("tool_motion", "interaction", "device_telemetry", "mofc_telemetry")


@dataclass(frozen=True)
class SideLinks:
    """Endpoints of one device; "" where they are not known."""

    name: str  # "" in a session with one device
    tool_motion: str
    interaction: str
    device_telemetry: str = ""
    mofc_telemetry: str = ""


@dataclass(frozen=True)
class SessionLinks:
    """What of a session the links need."""

    source: str  # for messages
    rate_hz: float
    sides: tuple[SideLinks, ...]
    physics_telemetry: str
    key_folder: Optional[Path]
    insecure: bool
    scene: Optional[dict[str, Any]] = None  # fields of SceneState; only from `palpate launch`


def session_links(session: Union[str, Path, None], insecure: bool) -> SessionLinks:
    """Of a session file; without one, what `palpate launch` gave. Raises SetupError."""
    return _from_launch(insecure) if session is None else _from_file(Path(session), insecure)


def _from_launch(insecure: bool) -> SessionLinks:
    given = os.environ.get(ENVIRONMENT)
    if given is None:
        raise SetupError(
            "no session: start the program by `palpate launch` with physics { command: … }, or give "
            "it a session file"
        )
    try:
        values = json.loads(given)
        folder = values.get("key_folder")
        return SessionLinks(
            source=str(values["session"]),
            rate_hz=float(values["rate_hz"]),
            sides=tuple(
                SideLinks(str(side["name"]), str(side["tool_motion"]), str(side["interaction"]))
                for side in values["sides"]
            ),
            physics_telemetry=str(values["physics_telemetry"]),
            key_folder=None if folder is None else Path(folder),
            insecure=insecure or bool(values["insecure"]),
            scene=dict(values["scene"]),
        )
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise SetupError(
            f"{ENVIRONMENT} is not what `palpate launch` writes ({error!r}); unset it, or use the "
            "package of the same version"
        ) from None


def _from_file(file: Path, insecure: bool) -> SessionLinks:
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise SetupError(f"session {file}: cannot be read ({error}); give a session file") from None
    session = session_pb2.Session()
    try:
        text_format.Parse(text, session)
    except text_format.ParseError as error:
        raise SetupError(f"{file}:{error}; see docs/session.md") from None
    if not session.name:
        raise SetupError(f"{file}: name: required; give letters, digits, '_' and '-'")
    folder = run_folder() / session.name

    def endpoint(side: Optional[session_pb2.Side], link: str) -> str:
        given = getattr(side.links, link) if side is not None else ""
        name = link if side is None else f"{side.name}.{link}"
        return given or getattr(session.links, link) or f"ipc://{folder / name}.ipc"

    sides: list[Optional[session_pb2.Side]] = list(session.side) or [None]
    key_folder = session.security.key_folder
    return SessionLinks(
        source=str(file),
        rate_hz=session.physics.rate_hz if session.physics.HasField("rate_hz") else 1000.0,
        sides=tuple(
            SideLinks(
                "" if side is None else side.name, *(endpoint(side, link) for link in _ONE_SIDE)
            )
            for side in sides
        ),
        physics_telemetry=endpoint(None, "physics_telemetry"),
        key_folder=file.parent / key_folder if key_folder else None,
        insecure=insecure,
    )


def run_folder() -> Path:
    """Where the ipc files of all sessions are, each session in a folder of its name."""
    if folder := os.environ.get("PALPATE_RUN_DIR"):
        return Path(folder)
    if folder := os.environ.get("XDG_RUNTIME_DIR"):
        return Path(folder) / "palpate"
    return Path(f"/tmp/palpate-{os.getuid()}")
