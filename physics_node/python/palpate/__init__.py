# SPDX-License-Identifier: Apache-2.0
"""Palpate from Python: physics for its haptic loop, live telemetry, recordings and loopback runs.

SI units throughout; frame W (world) unless a name says otherwise; a force is named by what it
pushes. The wire is described in docs/wire.md, the use of this package in docs/extending.md.
"""

from importlib.metadata import PackageNotFoundError, version as _version

from .contact import Contact
from .errors import SetupError, run
from .estimator import ContactEstimator, Estimate
from .physics import Motion, Physics
from .recording import Recording
from .loopback_run import loopback
from .scene import Surface
from .telemetry import Batch, Telemetry

try:
    __version__ = _version("palpate")
except PackageNotFoundError:  # used from a folder, without being installed
    __version__ = "unknown"

__all__ = [
    "__version__",
    "Batch",
    "Contact",
    "ContactEstimator",
    "Estimate",
    "Motion",
    "Physics",
    "Recording",
    "SetupError",
    "Surface",
    "Telemetry",
    "loopback",
    "run",
]
