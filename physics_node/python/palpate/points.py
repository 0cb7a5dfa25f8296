# SPDX-License-Identifier: Apache-2.0
"""Contact models of the tissues whose stiffness the engine does not tell: what physics_node/foreign/
foreign_engine.h does in C++."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Iterator, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from .contact import Contact
from .estimator import ContactEstimator, ContactLaw, Estimate
from .look_ahead import ForceAt, law_of, look_ahead

_Array = NDArray[Any]
_MOST_TISSUES = 8


@dataclass
class _Group:
    """What the contact points of one tissue tell."""

    force: _Array = field(default_factory=lambda: np.zeros(3))
    normals: _Array = field(default_factory=lambda: np.zeros(3))
    penetration: Optional[float] = None
    without_force: int = 0

    def add(self, point: Contact) -> None:
        force = np.zeros(3) if point.force_on_tool is None else np.asarray(point.force_on_tool, float)
        self.without_force += point.force_on_tool is None
        self.force = self.force + force
        if self.penetration is None or point.penetration > self.penetration:
            self.penetration = point.penetration
        # the harder a point presses, the more its normal counts
        weight = 1e-6 + max(0.0, point.penetration) + float(np.linalg.norm(force))
        self.normals = self.normals + weight * np.asarray(point.normal, float)

    @property
    def normal(self) -> Optional[_Array]:
        length = float(np.linalg.norm(self.normals))
        return self.normals / length if length > 1e-9 else None


@dataclass
class Modelled:
    """One tissue, its model, and the force of it at the pose of the motion."""

    tissue: int
    model: Estimate
    force: _Array  # N on the tool


class TissueEstimators:
    """One estimator for each tissue that was ever told without a stiffness."""

    def __init__(self, force_at: Optional[ForceAt] = None) -> None:
        self._force_at = force_at
        self._estimators: dict[int, ContactEstimator] = {}

    def step(
        self, position: _Array, velocity: _Array, contacts: Sequence[Contact], force: Optional[_Array]
    ) -> list[Modelled]:
        """The models at this pose, of what has no stiffness.

        :param force: (3,) N of all tissues on the tool; None: the contacts have theirs
        :raises ValueError: the force of a tissue is not known
        """
        groups = _groups_of(contacts, force)
        return list(self._models(position, velocity, groups, not contacts))

    def _look(
        self, estimator: ContactEstimator, position: _Array, velocity: _Array, force: _Array
    ) -> Optional[ContactLaw]:
        """What force_at says: of the tissue ahead, or of that which is touched."""
        if self._force_at is None:
            return None
        if force.any():
            return law_of(self._force_at, position, velocity, force)
        ahead = look_ahead(self._force_at, position, velocity)
        if ahead is not None and ahead.tissue is not None:
            estimator.foresee(ahead.tissue)
        elif ahead is not None:
            estimator.foresee_none(ahead.as_far_as)
        return None

    def _models(
        self, position: _Array, velocity: _Array, groups: dict[int, _Group], is_force_alone: bool
    ) -> Iterator[Modelled]:
        for tissue in groups:
            if len(self._estimators) < _MOST_TISSUES:
                self._estimators.setdefault(tissue, ContactEstimator())
        is_force_alone = is_force_alone and len(self._estimators) == 1
        for tissue, estimator in self._estimators.items():
            seen = groups.get(tissue, _Group())
            law = self._look(estimator, position, velocity, seen.force) if is_force_alone else None
            model = estimator.step(position, velocity, seen.force, seen.normal, seen.penetration, law)
            if model is not None:
                yield Modelled(tissue, model, seen.force)


def _groups_of(contacts: Sequence[Contact], force: Optional[_Array]) -> dict[int, _Group]:
    groups: dict[int, _Group] = {}
    for point in contacts:
        if point.stiffness is None:
            groups.setdefault(point.tissue, _Group()).add(point)
    has_stiffness = any(one.stiffness is not None for one in contacts)
    if not groups:
        return {} if has_stiffness else {0: _Group(force=np.zeros(3) if force is None else force)}
    if any(group.without_force for group in groups.values()):
        if len(groups) > 1 or has_stiffness or force is None:
            raise ValueError(
                "a contact has neither stiffness nor force_on_tool; give one of them, or force=… where "
                "all contacts are of one tissue"
            )
        next(iter(groups.values())).force = force
    return groups
