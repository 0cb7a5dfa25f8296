"""The package as `pip install --no-build-isolation .` installs it, offline, in a venv that sees the
system's packages."""

import os
import subprocess
import sys

from support import TestCase


class Install(TestCase):
    def test_pip_installs_it_into_a_venv_without_a_network(self) -> None:
        venv = self.folder / "venv"
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

        def run(*command: object) -> str:
            ended = subprocess.run(
                list(map(str, command)), capture_output=True, text=True, env=environment, cwd=self.folder
            )
            self.assertEqual(ended.returncode, 0, ended.stdout + ended.stderr)
            return ended.stdout

        run(sys.executable, "-m", "venv", "--system-site-packages", "--without-pip", venv)
        if subprocess.run([venv / "bin/python", "-c", "import pip"], capture_output=True).returncode:
            self.skipTest("no pip (apt-get install python3-pip)")
        run(venv / "bin/python", "-m", "pip", "install", "--no-build-isolation", "--no-index", "--quiet",
            os.environ["PALPATE_PYTHON_SOURCE"])
        where = run(venv / "bin/python", "-c",
                    "import palpate, palpate.v1.session_pb2; print(palpate.__file__, palpate.Physics.__name__)")
        self.assertIn(str(venv), where)
        self.assertIn("Physics", where)
