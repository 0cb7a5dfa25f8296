# SPDX-License-Identifier: Apache-2.0
"""Geometry from arrays: the files that a scene names, for Scene.parse(text, folder)."""

from __future__ import annotations

from os import PathLike, fspath
from pathlib import Path
from typing import Any, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

File = Union[str, PathLike[str]]


def write_tetrahedra(file: File, nodes_m: ArrayLike, tetrahedra: ArrayLike, regions: Optional[ArrayLike] = None,
                     names: Sequence[str] = ()) -> None:
    """A body for `tetrahedral_mesh { file: "NAME.msh" }`, as Gmsh 2.2.

    :param nodes_m: (nodes, 3), in W
    :param tetrahedra: (elements, 4), indices of nodes
    :param regions: (elements,), from 0: which of `names`, for `part { where { tag: "lesion" } }`
    :raises ValueError: which array is wrong, and how
    """
    nodes, elements = _points("nodes_m", nodes_m), _indices("tetrahedra", tetrahedra, 4, nodes_m)
    of = np.zeros(len(elements), dtype=np.int64) if regions is None else np.asarray(regions)
    if of.shape != (len(elements),) or not np.issubdtype(of.dtype, np.integer):
        raise ValueError(f"regions: {of.dtype} {of.shape}; give one whole number for each of {len(elements)} tetrahedra")
    if len(of) and not (0 <= of.min() and of.max() < max(1, len(names))):
        raise ValueError(f"regions: {of.min()} to {of.max()} for {len(names)} names; they count from 0")
    for name in names:
        if not name or any(c in name for c in '"\n\r'):
            raise ValueError(f"names: {name!r}: give a line of text without quotes")
    with open(_new(file, ".msh"), "w", encoding="utf-8") as out:
        out.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n")
        if names:
            out.write(f"$PhysicalNames\n{len(names)}\n")
            out.writelines(f'3 {i} "{name}"\n' for i, name in enumerate(names, 1))
            out.write("$EndPhysicalNames\n")
        out.write(f"$Nodes\n{len(nodes)}\n")
        out.writelines(f"{i} {x:.17g} {y:.17g} {z:.17g}\n" for i, (x, y, z) in enumerate(nodes, 1))
        out.write(f"$EndNodes\n$Elements\n{len(elements)}\n")
        out.writelines(f"{i} 4 2 {region} {region} {a} {b} {c} {d}\n"
                       for i, ((a, b, c, d), region) in enumerate(zip(elements + 1, of + 1), 1))
        out.write("$EndElements\n")


def write_triangles(file: File, vertices_m: ArrayLike, triangles: ArrayLike) -> None:
    """A surface for `triangle_surface { file: "NAME.stl" }`, as binary STL: single precision.

    :param vertices_m: (vertices, 3), in W
    :param triangles: (triangles, 3), counter-clockwise seen from outside
    :raises ValueError: which array is wrong, and how
    """
    corners = _points("vertices_m", vertices_m)[_indices("triangles", triangles, 3, vertices_m)]
    rows = np.zeros(len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    rows["corners"] = corners
    with open(_new(file, ".stl"), "wb") as out:
        out.write(b"palpate_tissue".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes())


def _points(name: str, values: ArrayLike) -> NDArray[np.float64]:
    points = np.asarray(values, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ValueError(f"{name}: {points.shape}; give (n, 3) finite numbers, in metres")
    return points


def _indices(name: str, values: ArrayLike, width: int, points: ArrayLike) -> NDArray[Any]:
    indices = np.asarray(values)
    if indices.ndim != 2 or indices.shape[1] != width or not np.issubdtype(indices.dtype, np.integer):
        raise ValueError(f"{name}: {indices.dtype} {indices.shape}; give (n, {width}) whole numbers")
    count = len(np.asarray(points))
    if len(indices) and not (0 <= indices.min() and indices.max() < count):
        raise ValueError(f"{name}: {indices.min()} to {indices.max()} for {count} points; they count from 0")
    return indices


def _new(file: File, ending: str) -> Path:
    path = Path(fspath(file))
    if path.suffix != ending:
        raise ValueError(f"{path}: the scene tells what a file is by its ending; give {path.stem}{ending}")
    return path
