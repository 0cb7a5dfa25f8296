# SPDX-License-Identifier: Apache-2.0
"""Soft tissue under tools, without the processes of Palpate: one scene or thousands, each step the same to
the bit on every run.

    scene = palpate_tissue.Scene.load("block_with_tumour.txtpb")
    batch = palpate_tissue.Batch(scene, copies=16)
    batch.position[:, 0] = (0.0, 0.0, 0.004)
    batch.step(1e-3)
    print(batch.force[:, 0], batch.error[:, 0])

SI units, frame W of the scene. docs/tissue.md has more."""

from . import files, rows
from .batch import Batch, Snapshot, Surface
from .library import TissueError, version
from .scene import Scene

__all__ = ["Batch", "Scene", "Snapshot", "Surface", "TissueError", "files", "rows", "version"]
