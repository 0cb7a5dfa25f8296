# SPDX-License-Identifier: Apache-2.0
"""The local contact model of one tissue. Equations: common/contact/contact_model.h."""

from __future__ import annotations

from dataclasses import dataclass, fields
from numbers import Integral, Real
from typing import Any, Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .v1 import interaction_pb2


@dataclass
class Contact:
    """A tissue that the tool touches or is close to, at the pose of the motion that it answers.

    Linear along the normal: force = (stiffness · penetration − damping · speed into the tissue) ·
    normal, at least 0. mofc_node evaluates it between two messages, at the rate of the device, as
    the tool moves on by up to `trust_radius`. Report a tissue before it is touched too, with a
    negative penetration: then the contact begins where it should.

    Without a stiffness it is a contact point of an engine: give its `force_on_tool`, or the force of
    all points of one tissue to `reply(force=…)`. The model is then estimated, one for all points of a
    `tissue`; of a point only normal, penetration and force count.

    :raises ValueError: a value is not finite or out of range, here or when it is sent
    """

    normal: ArrayLike  # unit, out of the tissue, W
    penetration: float  # m; > 0: touching, else the negative distance; ±1000
    stiffness: Optional[float] = None  # N/m; 0 … 1e6; None: estimated
    damping: float = 0.0  # N·s/m, along the normal; 0 … 1e4
    curvature: Optional[ArrayLike] = None  # 1/m, Hessian of the distance, 3×3, W; None: flat
    surface_velocity: ArrayLike = (0.0, 0.0, 0.0)  # m/s, W; ±10
    friction_coefficient: float = 0.0  # Coulomb's μ; 0 … 10
    friction_stiffness: float = 0.0  # N/m, of the tangential spring that slips at μ times the force
    stretch: ArrayLike = (0.0, 0.0, 0.0)  # m, of that spring, W
    trust_radius: float = 1.0  # m, how far from the pose the model holds; > 0, ≤ 1000
    tissue: int = 0  # index in the session's scene
    force_on_tool: Optional[ArrayLike] = None  # N, W, ±1e4, of this point; without a stiffness only

    def __post_init__(self) -> None:
        self.check()

    def __repr__(self) -> str:
        """The values that are not the default."""
        given = [
            f"{field.name}={value.tolist() if isinstance(value, np.ndarray) else value}"
            for field in fields(self)
            if (value := getattr(self, field.name)) is not None and str(value) != str(field.default)
        ]
        return f"Contact({', '.join(given)})"

    def force(self, velocity: ArrayLike) -> NDArray[Any]:
        """N on the tool at the pose of the motion, moving at `velocity` m/s, W; 0 without touch."""
        if self.stiffness is None:
            return np.zeros(3) if self.force_on_tool is None else np.asarray(self.force_on_tool, float)
        normal = np.asarray(self.normal, float)
        if self.penetration <= 0.0:
            return np.zeros(3)
        relative = np.asarray(velocity, float) - self.surface_velocity
        elastic = self.stiffness * self.penetration
        total = (elastic - self.damping * (normal @ relative)) * normal
        total -= self._friction_force(elastic)
        along = normal @ total
        on_tool: NDArray[Any] = total - min(along, 0.0) * normal
        return on_tool

    def stored_energy(self) -> float:
        """J, elastic."""
        stretch = np.asarray(self.stretch, float)
        return 0.5 * (
            (self.stiffness or 0.0) * self.penetration**2 + self.friction_stiffness * float(stretch @ stretch)
        )

    def _friction_force(self, elastic: float) -> NDArray[Any]:
        if self.friction_coefficient == 0.0:
            return np.zeros(3)
        pull = self.friction_stiffness * np.asarray(self.stretch, float)
        most, length = self.friction_coefficient * max(elastic, 0.0), float(np.linalg.norm(pull))
        return pull if length <= most else most / length * pull

    def check(self) -> None:
        """ValueError if a value is not finite or out of range."""
        normal = _vector("contact.normal", self.normal, 1.0 + 1e-6)
        if abs(float(normal @ normal) - 1.0) > 1e-6:
            raise ValueError(f"contact.normal = {normal}: must have length 1; divide it by its length")
        _number("contact.penetration", self.penetration, -1e3, 1e3)
        if self.stiffness is not None:
            _number("contact.stiffness", self.stiffness, 0.0, 1e6)
        if self.force_on_tool is not None:
            _vector("contact.force_on_tool", self.force_on_tool, 1e4)
            if self.stiffness is not None:
                raise ValueError("contact.force_on_tool: the force follows from the stiffness; leave one out")
        _number("contact.damping", self.damping, 0.0, 1e4)
        _number("contact.trust_radius", self.trust_radius, 1e-9, 1e3)
        _number("contact.friction_coefficient", self.friction_coefficient, 0.0, 10.0)
        _number("contact.friction_stiffness", self.friction_stiffness, 0.0, 1e6)
        _vector("contact.stretch", self.stretch, 1e3)
        _vector("contact.surface_velocity", self.surface_velocity, 10.0)
        if isinstance(self.tissue, _BOOLS) or not isinstance(self.tissue, Integral) or self.tissue < 0:
            raise ValueError(f"contact.tissue = {self.tissue!r}: must be a whole number from 0, its place in the scene")
        if self.curvature is not None:
            curvature = _array(self.curvature)
            if curvature is None or curvature.shape != (3, 3) or not np.all(np.abs(curvature) <= 1e9):
                raise ValueError("contact.curvature: must be 3×3 numbers, each within ±1e9 1/m")
            if not np.allclose(curvature, curvature.T):
                raise ValueError("contact.curvature: must be symmetric, as a Hessian is")

    def fill(self, wire: interaction_pb2.Contact, velocity: ArrayLike) -> None:
        """Writes itself, checked, into a message. ValueError if its force or energy is out of range."""
        normal = np.asarray(self.normal, float)
        wire.tissue = self.tissue
        wire.penetration_m = self.penetration
        _put(wire.normal_world, normal)
        _put(wire.force_on_tool_newton, _vector("the force of a contact", self.force(velocity), 1e4))
        stiffness = self.stiffness or 0.0
        elastic = stiffness * self.penetration
        _put(wire.elastic_force_on_tool_newton, _vector("the force of a contact", elastic * normal, 1e4))
        _put(wire.surface_velocity_world_m_per_s, np.asarray(self.surface_velocity, float))
        along = np.outer(normal, normal)
        wire.d_force_d_position.extend((-stiffness * along).ravel())
        wire.d_force_d_velocity.extend((-self.damping * along).ravel())
        if self.curvature is not None:
            curvature = np.asarray(self.curvature, float)
            wire.curvature_per_m.extend((0.5 * (curvature + curvature.T)).ravel())
        wire.stored_energy_joule = _number("the energy of a contact", self.stored_energy(), 0.0, 1e3)
        wire.trust_radius_m = self.trust_radius
        if self.friction_coefficient > 0.0:
            wire.friction_coefficient = self.friction_coefficient
            wire.friction_stiffness_newton_per_m = self.friction_stiffness
            _put(wire.stretch_m, np.asarray(self.stretch, float))


_BOOLS = (bool, np.bool_)


def _real(name: str, value: Any) -> Any:
    """The value; ValueError if it is no number. True and False are none."""
    if isinstance(value, _BOOLS) or not isinstance(value, Real):
        raise ValueError(f"{name} = {value!r}: must be a number")
    return value


def _array(value: ArrayLike) -> Optional[NDArray[Any]]:
    """The numbers; None if something else is among them, or if the rows have different lengths."""
    try:
        given = value if isinstance(value, np.ndarray) else np.array(value, object)
        if given.dtype == object:
            if not all(isinstance(one, Real) and not isinstance(one, _BOOLS) for one in given.ravel()):
                return None
        elif given.dtype.kind not in "iuf":
            return None
        return given.astype(float)
    except ValueError:
        return None


def _number(name: str, value: float, least: float, most: float) -> float:
    _real(name, value)
    if not least <= value <= most:  # NaN fails too
        raise ValueError(f"{name} = {value}: must be {least:g} … {most:g}; mind the SI unit")
    return value


def _vector(name: str, value: ArrayLike, most: float) -> NDArray[Any]:
    vector = _array(value)
    if vector is None:
        raise ValueError(f"{name} = {value!r}: must be 3 numbers, x, y, z")
    if vector.shape != (3,):
        raise ValueError(f"{name}: must be 3 numbers, x, y, z, not of shape {vector.shape}")
    if not np.all(np.abs(vector) <= most):
        raise ValueError(f"{name} = {vector}: must be finite, each within ±{most:g}; mind the SI unit")
    return vector


def _put(wire: interaction_pb2.Contact, vector: NDArray[Any]) -> None:
    wire.x, wire.y, wire.z = vector.tolist()
