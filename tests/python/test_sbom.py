# SPDX-License-Identifier: Apache-2.0
"""deploy/sbom on a small input: a program of Debian and a lock file of three packages."""

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import unittest
from pathlib import Path
from typing import Any

from support import ROOT, TestCase

SBOM = ROOT / "deploy/sbom"


def integrity_of(text: bytes) -> str:
    return "sha512-" + base64.b64encode(hashlib.sha512(text).digest()).decode()


LOCK = {
    "lockfileVersion": 3,
    "packages": {
        "": {"name": "page", "dependencies": {"curves": "1.2.3", "@scope/wire": "4.0.0", "bundler": "5.0.0"}},
        "node_modules/@scope/wire": {
            "version": "4.0.0", "license": "(Apache-2.0 AND BSD-3-Clause)", "integrity": integrity_of(b"wire")
        },
        "node_modules/bundler": {
            "version": "5.0.0", "license": "MIT", "integrity": integrity_of(b"bundler"), "bin": {"bundler": "bin/b"}
        },
        "node_modules/curves": {"version": "1.2.3", "license": "MIT", "integrity": integrity_of(b"curves")},
        "node_modules/types": {"version": "9.0.0", "dev": True, "integrity": integrity_of(b"types")},
        "node_modules/@bundler/arm": {"version": "5.0.0", "optional": True, "integrity": integrity_of(b"arm")},
    },
}


@unittest.skipUnless(shutil.which("dpkg-query"), "no dpkg-query")
class Sbom(TestCase):
    def sbom(self, *arguments: object, status: int = 0) -> subprocess.CompletedProcess[str]:
        done = subprocess.run(
            [str(SBOM), "--version", "1.2.3+abc", *map(str, arguments)],
            capture_output=True, text=True, check=False, env={**os.environ, "SOURCE_DATE_EPOCH": "1700000000"},
        )
        self.assertEqual(done.returncode, status, done.stderr)
        return done

    def lock(self, lock: Any = LOCK) -> Path:
        file = self.folder / "package-lock.json"
        file.write_text(json.dumps(lock))
        return file

    def test_lists_libraries_and_packages_with_their_versions(self) -> None:
        program = shutil.which("ls")
        text = self.sbom("--lock", self.lock(), program).stdout
        document = json.loads(text)
        packages = {package["name"]: package for package in document["packages"]}

        # the C library, as dpkg itself says
        version = subprocess.run(
            ["dpkg-query", "-W", "-f", "${Version}", "libc6"], capture_output=True, text=True, check=True
        ).stdout
        self.assertEqual(packages["libc6"]["versionInfo"], version)
        self.assertRegex(packages["libc6"]["externalRefs"][0]["referenceLocator"], r"^pkg:deb/debian/libc6@\d")
        # of npm: what is bundled and what bundles, nothing of development
        self.assertLessEqual({"curves", "@scope/wire", "bundler"}, set(packages))
        self.assertTrue({"types", "@bundler/arm"}.isdisjoint(packages))
        self.assertEqual(packages["@scope/wire"]["licenseDeclared"], "(Apache-2.0 AND BSD-3-Clause)")
        self.assertEqual(
            packages["@scope/wire"]["externalRefs"][0]["referenceLocator"], "pkg:npm/%40scope/wire@4.0.0"
        )
        self.assertEqual(
            packages["curves"]["checksums"],
            [{"algorithm": "SHA512", "checksumValue": hashlib.sha512(b"curves").hexdigest()}],
        )
        relations = {
            (one["spdxElementId"], one["relationshipType"], one["relatedSpdxElement"])
            for one in document["relationships"]
        }
        root = packages["palpate"]["SPDXID"]
        self.assertIn(("SPDXRef-DOCUMENT", "DESCRIBES", root), relations)
        self.assertIn((root, "DYNAMIC_LINK", packages["libc6"]["SPDXID"]), relations)
        self.assertIn((root, "CONTAINS", packages["curves"]["SPDXID"]), relations)
        self.assertIn((packages["bundler"]["SPDXID"], "BUILD_TOOL_OF", root), relations)
        self.assertEqual(self.sbom("--lock", self.lock(), program).stdout, text)

    # SPDX 2.3, clauses 6 to 8 and 11: what must be there, and in which form
    def test_is_a_document_of_spdx(self) -> None:
        document = json.loads(self.sbom("--lock", self.lock(), shutil.which("ls")).stdout)
        self.assertEqual(document["spdxVersion"], "SPDX-2.3")
        self.assertEqual(document["dataLicense"], "CC0-1.0")
        self.assertEqual(document["SPDXID"], "SPDXRef-DOCUMENT")
        self.assertEqual(document["name"], "palpate-1.2.3+abc")
        self.assertRegex(document["documentNamespace"], r"^urn:uuid:[0-9a-f-]{36}$")
        self.assertEqual(document["creationInfo"]["created"], "2023-11-14T22:13:20Z")
        self.assertRegex(document["creationInfo"]["creators"][0], "^Tool: ")
        identifiers = [package["SPDXID"] for package in document["packages"]] + ["SPDXRef-DOCUMENT"]
        self.assertEqual(len(identifiers), len(set(identifiers)))
        for package in document["packages"]:
            self.assertRegex(package["SPDXID"], r"^SPDXRef-[A-Za-z0-9.-]+$")
            self.assertTrue(package["name"] and package["versionInfo"] and package["downloadLocation"])
            self.assertFalse(package["filesAnalyzed"])
        for relation in document["relationships"]:
            self.assertIn(relation["spdxElementId"], identifiers)
            self.assertIn(relation["relatedSpdxElement"], identifiers)
            self.assertTrue(re.fullmatch("[A-Z_]+", relation["relationshipType"]))

    def test_says_what_is_wrong(self) -> None:
        self.assertIn("build it first", self.sbom(self.folder / "no_program", status=2).stderr)
        self.assertIn("no lock file", self.sbom("--lock", self.lock([]), shutil.which("ls"), status=2).stderr)
        lock = {"packages": {"node_modules/curves": {"version": "1.2.3"}}}
        self.assertIn("node_modules/curves", self.sbom("--lock", self.lock(lock), shutil.which("ls"), status=2).stderr)


if __name__ == "__main__":
    unittest.main()
