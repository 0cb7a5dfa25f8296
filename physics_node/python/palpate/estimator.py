# SPDX-License-Identifier: Apache-2.0
"""A contact model from forces alone: the algorithm of physics_node/foreign/contact_estimator.h, which
explains it, in numpy. A test compares the two."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, sqrt
from typing import Any, Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .contact import _put
from .v1 import interaction_pb2

_Array = NDArray[Any]

_LEAST_NEWTON = 1e-3
_PLACE_M = 0.5e-3
_DEPTH_MEMORY_M, _SLIDE_MEMORY_M, _TURN_MEMORY_M = 5e-3, 50e-3, 20e-3
_TURN_RIDGE_M2 = 1e-6
_RIDGE = 0.02
_DEPTH_UNIT_M, _SPEED_UNIT = 1e-3, 1e-2
_ERROR_WEIGHT = 0.2
_STIFFNESS = (1.0, 2e4)
_MOST_DAMPING = 500.0
_MOST_CURVATURE = 200.0
_TRUSTED_ERROR, _NO_MODEL = 0.3, 0.7
_TRUST_M = (0.5e-3, 20e-3)
_ONE_PATCH = 0.5
_EXPECTED_M = 30e-3
_LEAST_TURN_COSINE = -0.0175


@dataclass
class ContactLaw:
    """Spring and damper along the normal, as an engine was asked for them."""

    stiffness: float  # N/m
    damping: float  # N·s/m


@dataclass
class Foreseen:
    """Tissue that the tool has not touched yet. Frame W."""

    surface: _Array  # m, where the tool will touch
    normal: _Array  # unit, out of the tissue
    stiffness: float  # N/m
    slope_error: float  # N/m, s
    newton: float  # N, a force at which that was found


@dataclass
class Estimate:
    """What is known of the tissue at one pose of the tool. SI, frame W."""

    normal: _Array  # unit, out of the tissue
    penetration: float  # m; < 0: the distance
    elastic_force: _Array  # N on the tool, without damping
    stiffness: float  # N/m, along the normal
    damping: float  # N·s/m, along the normal
    curvature: float  # 1/m, the same in all directions along the surface
    trust_radius: float  # m
    is_held: bool = False  # no model: the force, wherever the tool goes

    def force(self, moved: _Array, velocity: _Array) -> _Array:
        """N on the tool after it has moved by `moved` m, at `velocity` m/s, however far that is."""
        if self.is_held:
            return self.elastic_force
        p, n = _seen_from(moved, self.penetration, self.normal, self.curvature)
        if p <= 0.0 or self.normal @ n < _LEAST_TURN_COSINE:
            return np.zeros(3)
        if self.curvature == 0.0:
            n = self.normal
        turn = _turn(self.normal, n)
        f = self.elastic_force + self.stiffness * (p - self.penetration) * self.normal
        f = turn @ (f - self.damping * (self.normal @ (turn.T @ velocity)) * self.normal)
        along = n @ f
        return f - along * n if along < 0.0 else f


    def fill(self, wire: interaction_pb2.Contact, force: _Array) -> None:
        """Writes itself into a message. `force` N acts at the pose of the estimate."""
        along = np.outer(self.normal, self.normal)
        wire.penetration_m = self.penetration
        _put(wire.normal_world, self.normal)
        _put(wire.force_on_tool_newton, force)
        _put(wire.elastic_force_on_tool_newton, self.elastic_force)
        _put(wire.surface_velocity_world_m_per_s, np.zeros(3))
        wire.d_force_d_position.extend((-self.stiffness * along).ravel())
        wire.d_force_d_velocity.extend((-self.damping * along).ravel())
        if self.curvature != 0.0:
            wire.curvature_per_m.extend((self.curvature * (np.eye(3) - along)).ravel())
        wire.stored_energy_joule = min(0.5 * self.stiffness * self.penetration**2, 1e3)
        wire.is_adhesive = self.is_held
        wire.trust_radius_m = self.trust_radius


@dataclass
class _Place:
    position: _Array
    normal: _Array
    depth: float
    approach: float
    newton: float
    model: Estimate


class ContactEstimator:
    """Contact model of one tissue for one tool, from position, velocity and force of every step."""

    def __init__(self) -> None:
        self.stiffness = 0.0  # N/m; 0: no touch yet
        self.damping = 0.0  # N·s/m
        self.curvature = 0.0  # 1/m
        self._is_touching = False
        self._has_surface = False
        self._free_at: Optional[_Array] = None
        self._last: Optional[_Place] = None
        self._place: Optional[_Place] = None
        self._first_stiffness = 0.0
        self._pp = self._pw = self._ww = self._pn = self._wn = 0.0
        self._turn = self._slid2 = 0.0
        self._error2 = 0.0
        self._mean_newton = 0.0
        self._compared = 0

    def step(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        force: ArrayLike,
        normal: Optional[ArrayLike] = None,
        penetration: Optional[float] = None,
        law: Optional[ContactLaw] = None,
    ) -> Optional[Estimate]:
        """The model at this pose; None where nothing is known.

        :param position: (3,) m, of the tool
        :param velocity: (3,) m/s
        :param force: (3,) N on the tool
        :param normal: unit, out of the tissue, if the engine knows it; None: that of the force
        :param penetration: m, as the engine has it; < 0: the distance
        :param law: at this place; None: estimated
        """
        x, v, f = (np.asarray(one, float) for one in (position, velocity, force))
        given = None if normal is None else np.asarray(normal, float)
        magnitude = sqrt(f @ f)
        if magnitude <= _LEAST_NEWTON:
            return self._expect(x, v, given, penetration)
        n = f / magnitude if given is None else given
        newton = float(n @ f)
        if newton <= 0.5 * magnitude:
            self._is_touching = False
            return Estimate(f / magnitude, 1.0, f, 0.0, 0.0, 0.0, 1.0, True)
        return self._touch(x, v, f, n, newton, penetration, law)

    def foresee(self, tissue: Foreseen) -> None:
        """The surface to expect until the tool touches; before step()."""
        self.stiffness = float(np.clip(tissue.stiffness, *_STIFFNESS))
        if self._first_stiffness == 0.0:
            self._first_stiffness = self.stiffness
            self._mean_newton = tissue.newton
            self._error2 = tissue.slope_error**2
        n = tissue.normal
        self._last = _Place(tissue.surface, n, 0.0, 0.0, 0.0, self._model(n, 0.0, np.zeros(3)))
        self._has_surface = True
        self._is_touching = False

    def foresee_none(self, as_far_as: _Array) -> None:
        """There is no tissue between here and that place: a surface that is expected there is not."""
        if self._last is not None:
            surface = self._last.model
            moved = as_far_as - self._last.position
            p, _ = _seen_from(moved, surface.penetration, surface.normal, self.curvature)
            self._has_surface = self._has_surface and p <= 0.0

    def _touch(
        self,
        x: _Array,
        v: _Array,
        f: _Array,
        n: _Array,
        newton: float,
        penetration: Optional[float],
        law: Optional[ContactLaw],
    ) -> Estimate:
        last = self._last
        is_first = not self._is_touching or last is None or float(n @ last.normal) < _ONE_PATCH
        if is_first or last is None:
            depth = self._begin(x, n, newton, penetration)
        else:
            mean = n + last.normal
            depth = last.depth - float(mean @ (x - last.position)) / sqrt(mean @ mean)
        here = _Place(x, n, depth, -float(n @ v), newton, None)  # type: ignore[arg-type]
        place = self._place
        is_compared = is_first or place is None
        if not is_compared and place is not None:
            moved = x - place.position
            if sqrt(moved @ moved) >= _PLACE_M:
                self._compare(v, f, here, place)
                is_compared = True
            else:
                is_compared = not moved.any()
        if law is not None:
            self.stiffness = float(np.clip(law.stiffness, *_STIFFNESS))
            self.damping = float(np.clip(law.damping, 0.0, _MOST_DAMPING))
        elastic = max(newton - self.damping * here.approach, 0.02 * newton)
        elastic_force = f + self.damping * float(n @ v) * n
        here.model = self._model(n, elastic / self.stiffness, elastic_force)
        self._last = here
        self._has_surface = True
        here.model.trust_radius = self._trust_radius_before(last)
        if is_compared:
            self._place = here
        self._free_at = None
        return here.model

    def _begin(self, x: _Array, n: _Array, newton: float, penetration: Optional[float]) -> float:
        self._is_touching = True
        if self.stiffness == 0.0:
            depth = penetration or 0.0
            if depth <= 0.0 and self._free_at is not None:
                depth = -0.5 * float(n @ (x - self._free_at))
            self._first_stiffness = float(np.clip(newton / max(depth, 1e-6), *_STIFFNESS))
            self.stiffness = self._first_stiffness
            self._error2 = 0.25 * self.stiffness**2
        if self._mean_newton == 0.0:
            self._mean_newton = newton
        return newton / self.stiffness

    def _compare(self, v: _Array, f: _Array, here: _Place, place: _Place) -> None:
        moved = here.position - place.position
        mean = here.normal + place.normal
        mean = mean / sqrt(mean @ mean)
        slid = moved - float(mean @ moved) * mean
        way = sqrt(slid @ slid)
        deeper = here.depth - place.depth
        wrong = f - place.model.force(moved, v)
        weight = max(_ERROR_WEIGHT, 1.0 / (self._compared + 1))
        self._error2 += weight * (float(wrong @ wrong) / float(moved @ moved) - self._error2)
        self._mean_newton += weight * (here.newton - self._mean_newton)

        kept = exp(-abs(deeper) / _DEPTH_MEMORY_M - way / _SLIDE_MEMORY_M)
        p = deeper / _DEPTH_UNIT_M
        w = (here.approach - place.approach) / _SPEED_UNIT
        newton = here.newton - place.newton
        self._pp = kept * self._pp + p * p
        self._pw = kept * self._pw + p * w
        self._ww = kept * self._ww + w * w
        self._pn = kept * self._pn + p * newton
        self._wn = kept * self._wn + w * newton
        self._solve()

        kept = exp(-way / _TURN_MEMORY_M)
        self._turn = kept * self._turn + float((here.normal - place.normal) @ slid)
        self._slid2 = kept * self._slid2 + way * way
        self.curvature = float(np.clip(self._turn / (self._slid2 + _TURN_RIDGE_M2), -_MOST_CURVATURE, _MOST_CURVATURE))
        self._compared += 1

    def _solve(self) -> None:
        pp, ww = self._pp + _RIDGE, self._ww + _RIDGE
        pn = self._pn + _RIDGE * self._first_stiffness * _DEPTH_UNIT_M
        determinant = pp * ww - self._pw**2
        k = (pn * ww - self._wn * self._pw) / determinant
        b = (self._wn * pp - pn * self._pw) / determinant
        bounded = min(max(b, 0.0), _MOST_DAMPING * _SPEED_UNIT)
        if b != bounded:
            b = bounded
            k = (pn - b * self._pw) / pp
        self.stiffness = float(np.clip(k / _DEPTH_UNIT_M, *_STIFFNESS))
        self.damping = b / _SPEED_UNIT

    def _expect(
        self, x: _Array, v: _Array, normal: Optional[_Array], penetration: Optional[float]
    ) -> Optional[Estimate]:
        self._is_touching = False
        self._free_at = x
        last = self._last
        if last is None or not self._has_surface:
            return None
        moved = x - last.position
        p, n = _seen_from(moved, last.model.penetration, last.model.normal, self.curvature)
        most = max(0.0, self.damping * float(n @ v) / self.stiffness)
        if penetration is not None:
            most = min(most, penetration)
        if p > most:
            last.model.penetration -= p - most
            p = most
        if normal is not None:
            n = normal
        if penetration is not None and penetration < 0.0:
            p = penetration
        if penetration is None and sqrt(moved @ moved) > _EXPECTED_M:
            return None
        model = self._model(n, p, self.stiffness * p * n)
        model.trust_radius = abs(p) + self._trust_radius_before(last)
        return model

    def _model(self, n: _Array, penetration: float, elastic_force: _Array) -> Estimate:
        return Estimate(n, penetration, elastic_force, self.stiffness, self.damping, self.curvature, 0.0)

    def _trust_radius_before(self, last: Optional[_Place]) -> float:
        error = sqrt(self._error2)
        if error > _NO_MODEL * self.stiffness:
            return _TRUST_M[0]
        newton = max(self._mean_newton, 0.0 if last is None else last.newton)
        return float(np.clip(_TRUSTED_ERROR * newton / max(error, 1e-3), *_TRUST_M))


def _seen_from(d: _Array, penetration: float, normal: _Array, curvature: float) -> tuple[float, _Array]:
    """Penetration and normal of the circle of curvature, displaced by d."""
    a = float(normal @ d)
    gradient = (1.0 + curvature * a) * normal + curvature * (d - a * normal)
    length = sqrt(gradient @ gradient)
    p = penetration - (2.0 * a + curvature * float(d @ d)) / (1.0 + length)
    return p, (gradient / length if length > 0.0 else normal)


def _turn(from_: _Array, to: _Array) -> _Array:
    """The smallest rotation that turns one unit vector into the other."""
    w = np.cross(from_, to)
    cross = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    turn: _Array = np.eye(3) + cross + cross @ cross / (1.0 + from_ @ to)
    return turn
