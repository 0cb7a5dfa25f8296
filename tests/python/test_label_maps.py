# SPDX-License-Identifier: Apache-2.0
"""palpate import beside nibabel: what a label map holds, and where it puts the organ."""

from __future__ import annotations

import re
import subprocess
import unittest
from pathlib import Path
from typing import Any

import numpy as np

from support import BIN, TestCase

try:
    import nibabel
    from nibabel.affines import apply_affine
except ImportError:
    nibabel = None

ATLAS = Path("/usr/share/mricron/templates/JHU-WhiteMatter-labels-2mm.nii.gz")


def palpate(*arguments: object) -> str:
    done = subprocess.run([str(BIN / "palpate"), *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(done.stderr)
    return done.stdout


def listed(file: Path) -> dict[int, int]:
    """Voxels of each value, as `palpate import` lists them."""
    rows = re.findall(r"^ +(\d+) +(\d+) +[\d.]+  ", palpate("import", file), re.M)
    return {int(value): int(count) for value, count in rows}


def counted(image: Any) -> dict[int, int]:
    values, counts = np.unique(np.asarray(image.dataobj), return_counts=True)
    return {int(value): int(count) for value, count in zip(values, counts) if value != 0}


def turned(degrees: float, spacing_mm: tuple[float, float, float], is_mirrored: bool) -> Any:
    """An oblique grid of RAS."""
    angle = np.radians(degrees)
    about_z = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    affine = np.eye(4)
    affine[:3, :3] = about_z @ about_x @ np.diag(spacing_mm)
    if is_mirrored:
        affine[:3, 0] *= -1
    affine[:3, 3] = [41.0, -23.0, 150.0]
    return affine


def asymmetric_body() -> Any:
    """Label 1: an ellipsoid with a horn towards +i, +j, −k."""
    i, j, k = np.meshgrid(*(np.arange(n) for n in (44, 36, 30)), indexing="ij")
    body = ((i - 18) / 13.0) ** 2 + ((j - 16) / 11.0) ** 2 + ((k - 15) / 9.0) ** 2 < 1
    horn = (i - 29) ** 2 + (j - 24) ** 2 + (k - 9) ** 2 < 36
    return (body | horn).astype(np.uint8)


@unittest.skipIf(nibabel is None, "no nibabel (apt-get install python3-nibabel)")
class LabelMaps(TestCase):
    def surface_in_scan_mm(self, file: Path) -> Any:
        """Corners of the imported surface, led back to the scan by the matrix of the report."""
        folder = self.folder / f"{file.name}.organ"
        palpate("import", file, "-o", folder, "--tetrahedra", 2500, "--quiet")
        stl = (folder / "surface.stl").read_bytes()
        triangles = np.frombuffer(stl, dtype=np.dtype([("numbers", "<f4", 12), ("more", "<u2")]), offset=84)
        corners_m = triangles["numbers"][:, 3:].reshape(-1, 3).astype(float)
        report = (folder / "report.txt").read_text()
        rows = report.split("to W, in mm:\n")[1].split("\n")[:4]
        world_of_scan = np.array([[float(number) for number in row.split()] for row in rows])
        return apply_affine(np.linalg.inv(world_of_scan), 1e3 * corners_m)

    def test_the_organ_is_where_nibabel_has_its_voxels(self) -> None:
        body = asymmetric_body()
        for name, is_sform, is_mirrored, suffix in (
            ("sform", True, False, ".nii.gz"), ("mirrored sform", True, True, ".nii"),
            ("qform", False, False, ".nii"), ("mirrored qform", False, True, ".nii.gz"),
        ):
            with self.subTest(name):
                affine = turned(24.0, (1.4, 1.7, 2.3), is_mirrored)
                image = nibabel.Nifti1Image(body, affine)
                image.set_sform(affine if is_sform else None, 1 if is_sform else 0)
                image.set_qform(None if is_sform else affine, 0 if is_sform else 1)
                file = self.folder / (name.replace(" ", "_") + suffix)
                nibabel.save(image, file)
                read = nibabel.load(file)
                self.assertEqual(listed(file), counted(read))
                voxels_mm = apply_affine(read.affine, np.argwhere(body))
                surface_mm = self.surface_in_scan_mm(file)
                # half a voxel beyond the outermost centres, and the mesh is smoothed
                for low in (voxels_mm.min(0) - surface_mm.min(0), surface_mm.max(0) - voxels_mm.max(0)):
                    self.assertLess(np.abs(low).max(), 3.0)
                # a mirrored body would be off by the horn
                horn_mm = apply_affine(read.affine, [33.0, 28.0, 6.0])
                nearest_mm = np.linalg.norm(surface_mm - horn_mm, axis=1).min()
                self.assertLess(nearest_mm, 3.0)

    def test_what_make_organ_writes_is_what_nibabel_reads(self) -> None:
        file = self.folder / "organ.nii"
        palpate("make-organ", "--labels", file, "--voxel-mm", 1.5, 2, 3, "--oblique-degrees", 25)
        image = nibabel.load(file)
        self.assertEqual(listed(file), counted(image))
        np.testing.assert_allclose(nibabel.affines.voxel_sizes(image.affine), [1.5, 2, 3], rtol=1e-5)
        lesion = np.argwhere(np.asarray(image.dataobj) == 2)
        # 20 mm to the patient's left, 12 mm to the front, 5 mm to the head
        np.testing.assert_allclose(apply_affine(image.affine, lesion).mean(0), [-20, 12, 5], atol=0.5)

    @unittest.skipUnless(ATLAS.exists(), "no mricron-data")
    def test_a_public_atlas_has_the_voxels_that_nibabel_counts(self) -> None:
        self.assertEqual(listed(ATLAS), counted(nibabel.load(ATLAS)))


if __name__ == "__main__":
    unittest.main()
