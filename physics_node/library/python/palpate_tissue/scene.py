# SPDX-License-Identifier: Apache-2.0
"""A scene, read once and shared by all batches."""

from __future__ import annotations

from ctypes import c_char_p
from os import PathLike, fspath
from typing import Any, Mapping, Optional, Union

from .library import Handle, lib


class Scene:
    """Tissues and the shape of the tools, from the file of a session or its text."""

    def __init__(self, handle: Handle) -> None:
        self._handle = handle

    @classmethod
    def load(cls, file: Union[str, PathLike[str]], sets: Optional[Mapping[str, object]] = None) -> Scene:
        """The scene of a session file.

        :param sets: fields to override, as --set: {"scene.tissue[0].elastic.young_pa": 20e3}
        :raises TissueError: every problem with file, line and field
        """
        return cls(Handle(lib.palpate_scene_load(fspath(file).encode(), *_sets(sets)), lib.palpate_scene_destroy))

    @classmethod
    def parse(cls, text: str, folder: Union[str, PathLike[str], None] = None,
              sets: Optional[Mapping[str, object]] = None) -> Scene:
        """The same from memory; `scene { … }` of a session is enough.

        :param folder: base of the relative paths in the text; None: it may name no file
        """
        where = None if folder is None else fspath(folder).encode()
        return cls(Handle(lib.palpate_scene_parse(text.encode(), where, *_sets(sets)), lib.palpate_scene_destroy))

    @property
    def value(self) -> Any:
        return self._handle.value

    @property
    def tissues(self) -> list[str]:
        """Their names."""
        count = lib.palpate_scene_tissue_count(self.value)
        return [lib.palpate_scene_tissue_name(self.value, i).decode() for i in range(count)]

    @property
    def tip_radius(self) -> float:
        """Of the tip of the tools, m."""
        radius: float = lib.palpate_scene_tip_radius_m(self.value)
        return radius

    def __repr__(self) -> str:
        return f"<Scene of {', '.join(self.tissues)}>"


def _sets(sets: Optional[Mapping[str, object]]) -> tuple[Any, int]:
    texts = [f"{path}={str(value).lower() if isinstance(value, bool) else value}".encode()
             for path, value in (sets or {}).items()]
    return (c_char_p * len(texts))(*texts), len(texts)
