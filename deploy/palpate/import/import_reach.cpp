// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/import/import_reach.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "common/contact/bounds.h"
#include "common/core/check.h"
#include "common/session/session_file.h"
#include "deploy/palpate/import/import_text.h"

namespace palpate {
namespace {

constexpr double kUsed = 0.9;        // of the workspace: its rim is not to be leant on
constexpr double kAside_m = 0.02;    // beside the target
constexpr double kScaleStep = 0.05;  // as are written
constexpr double kPlaceStep_m = 1e-4;
constexpr double kLittle = 0.5;  // of the upper side

}  // namespace

ReachDevice reach_device_of(const std::string& session_file) {
  const Session session = load_session(session_file, {});
  const std::optional<Vector3> half_m = workspace_half_extent_m(session.side().driver);
  if (!half_m) {
    throw SetupError("--device " + session_file +
                     ": a plug-in tells its workspace only when the device is open; give "
                     "--workspace-mm X Y Z instead");
  }
  return {.name = session_file, .half_extent_m = *half_m};
}

ReachDevice reach_device_of_size(const Vector3& size_mm) {
  return {.name = "--workspace-mm", .half_extent_m = 0.5e-3 * size_mm};
}

Reach propose_reach(const physics::TriangleMesh& surface, const ReachDevice& device,
                    const ReachTarget& target) {
  struct Face {
    Vector3 tip_m;  // the tip's centre as it touches its middle
    double area_m2;
    bool is_upper;
  };
  std::vector<Face> faces;
  Bounds wanted{Vector3(-kAside_m, -kAside_m, target.tip_radius_m - target.below_m),
                Vector3(kAside_m, kAside_m, target.tip_radius_m + target.above_m)};
  const Bounds way = wanted;
  for (const auto& [a, b, c] : surface.triangles) {
    const Vector3& corner_m = surface.vertices_m[a];
    const Vector3 area =
        0.5 * (surface.vertices_m[b] - corner_m).cross(surface.vertices_m[c] - corner_m);
    const double size_m2 = area.norm();
    if (size_m2 == 0.0) continue;
    const Vector3 middle_m = (corner_m + surface.vertices_m[b] + surface.vertices_m[c]) / 3.0;
    faces.push_back({middle_m + target.tip_radius_m / size_m2 * area, size_m2, area.z() > 0.0});
    if (!faces.back().is_upper) continue;
    wanted.include(faces.back().tip_m);
    wanted.include(Vector3(faces.back().tip_m + Vector3(0, 0, target.above_m)));
  }
  const Vector3 used_m = kUsed * device.half_extent_m;
  const Vector3 size_m = wanted.highest_m - wanted.lowest_m;
  Reach reach;
  reach.scale_ratio = std::clamp((size_m.cwiseQuotient(2.0 * used_m)).maxCoeff(), 1.0, kMostScale);
  reach.scale_ratio = std::ceil(reach.scale_ratio / kScaleStep - 1e-9) * kScaleStep;
  reach.has_target = true;
  for (int axis = 0; axis < 3; ++axis) {
    const double half_m = reach.scale_ratio * used_m[axis];
    const double middle_m = 0.5 * (wanted.lowest_m[axis] + wanted.highest_m[axis]);
    const double least_m = way.highest_m[axis] - half_m;
    const double most_m = way.lowest_m[axis] + half_m;
    reach.has_target = reach.has_target && least_m <= most_m;
    reach.offset_m[axis] =
        least_m <= most_m ? std::clamp(middle_m, least_m, most_m) : 0.5 * (least_m + most_m);
    reach.offset_m[axis] = std::round(reach.offset_m[axis] / kPlaceStep_m) * kPlaceStep_m;
  }
  double all_m2 = 0.0;
  double upper_m2 = 0.0;
  for (const Face& face : faces) {
    const bool is_reached =
        (reach.hand_m(face.tip_m).cwiseAbs().array() <= device.half_extent_m.array()).all();
    all_m2 += face.area_m2;
    upper_m2 += face.is_upper ? face.area_m2 : 0.0;
    if (!is_reached) continue;
    reach.surface_ratio += face.area_m2;
    reach.upper_ratio += face.is_upper ? face.area_m2 : 0.0;
  }
  if (all_m2 > 0.0) reach.surface_ratio /= all_m2;
  if (upper_m2 > 0.0) reach.upper_ratio /= upper_m2;
  return reach;
}

std::string reach_report(const Reach& reach, const ReachDevice& device) {
  const Vector3 size_mm = 2e3 * device.half_extent_m;
  const Vector3 offset_mm = 1e3 * reach.offset_m;
  std::string text = text_of(
      "\nReach (a proposal for %s: %.0f x %.0f x %.0f mm)\n"
      "  device.workspace in the session: scale_ratio %.2f, its middle at (%.1f, %.1f, %.1f) mm\n"
      "  the tip reaches %.0f %% of the side that is up, %.0f %% of the whole surface\n",
      device.name.c_str(), size_mm.x(), size_mm.y(), size_mm.z(), reach.scale_ratio, offset_mm.x(),
      offset_mm.y(), offset_mm.z(), 100.0 * reach.upper_ratio, 100.0 * reach.surface_ratio);
  if (reach.scale_ratio > 1.0) {
    text += text_of(
        "  1 mm of the hand moves the tool by %.2f mm, so the organ feels that much stiffer; "
        "scale_ratio 1 is true to scale\n  and reaches less\n",
        reach.scale_ratio);
  }
  if (!reach.has_target) {
    text +=
        "  WARNING: the workspace is too small to press on the target and to leave it; give a "
        "larger scale_ratio\n";
  } else if (reach.upper_ratio < kLittle) {
    text +=
        "  WARNING: less than half of the side that is up; turn another side up (--up), or give a "
        "clutch_button\n";
  }
  return text;
}

}  // namespace palpate
