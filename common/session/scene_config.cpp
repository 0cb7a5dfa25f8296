// SPDX-License-Identifier: Apache-2.0
#include "common/session/scene_config.h"

namespace palpate {
namespace {

struct Inside {
  const Vector3& point_m;
  bool operator()(const HalfSpaceGeometry& h) const {
    return h.normal.dot(point_m - h.point_m) <= 0.0;
  }
  bool operator()(const SphereGeometry& s) const {
    return (point_m - s.center_m).norm() <= s.radius_m;
  }
  bool operator()(const BoxGeometry& b) const {
    return ((point_m - b.center_m).cwiseAbs().array() <= 0.5 * b.size_m.array()).all();
  }
  bool operator()(const MeshTag& /*tag*/) const { return false; }
};

}  // namespace

bool contains(const RegionGeometry& region, const Vector3& point_m) {
  return std::visit(Inside{point_m}, region);
}

}  // namespace palpate
