// SPDX-License-Identifier: Apache-2.0
#include "mofc_node/tissue/local_tissues.h"

#include <algorithm>
#include <cmath>

#include "common/contact/tissue_motion.h"

namespace palpate::mofc {
namespace {

constexpr std::uint32_t kViewsPerStep = 64;
constexpr std::uint32_t kMostViewsPerProxy = 32;
constexpr std::uint32_t kLeastViewsPerProxy = 8;
// What cannot catch up with the tool on such ways costs too much.
constexpr double kLeastWay_m = 1e-3;

ToolPose between(const ToolPose& from, const ToolPose& to, double share) noexcept {
  return {.tip_m = from.tip_m + share * (to.tip_m - from.tip_m),
          .shaft = (from.shaft + share * (to.shaft - from.shaft)).normalized(),
          .time_s = from.time_s + share * (to.time_s - from.time_s)};
}

}  // namespace

void LocalTissues::reset() noexcept {
  for (Memory& memory : memories_) memory = {};
  for (Result& result : results_) result = {};
  work_ = 0;
  is_exhausted_ = false;
}

void LocalTissues::forget(Memory& memory) noexcept {
  memory = {.is_used = true, .version = memory.version, .most_way_m = memory.most_way_m};
}

void LocalTissues::step(std::array<DescribedTissue, kMaxDescribed>& tissues,
                        const Interaction& newest, const ToolPose& now,
                        const ToolVelocity& tool_velocity_world,
                        const std::array<double, kMaxDescribed>& shares,
                        std::uint32_t most_work) noexcept {
  Budget left{.views = kViewsPerStep, .work = most_work};
  const auto step_if = [&](const auto& is_wanted) {
    for (std::size_t i = 0; i < kMaxDescribed; ++i) {
      if (!is_wanted(i)) continue;
      Memory& memory = memories_[i];
      results_[i] = {};
      if (tissues[i].is_known()) {
        results_[i] =
            step_one(tissues[i], newest, now, tool_velocity_world, shares[i] > 0.0, memory, left);
      } else if (memory.is_used) {
        memory = {};
      }
    }
  };
  std::array<bool, kMaxDescribed> is_pushing{};
  for (std::size_t i = 0; i < kMaxDescribed; ++i) is_pushing[i] = results_[i].force.is_touching;
  step_if([&](std::size_t i) { return is_pushing[i]; });
  step_if([&](std::size_t i) { return !is_pushing[i]; });
  work_ = left.used;
  is_exhausted_ = left.is_exhausted;
}

LocalTissues::Result LocalTissues::step_one(DescribedTissue& tissue, const Interaction& newest,
                                            const ToolPose& now, const ToolVelocity& velocity,
                                            bool has_share, Memory& memory, Budget& left) noexcept {
  memory.is_used = true;
  if (memory.version != tissue.version()) {
    const ModelForce force = memory.force;
    forget(memory);
    memory.version = tissue.version();
    memory.force = force;
  }
  const Vector3 tip_m = now.tip_m - displacement(tissue.motion(), now.time_s).position_m;
  bool has_work = left.work > 0 && left.take(tissue.prepare(tip_m, false));
  if (memory.shaft && has_work) {
    has_work = left.take(tissue.prepare(memory.shaft->proxy.point_m, true));
  }
  const bool is_anew = !memory.is_begun;
  if (is_anew) begin(tissue, newest, now, memory);
  const double way_m = memory.pose ? (now.tip_m - memory.pose->tip_m).norm() : 0.0;
  std::optional<Result> result;
  if (has_work) result = advance(tissue, now, velocity, has_share, memory, left);
  left.is_exhausted = left.is_exhausted || !has_work;
  // the force of a tissue that has a share does not end in one step
  const bool is_held = has_share && (!result || (is_anew && !result->is_valid));
  if (is_held) {
    result = Result{.is_stepped = true, .tissue = tissue.tissue(), .force = memory.force};
  } else if (!result) {
    forget(memory);
    result = Result{.is_stepped = true, .tissue = tissue.tissue()};
  }
  // of a shorter way less needs to be known, and it is less work
  if (!has_share && !result->is_valid && !memory.is_behind) {
    memory.most_way_m = std::max(kLeastWay_m, 0.5 * std::min(way_m, memory.most_way_m));
  }
  memory.is_begun = result->is_valid || memory.is_behind || (has_share && !(is_held && is_anew));
  if (result->is_valid) memory.most_way_m = std::numeric_limits<double>::infinity();
  memory.force = result->force;
  return *result;
}

/// Continues from what the tissue remembered when physics_node looked, or begins anew.
void LocalTissues::begin(const DescribedTissue& tissue, const Interaction& newest,
                         const ToolPose& now, Memory& memory) noexcept {
  const ModelForce force = memory.force;
  forget(memory);
  memory.force = force;
  const double then_s =
      to_seconds((newest.header.sampled_at + newest.scene_ahead).time_since_epoch());
  const Vector3 moved_m = displacement(tissue.motion(), std::min(then_s, now.time_s)).position_m;
  for (std::uint32_t i = 0; i < newest.listed_count; ++i) {
    const Contact& contact = newest.contacts[i];
    if (contact.tissue != tissue.tissue()) continue;
    memory.pose = {.tip_m = newest.tool_position_world_m,
                   .shaft = newest.tool_orientation_world * Vector3::UnitZ(),
                   .time_s = std::min(then_s, now.time_s)};
    const ToolShape& tool = tissue.tool();
    Touch touch{.tissue = contact.tissue,
                .is_shaft = contact.is_shaft,
                .radius_m = contact.is_shaft ? tool.shaft_radius_m : tool.tip_radius_m};
    touch.is_punctured = contact.is_punctured;
    touch.is_rubbed = contact.penetration_m > 0.0 && !contact.is_punctured;
    touch.stretch_m = contact.stretch_m;
    touch.proxy.point_m = newest.tool_position_world_m - moved_m;
    touch.proxy.place_m = touch.proxy.point_m + contact.held_m;
    touch.proxy.side = contact.is_behind ? -1.0 : 1.0;
    if (touch.is_shaft) {
      memory.shaft = touch;
      continue;
    }
    if (!touch.has_hold()) {
      memory.free = {touch.proxy.point_m, touch.radius_m - contact.penetration_m};
    }
    memory.tip = touch;
    memory.relaxation = {.penetration_m = std::max(0.0, contact.penetration_m),
                         .relaxed_m = contact.relaxed_m};
  }
}

std::optional<LocalTissues::Result> LocalTissues::advance(DescribedTissue& tissue,
                                                          const ToolPose& tool,
                                                          const ToolVelocity& velocity,
                                                          bool has_share, Memory& memory,
                                                          Budget& left) noexcept {
  const KelvinVoigtMaterial& material = tissue.material();
  Result result{.is_stepped = true, .is_valid = true, .tissue = tissue.tissue()};
  ToolPose now = tool;
  memory.is_behind = false;
  if (!has_share && memory.pose) {
    const double share = memory.most_way_m / (tool.tip_m - memory.pose->tip_m).norm();
    memory.is_behind = share < 1.0;
    if (memory.is_behind) now = between(*memory.pose, tool, share);
  }
  const double dt_s = memory.pose ? std::max(0.0, now.time_s - memory.pose->time_s) : 0.0;
  const auto add = [&](Touch& touch, const Vector3& moved_m, double relaxed_m) {
    settle(touch, moved_m, material, relaxed_m);
    const Contact contact =
        acting_contact(touch, material, relaxed_m, tissue.motion(), velocity, now.time_s);
    if (!(contact.penetration_m > 0.0)) return;
    result.force.add(1.0, {contact.force_on_tool_newton, contact.stored_energy_joule, true,
                           contact.arm_m.cross(contact.force_on_tool_newton)});
  };

  TissueStep step(tissue.surface(), tissue.motion(), tissue.tool(), now, memory.pose,
                  std::clamp(left.views, kLeastViewsPerProxy, kMostViewsPerProxy), left.work);
  if (!has_share) step.use_only_covered();
  const auto count = [&](const Touch& touch) {
    left.views -= std::min(left.views, touch.proxy.hint.views);
    left.take(touch.proxy.hint.work);
  };
  const Touch* const known = memory.tip ? &*memory.tip : nullptr;
  // physics_node lists the tip of a tool whose shaft is near only if the tip is near too
  const bool was_free = known != nullptr ? !known->has_hold() : memory.pose.has_value();
  const double clearance = clearance_m(tissue.tool().tip_radius_m);
  const double around_m = memory.free.around_m(step.tip_m());
  Touch tip;
  if (was_free && around_m > clearance) {
    tip = step.free_tip(tissue.tissue(), known, around_m);
  } else {
    tip = step.follow_tip(tissue.tissue(), known);
    result.is_valid = tip.proxy.hint.uncovered_views == 0;
    memory.free = {};
    if (!tip.has_hold()) {
      memory.free = {step.tip_m(), std::min(tip.proxy.surface.distance_m,
                                            tissue.surface().unknown_m(step.tip_m()))};
      const bool has_stayed_free =
          was_free && memory.free.radius_m > clearance + step.moved_m().norm();
      result.is_valid = result.is_valid || has_stayed_free;
    }
  }
  count(tip);
  if (tip.proxy.hint.is_exhausted()) return std::nullopt;
  // nobody uses the rest of an invalid step, and the next one begins anew
  if (!result.is_valid && !has_share) {
    forget(memory);
    return result;
  }
  // nothing is remembered of a step that ends for want of work
  const bool may_touch_shaft = !tip.is_punctured && tissue.tool().shaft_length_m > 0.0;
  std::optional<Memory> before;
  if (may_touch_shaft) before = memory;
  if (material.relaxing_stiffness_newton_per_m > 0.0) {
    memory.relaxation.press(material.relaxation_time_s,
                            tip.is_punctured ? 0.0 : tip.penetration_m(), dt_s);
  }
  add(tip, step.moved_m(), memory.relaxation.relaxed_m);
  memory.tip = tip;

  // in punctured tissue the shaft is in the hole
  bool has_shaft = false;
  if (may_touch_shaft) {
    step.limit_work(std::max(1U, left.work));
    Touch shaft;
    Vector3 moved_m = Vector3::Zero();
    has_shaft = step.follow_shaft(tissue.tissue(), memory.shaft ? &*memory.shaft : nullptr, 0.0,
                                  memory.shaft_search, shaft, moved_m);
    count(shaft);
    if (shaft.proxy.hint.is_exhausted()) {
      memory = *before;
      return std::nullopt;
    }
    result.is_valid = result.is_valid && shaft.proxy.hint.uncovered_views == 0;
    if (has_shaft) {
      add(shaft, moved_m, shaft.penetration_m());
      memory.shaft = shaft;
    }
  }
  if (!has_shaft) memory.shaft.reset();
  memory.pose = now;
  if (!result.force.force_on_tool_newton.allFinite() ||
      !result.force.torque_on_tool_newton_m.allFinite() ||
      !std::isfinite(result.force.stored_energy_joule)) {
    forget(memory);
    return Result{.is_stepped = true, .tissue = tissue.tissue()};
  }
  if (memory.is_behind) return Result{.is_stepped = true, .tissue = tissue.tissue()};
  return result;
}

}  // namespace palpate::mofc
