// SPDX-License-Identifier: Apache-2.0
#include "common/contact/tissue_step.h"

#include <algorithm>
#include <cmath>

#include "common/contact/contact_model.h"
#include "common/contact/proxy.h"
#include "common/contact/tissue_motion.h"

namespace palpate {
namespace {

// A shaft that moves straight away from the surface is as far off it as it moved, but for rounding.
constexpr double kSlack_m = 1e-5;

/// The known touch, or a new one.
Touch known_or(const Touch* known, const Touch& fresh, std::uint32_t most_work) noexcept {
  Touch touch = known != nullptr ? *known : fresh;
  touch.proxy.hint.octree_cells_visited = 0;
  touch.proxy.hint.last_cell_hits = 0;
  touch.proxy.hint.views = 0;
  touch.proxy.hint.uncovered_views = 0;
  touch.proxy.hint.work = 0;
  touch.proxy.hint.most_work = most_work;
  touch.proxy.hint.only_covered = false;
  return touch;
}

}  // namespace

TissueStep::TissueStep(const Surface& surface, const TissueMotionConfig& motion,
                       const ToolShape& tool, const ToolPose& now,
                       const std::optional<ToolPose>& last, std::uint32_t most_views,
                       std::uint32_t most_work) noexcept
    : surface_(surface),
      tool_(tool),
      shaft_(now.shaft),
      last_shaft_(last ? last->shaft : now.shaft),
      tip_m_(now.tip_m - displacement(motion, now.time_s).position_m),
      last_tip_m_(last ? Vector3(last->tip_m - displacement(motion, last->time_s).position_m)
                       : tip_m_),
      dt_s_(last ? std::max(0.0, now.time_s - last->time_s) : 0.0),
      is_start_(!last),
      most_views_(most_views),
      most_work_(most_work) {}

Touch TissueStep::follow_tip(std::uint32_t tissue, const Touch* known) const noexcept {
  const double radius_m = tool_.tip_radius_m;
  Touch tip = known_or(known, {.tissue = tissue, .radius_m = radius_m}, most_work_);
  if (!tip.is_punctured) {
    tip.proxy.hint.only_covered = only_covered_;
    if (is_start_) {
      tip.proxy = begun_at(surface_, radius_m, tip_m_, tip.proxy.hint);
    } else {
      if (known == nullptr) tip.proxy = free_at(surface_, last_tip_m_, tip.proxy.hint);
      palpate::move(surface_, radius_m, tip_m_, dt_s_, tip.proxy, most_views_);
    }
    return tip;
  }
  tip.proxy.point_m = tip.proxy.place_m = tip_m_;
  tip.proxy.surface = surface_.view(tip_m_, tip.proxy.hint);
  const bool is_sheet = surface_.is_sheet();
  const double distance_m =
      is_sheet ? std::abs(tip.proxy.surface.distance_m) : tip.proxy.surface.distance_m;
  ShaftSearch search;
  const bool is_inside =
      distance_m <= clearance_m(radius_m) ||
      (tool_.shaft_length_m > 0.0 &&
       nearest_along(surface_, shaft_segment(tool_, tip_m_, shaft_),
                     is_sheet ? SheetSide::kEither : SheetSide::kFront,
                     clearance_m(tool_.shaft_radius_m), -1.0, search, tip.proxy.hint) >= 0.0);
  if (is_inside) return tip;
  return {.tissue = tissue,
          .radius_m = radius_m,
          .proxy = begun_at(surface_, radius_m, tip_m_, tip.proxy.hint)};
}

Touch TissueStep::free_tip(std::uint32_t tissue, const Touch* known,
                           double radius_m) const noexcept {
  Touch tip = known_or(known, {.tissue = tissue, .radius_m = tool_.tip_radius_m}, most_work_);
  tip.proxy.point_m = tip.proxy.place_m = tip_m_;
  tip.proxy.surface = {.distance_m = radius_m};
  return tip;
}

bool TissueStep::follow_shaft(std::uint32_t tissue, const Touch* known, double reach_m,
                              ShaftSearch& search, Touch& shaft, Vector3& moved_m) const noexcept {
  shaft = known_or(known, {.tissue = tissue, .is_shaft = true, .radius_m = tool_.shaft_radius_m},
                   most_work_);
  Proxy& proxy = shaft.proxy;
  proxy.hint.only_covered = only_covered_;
  const Vector3 held_m = proxy.place_m - proxy.point_m;
  const Vector3 tip_moved_m = this->moved_m();
  const double travel_m = std::max(
      tip_moved_m.norm(), (tip_moved_m + tool_.shaft_length_m * (shaft_ - last_shaft_)).norm());
  const SheetSide side = known == nullptr && surface_.is_sheet() ? SheetSide::kEither
                         : proxy.side < 0.0                      ? SheetSide::kBehind
                                                                 : SheetSide::kFront;
  const double start_m = known != nullptr ? (proxy.point_m - last_tip_m_).dot(last_shaft_) : -1.0;
  const double along_m =
      nearest_along(surface_, shaft_segment(tool_, tip_m_ + held_m, shaft_), side,
                    clearance_m(tool_.shaft_radius_m) + std::max(reach_m, travel_m + kSlack_m),
                    start_m, search, proxy.hint);
  if (along_m < 0.0) return false;

  shaft.arm_m = along_m * shaft_;
  const Vector3 point_m = tip_m_ + along_m * shaft_;
  const Vector3 last_point_m = last_tip_m_ + along_m * last_shaft_;
  moved_m = point_m - last_point_m;
  if (is_start_) {
    proxy = begun_at(surface_, tool_.shaft_radius_m, point_m, proxy.hint);
  } else {
    if (known == nullptr) proxy = free_at(surface_, last_point_m, proxy.hint);
    proxy.point_m = last_point_m;
    proxy.place_m = last_point_m + held_m;
    palpate::move(surface_, tool_.shaft_radius_m, point_m, dt_s_, proxy, most_views_);
  }
  // along the shaft, which may slide, the surface is taken as straight
  const double bend = shaft_.dot(proxy.surface.curvature_per_m * shaft_);
  if (bend > 0.0 && along_m < tool_.shaft_length_m) {
    const Vector3 bent = proxy.surface.curvature_per_m * shaft_;
    proxy.surface.curvature_per_m -= bent * bent.transpose() / bend;
  }
  return true;
}

Contact acting_contact(const Touch& touch, const KelvinVoigtMaterial& material, double relaxed_m,
                       const TissueMotionConfig& motion, const ToolVelocity& tool_velocity_world,
                       double time_s) noexcept {
  Contact contact = contact_of(touch, material, relaxed_m);
  contact.tissue = touch.tissue;
  contact.is_shaft = touch.is_shaft;
  contact.is_behind = touch.proxy.side < 0.0;
  contact.is_punctured = touch.is_punctured;
  // on the surface as it is without a tool; a tip in punctured tissue is dragged as a whole
  contact.arm_m = touch.arm_m;
  if (!touch.is_punctured) {
    contact.arm_m -= (touch.radius_m - contact.penetration_m) * contact.normal_world;
  }
  if (touch.is_punctured) contact.stretch_m = touch.stretch_m;
  contact.held_m = touch.proxy.place_m - touch.proxy.point_m;
  contact.relaxed_m = relaxed_m;
  contact.surface_velocity_world_m_per_s = displacement(motion, time_s).velocity_m_per_s;
  if (contact.penetration_m > 0.0) {
    contact.force_on_tool_newton =
        evaluate(contact, Vector3::Zero(), tool_velocity_world, 0.0).force_on_tool_newton;
  }
  return contact;
}

}  // namespace palpate
