# SPDX-License-Identifier: Apache-2.0
"""Errors that the user can mend, and how a program ends with them."""

from __future__ import annotations

import sys
from typing import Callable

EXIT_SETUP_ERROR = 2
"""Exit status of a wrong set-up: `palpate launch` then ends instead of restarting the program."""


class SetupError(ValueError):
    """A wrong set-up: says what is wrong, by which rule, and what to do."""


def run(main: Callable[[], None]) -> None:
    """Runs a program as the nodes of Palpate run: a SetupError is one line on stderr and status 2."""
    try:
        main()
    except SetupError as error:
        print(f"{sys.argv[0]}: {error}", file=sys.stderr, flush=True)
        sys.exit(EXIT_SETUP_ERROR)
