# SPDX-License-Identifier: Apache-2.0
"""libpalpate_tissue through ctypes: palpate_tissue.h."""

from __future__ import annotations

import ctypes.util
import os
from ctypes import CDLL, POINTER, Structure, c_char_p, c_double, c_float, c_size_t, c_uint32, c_void_p
from pathlib import Path
from typing import Any

import numpy as np

EVERY = c_size_t(-1).value
MOST_CONTACTS = 8

_V3 = ("f8", 3)
TOOL = np.dtype([("position", *_V3), ("velocity", *_V3), ("orientation_wxyz", "f8", 4),
                 ("is_velocity_known", "i4"), ("are_jaws_closed", "i4")])
CONTACT = np.dtype([("point", *_V3), ("normal", *_V3), ("force", *_V3), ("penetration", "f8"), ("error", "f8"),
                    ("tissue", "u4"), ("is_shaft", "i4")])
FORCE = np.dtype([("force", *_V3), ("torque", *_V3), ("energy", "f8"), ("error", "f8"), ("contact_count", "u4"),
                  ("listed_count", "u4"), ("contacts", CONTACT, MOST_CONTACTS)])


class SurfacePointers(Structure):
    _fields_ = [("vertices_m", POINTER(c_float)), ("strain", POINTER(c_float)), ("triangles", POINTER(c_uint32)),
                ("vertex_count", c_size_t), ("triangle_count", c_size_t)]


class TissueError(ValueError):
    """What the library refuses: value, rule and remedy."""


_FUNCTIONS: dict[str, tuple[Any, list[Any]]] = {
    "palpate_tissue_version": (c_char_p, []),
    "palpate_tissue_error": (c_char_p, []),
    "palpate_scene_load": (c_void_p, [c_char_p, POINTER(c_char_p), c_size_t]),
    "palpate_scene_parse": (c_void_p, [c_char_p, c_char_p, POINTER(c_char_p), c_size_t]),
    "palpate_scene_destroy": (None, [c_void_p]),
    "palpate_scene_tissue_count": (c_size_t, [c_void_p]),
    "palpate_scene_tissue_name": (c_char_p, [c_void_p, c_size_t]),
    "palpate_scene_tip_radius_m": (c_double, [c_void_p]),
    "palpate_batch_create": (c_void_p, [c_void_p, c_size_t, c_size_t, c_size_t]),
    "palpate_batch_destroy": (None, [c_void_p]),
    "palpate_batch_tools": (c_void_p, [c_void_p]),
    "palpate_batch_forces": (c_void_p, [c_void_p]),
    "palpate_batch_step": (ctypes.c_int, [c_void_p, c_double, c_uint32]),
    "palpate_batch_time_s": (c_double, [c_void_p, c_size_t]),
    "palpate_batch_reset": (ctypes.c_int, [c_void_p, c_size_t, c_double]),
    "palpate_batch_snapshot": (c_void_p, [c_void_p, c_size_t]),
    "palpate_batch_restore": (ctypes.c_int, [c_void_p, c_size_t, c_void_p]),
    "palpate_snapshot_destroy": (None, [c_void_p]),
    "palpate_batch_surface": (ctypes.c_int, [c_void_p, c_size_t, c_size_t, POINTER(SurfacePointers)]),
}


def _open() -> CDLL:
    own = Path(__file__).with_name("libpalpate_tissue.so")
    place = os.environ.get("PALPATE_TISSUE_LIBRARY")
    if place is None:
        place = str(own) if own.exists() else ctypes.util.find_library("palpate_tissue")
    if place is None:
        raise ImportError("no libpalpate_tissue in the package nor in the linker's folders; build it (target "
                          "palpate_tissue_c), and install this package again or set PALPATE_TISSUE_LIBRARY")
    library = CDLL(place)
    for name, (result, arguments) in _FUNCTIONS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


lib = _open()


def error() -> TissueError:
    return TissueError(lib.palpate_tissue_error().decode())


def check(status: int) -> None:
    if status != 0:
        raise error()


def version() -> str:
    """That of the library."""
    text: str = lib.palpate_tissue_version().decode()
    return text


class Handle:
    """Owns what a function of the library has made."""

    def __init__(self, value: Any, destroy: Any) -> None:
        self._destroy = destroy
        self.value = value
        if value is None:
            raise error()

    def __del__(self) -> None:
        if self.value is not None:
            self._destroy(self.value)


def view(address: int, dtype: np.dtype[Any], shape: tuple[int, ...], owner: Handle) -> np.ndarray[Any, Any]:
    """The library's memory as an array, which keeps its owner."""
    count = int(np.prod(shape))
    if count == 0:
        return np.empty(shape, dtype)
    memory = (ctypes.c_char * (count * dtype.itemsize)).from_address(address)
    memory.owner = owner  # type: ignore[attr-defined]
    return np.frombuffer(memory, dtype).reshape(shape)
