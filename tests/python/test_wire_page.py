# SPDX-License-Identifier: Apache-2.0
"""docs/wire.md says what the protos say, and its frames are those of the package."""

import re
import subprocess
import sys
import unittest

from palpate.wire import Kind, check_motion, decode, encode
from support import ROOT


class WirePage(unittest.TestCase):
    def test_is_generated_from_the_protos_of_this_tree(self) -> None:
        checked = subprocess.run(
            [sys.executable, ROOT / "proto/wire_reference.py", "--check"], capture_output=True, text=True
        )
        self.assertEqual(checked.returncode, 0, checked.stderr)

    def test_its_frames_are_read_and_written_alike(self) -> None:
        page = (ROOT / "docs/wire.md").read_text(encoding="utf-8")
        for kind, name in ((Kind.TOOL_MOTION, "ToolMotion"), (Kind.INTERACTION, "Interaction")):
            block = re.search(rf"`{name}`, \d+ bytes:\n\n```\n(.*?)```", page, re.S)
            assert block is not None
            frame = bytes.fromhex("".join(line.split(";")[0] for line in block[1].splitlines()))
            message = decode(frame, (kind,))[1]
            self.assertEqual(encode(kind, message), frame)
            if kind is Kind.TOOL_MOTION:
                check_motion(message)
