# SPDX-License-Identifier: Apache-2.0
"""Generates the protobuf modules from proto/ of the source tree with the protoc of this machine, so
that they fit the installed runtime."""

import shutil
import subprocess
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py

PROTO = Path(__file__).resolve().parents[2] / "proto"


class BuildWithProtocol(build_py):
    def run(self) -> None:
        super().run()
        protos = sorted(str(file.relative_to(PROTO)) for file in PROTO.glob("palpate/v1/*.proto"))
        if not protos:
            raise SystemExit(f"{PROTO} has no protos: build from a checkout of Palpate")
        if shutil.which("protoc") is None:
            raise SystemExit("no protoc; apt-get install protobuf-compiler")
        subprocess.run(
            ["protoc", f"-I{PROTO}", f"--python_out={Path(self.build_lib).resolve()}", *protos],
            check=True,
        )


setup(cmdclass={"build_py": BuildWithProtocol})
