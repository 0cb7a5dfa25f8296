# SPDX-License-Identifier: Apache-2.0
"""Takes libpalpate_tissue into the package: $PALPATE_TISSUE_LIBRARY, or that of build/release. Without one
the package looks for the library where it runs."""

import os
import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py
from setuptools.dist import Distribution

BUILT = Path(__file__).resolve().parents[3] / "build/release/physics_node/library/libpalpate_tissue.so"


class BuildWithLibrary(build_py):
    def run(self) -> None:
        super().run()
        library = Path(os.environ.get("PALPATE_TISSUE_LIBRARY", BUILT))
        if library.exists():
            shutil.copyfile(library, Path(self.build_lib) / "palpate_tissue/libpalpate_tissue.so")
        elif "PALPATE_TISSUE_LIBRARY" in os.environ:
            raise SystemExit(f"PALPATE_TISSUE_LIBRARY={library}: there is no such file")


class ForThisProcessor(Distribution):
    def has_ext_modules(self) -> bool:
        return True


setup(cmdclass={"build_py": BuildWithLibrary}, distclass=ForThisProcessor)
