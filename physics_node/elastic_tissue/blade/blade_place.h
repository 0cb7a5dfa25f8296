// SPDX-License-Identifier: Apache-2.0
// blade_place.h — where a blade is in an elastic body.
#pragma once

#include "common/core/vector.h"

namespace palpate::physics {

/// The edge of a blade in the untouched body, where it went in. It stays in this plane.
struct BladePlace {
  Vector3 from_m = Vector3::Zero();   ///< the end at the tip
  Vector3 facing = Vector3::UnitX();  ///< unit, where it cuts
  Vector3 along = Vector3::UnitZ();   ///< unit, ⊥ facing: from there on
  double length_m = 0.0;

  [[nodiscard]] Vector3 normal() const { return along.cross(facing); }
};

/// Of an edge that lies in a body.
struct EdgeInTissue {
  double length_m = 0.0;
  double newton = 0.0;     ///< Σ toughness × length: what a way across it takes
  double cut_joule = 0.0;  ///< that its last way took
  double deepest_m = 0.0;  ///< that it has cut, from where it went in
};

}  // namespace palpate::physics
