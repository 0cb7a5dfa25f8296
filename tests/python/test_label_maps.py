# SPDX-License-Identifier: Apache-2.0
"""palpate import beside nibabel and teem: what a label map holds, and where it puts the organ."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import unittest
from pathlib import Path
from typing import Any

import numpy as np

from support import BIN, PATIENT, TestCase, recorded, until

try:
    import nibabel
except ImportError:
    nibabel = None

# The program of those who defined NRRD.
UNU = shutil.which("teem-unu")

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


def apply_affine(affine: Any, places: Any) -> Any:
    return np.asarray(places) @ affine[:3, :3].T + affine[:3, 3]


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


HORN = [33.0, 28.0, 6.0]  # its tip


def asymmetric_body() -> Any:
    """Label 1: an ellipsoid with a horn towards +i, +j, −k."""
    i, j, k = np.meshgrid(*(np.arange(n) for n in (44, 36, 30)), indexing="ij")
    body = ((i - 18) / 13.0) ** 2 + ((j - 16) / 11.0) ** 2 + ((k - 15) / 9.0) ** 2 < 1
    horn = (i - 29) ** 2 + (j - 24) ** 2 + (k - 9) ** 2 < 36
    return (body | horn).astype(np.uint8)


class Imported(TestCase):
    """A label map as the importer has it."""

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

    def expect_at(self, voxels_mm: Any, horn_mm: Any, file: Path) -> None:
        """The surface is around these voxels, and near the horn, by which a mirrored body would be off."""
        surface_mm = self.surface_in_scan_mm(file)
        # half a voxel beyond the outermost centres, and the mesh is smoothed
        for low in (voxels_mm.min(0) - surface_mm.min(0), surface_mm.max(0) - voxels_mm.max(0)):
            self.assertLess(np.abs(low).max(), 3.0)
        self.assertLess(np.linalg.norm(surface_mm - horn_mm, axis=1).min(), 3.0)


@unittest.skipIf(nibabel is None, "no nibabel (apt-get install python3-nibabel)")
class LabelMaps(Imported):
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
                self.expect_at(
                    apply_affine(read.affine, np.argwhere(body)), apply_affine(read.affine, HORN), file)

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


@unittest.skipIf(UNU is None, "no teem-unu (apt-get install teem-apps)")
class Nrrd(Imported):
    def unu(self, *arguments: object, data: bytes = b"") -> bytes:
        """The output of one of teem's commands on this input."""
        return subprocess.run(
            [str(UNU), *map(str, arguments)], input=data, capture_output=True, check=True).stdout

    def plain(self, nrrd: bytes) -> tuple[str, bytes]:
        """Header and voxels, unsigned short, as teem reads them."""
        plain = self.unu("save", "-f", "nrrd", "-e", "raw", "-en", "little", data=self.unu(
            "convert", "-t", "ushort", data=nrrd))
        header, _, voxels = plain.partition(b"\n\n")
        return header.decode(), voxels

    def voxels(self, nrrd: bytes) -> Any:
        header, voxels = self.plain(nrrd)
        sizes = re.findall(r"^sizes: (.*)$", header, re.M)[0].split()
        return np.frombuffer(voxels, "<u2").reshape([int(n) for n in sizes], order="F")

    def affine(self, nrrd: bytes) -> Any:
        """From indices to right, anterior, superior, by teem's header."""
        head = self.plain(nrrd)[0]
        sign = {"left-posterior-superior": (-1, -1, 1), "right-anterior-superior": (1, 1, 1),
                "left-anterior-superior": (-1, 1, 1)}[re.findall(r"^space: (.*)$", head, re.M)[0]]
        vectors = re.findall(r"\(([^)]*)\)", head[head.index("space directions"):])
        affine = np.eye(4)
        for column, vector in enumerate(vectors[:4]):
            affine[:3, column] = np.multiply(sign, [float(number) for number in vector.split(",")])
        return affine

    def made(self, body: Any, affine: Any, space: str, *more: object) -> bytes:
        """A file that teem writes of this body, whose axes are in right, anterior, superior."""
        sign = {"LPS": (-1, -1, 1), "RAS": (1, 1, 1), "LAS": (-1, 1, 1)}[space]
        vectors = [",".join(f"{number:.12g}" for number in np.multiply(sign, affine[:3, column]))
                   for column in range(4)]
        directions = " ".join(f"({vector})" for vector in vectors[:3])
        if body.ndim == 4:
            directions = "none " + directions
        return self.unu(
            "make", "-i", "-", "-t", "uchar", "-s", *body.shape, "-spc", space, "-orig", f"({vectors[3]})",
            "-dirs", directions, "-e", "raw", *more, data=body.flatten(order="F").tobytes())

    def check(self, nrrd: bytes, name: str) -> None:
        """The importer has the voxels of teem, where teem has them."""
        file = self.folder / f"{name}.nrrd"
        file.write_bytes(nrrd)
        voxels = self.voxels(nrrd)
        values, counts = np.unique(voxels[voxels > 0], return_counts=True)
        self.assertEqual(listed(file), dict(zip(values.tolist(), counts.tolist())))
        self.expect_at(apply_affine(self.affine(nrrd), np.argwhere(voxels)), self.horn_mm, file)

    def test_the_organ_is_where_teem_has_its_voxels(self) -> None:
        affine = turned(24.0, (1.4, 1.7, 2.3), is_mirrored=False)
        body = asymmetric_body()
        self.horn_mm = apply_affine(affine, HORN)
        for space in ("LPS", "RAS", "LAS"):
            with self.subTest(space):
                self.check(self.made(body, affine, space, "-spu", "mm", "mm", "mm"), space)

        # the same place in the patient, whatever the axes are
        made = self.made(body, affine, "LPS")
        for name, command in (
            ("flipped", ["flip", "-a", "1"]),
            ("permuted", ["permute", "-p", "2", "0", "1"]),
            ("cropped", ["crop", "-min", "2", "1", "0", "-max", "M", "M-1", "M"]),
            ("padded", ["pad", "-min", "-3", "0", "-1", "-max", "M+2", "M", "M", "-b", "pad", "-v", "0"]),
        ):
            with self.subTest(name):
                self.check(self.unu(*command, data=made), name)

    def test_every_encoding_and_type_has_the_voxels_that_teem_reads(self) -> None:
        affine = turned(24.0, (1.4, 1.7, 2.3), is_mirrored=True)
        body = asymmetric_body()
        body[body > 0] += (np.argwhere(body)[:, 2] > 12).astype(np.uint8)
        made = self.made(body, affine, "LPS")
        counts = {int(value): int((body == value).sum()) for value in (1, 2)}
        for kind in ("int8", "short", "ushort", "int", "uint", "longlong", "ulonglong", "float", "double"):
            for encoding, endian in (("raw", "big"), ("raw", "little"), ("gzip", "big"), ("ascii", "little")):
                with self.subTest(f"{kind} {encoding} {endian}"):
                    file = self.folder / "typed.nrrd"
                    file.write_bytes(self.unu("save", "-f", "nrrd", "-e", encoding, "-en", endian, data=self.unu(
                        "convert", "-t", kind, data=made)))
                    self.assertEqual(listed(file), counts)

    def test_layers_are_the_axis_that_teem_gives_no_direction(self) -> None:
        affine = turned(24.0, (1.4, 1.7, 2.3), is_mirrored=False)
        body = asymmetric_body()
        i, j, k = np.meshgrid(*(np.arange(n) for n in body.shape), indexing="ij")
        lesion = ((i - 16) ** 2 + (j - 18) ** 2 + (k - 14) ** 2 < 16).astype(np.uint8)
        file = self.folder / "layers.seg.nrrd"
        file.write_bytes(self.made(
            np.stack([body, lesion]), affine, "LPS", "-kv", "Segment0_ID:=a", "Segment0_LabelValue:=1",
            "Segment0_Layer:=0", "Segment0_Name:=liver", "Segment1_ID:=b", "Segment1_LabelValue:=1",
            "Segment1_Layer:=1", "Segment1_Name:=tumor"))
        rows = re.findall(r"^ +1 +(\d+) +[\d.]+  (\w+)", palpate("import", file), re.M)
        self.assertEqual(rows, [(str(int(body.sum() - lesion.sum())), "liver"), (str(int(lesion.sum())), "tumor")])

    def test_what_make_organ_writes_is_what_teem_reads(self) -> None:
        file = self.folder / "organ.seg.nrrd"
        palpate("make-organ", "--labels", file, "--voxel-mm", 1.5, 2, 3, "--oblique-degrees", 25)
        nrrd = file.read_bytes()
        lesion = np.argwhere(self.voxels(nrrd) == 2)
        self.assertEqual(listed(file)[2], len(lesion))
        # 20 mm to the patient's left, 12 mm to the front, 5 mm to the head
        np.testing.assert_allclose(apply_affine(self.affine(nrrd), lesion).mean(0), [-20, 12, 5], atol=0.5)


class Launched(TestCase):
    def test_an_imported_organ_is_felt_and_gives_way(self) -> None:
        labels = self.folder / "organ.seg.nrrd"
        organ = self.folder / "organ"
        palpate("make-organ", "--labels", labels, "--voxel-mm", 3, 3, 3)
        palpate("import", labels, "-o", organ, "--tetrahedra", 1000, "--quiet")
        lockstep = json.loads(palpate(
            "loopback", organ / "session.txtpb", "--seconds", 1, "--no-ideal", "--json", "-"
        ))
        self.assertGreater(lockstep["max_force_n"], 0.2)
        record = self.folder / "run.mcap"
        with self.running(
            "palpate", "launch", organ / "session.txtpb", *PATIENT, "--no-realtime", "--no-viewer",
            "--record", record
        ) as launch:
            self.assertTrue(until(lambda: self.largest_way_m(record) > 0.002), launch.err)
            # how much is a matter of the machine: it renders what its physics has solved in time
            self.assertTrue(until(lambda: self.largest_force_newton(record) > 0), launch.err)
            self.assertEqual(launch.stop(), 0, launch.err)

    @staticmethod
    def largest_force_newton(record: Path) -> float:
        batches = [np.array(batch.force_on_hand_newton) for batch in recorded(record, "device")]
        return max((np.abs(newton).max(initial=0.0) for newton in batches), default=0.0)

    @staticmethod
    def largest_way_m(record: Path) -> float:
        """Of a corner of the drawn surface from where it is at rest."""
        scenes = recorded(record, "scene_state")
        if not scenes:
            return 0.0
        rest_m = np.frombuffer(scenes[0].tissues[0].vertices_m, "<f4").reshape(-1, 3)
        largest_m = 0.0
        for frame in recorded(record, "mesh"):
            moved_m = np.frombuffer(frame.vertices_m, "<f4").reshape(-1, 3)
            part = slice(frame.first_vertex, frame.first_vertex + len(moved_m))
            largest_m = max(largest_m, np.linalg.norm(moved_m - rest_m[part], axis=1).max(initial=0.0))
        return largest_m


if __name__ == "__main__":
    unittest.main()
