# SPDX-License-Identifier: Apache-2.0
"""What an engine that can tell its force anywhere says of tissue that the tool has not touched yet, and
of the law where it touches: physics_node/foreign/look_ahead.h in numpy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Callable, Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .estimator import ContactLaw, Foreseen

_Array = NDArray[Any]
ForceAt = Callable[[_Array], ArrayLike]

_AHEAD_S, _FARTHEST_M = 0.15, 30e-3
_STILL = 1e-3
_SURFACE_M = 0.05e-3
_SHALLOW_M, _DEEP_M, _SLOPE_M = 0.5e-3, 2e-3, 0.5e-3
_FELT_NEWTON = 1e-3
_LEAST_ERROR = 0.05
_MEASURABLE = 5e-3


@dataclass
class Ahead:
    """Tissue, or none between here and a place."""

    tissue: Optional[Foreseen]
    as_far_as: _Array  # m


def look_ahead(force_at: ForceAt, position: _Array, velocity: _Array) -> Optional[Ahead]:
    """The tissue that the tool reaches within 0.15 s, at most 30 mm away, if it goes on as it does. None:
    not to be told, as of a tool at rest."""
    speed = float(np.linalg.norm(velocity))
    if speed < _STILL:
        return None
    along = velocity / speed
    reach = min(speed * _AHEAD_S, _FARTHEST_M)

    def is_felt(distance: float) -> bool:
        return float(np.linalg.norm(_force(force_at, position + distance * along))) > _FELT_NEWTON

    as_far_as = position + reach * along
    if not is_felt(reach):
        return Ahead(None, as_far_as)
    free, felt = 0.0, reach
    while felt - free > _SURFACE_M:
        middle = 0.5 * (free + felt)
        free, felt = (free, middle) if is_felt(middle) else (middle, felt)
    surface = position + 0.5 * (free + felt) * along
    outwards = _force(force_at, surface + _SHALLOW_M * along)
    newton = float(np.linalg.norm(outwards))
    if newton <= _FELT_NEWTON:
        return None
    normal = outwards / newton
    shallow_m = -float(normal @ along) * _SHALLOW_M
    if shallow_m < 0.1 * _SHALLOW_M:  # along the surface: no depth to speak of
        return None
    deep = float(normal @ _force(force_at, surface - _DEEP_M * normal)) / _DEEP_M
    if deep <= 0.0:  # through it
        return None
    error = max(_LEAST_ERROR * deep, abs(deep - newton / shallow_m))
    return Ahead(Foreseen(surface, normal, deep, error, deep * _DEEP_M), as_far_as)


def law_of(force_at: ForceAt, position: _Array, velocity: _Array, force: _Array) -> ContactLaw:
    """Stiffness over 0.5 mm, and the damping that explains the rest of the force."""
    normal = force / np.linalg.norm(force)
    here = float(normal @ _force(force_at, position))
    deeper = float(normal @ _force(force_at, position - _SLOPE_M * normal))
    approach = -float(normal @ velocity)
    rest = float(normal @ force) - here
    return ContactLaw((deeper - here) / _SLOPE_M, rest / approach if abs(approach) > _MEASURABLE else 0.0)


def _force(force_at: ForceAt, position: _Array) -> _Array:
    force = np.asarray(force_at(position), float)
    if force.shape != (3,) or not np.all(np.abs(force) <= 1e4):
        raise ValueError(f"force_at({position}) = {force}: must be 3 numbers, each within ±10000; give N")
    return force
