// SPDX-License-Identifier: Apache-2.0
#include "physics_node/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <variant>

#include "common/contact/proxy.h"
#include "common/contact/tissue_motion.h"
#include "physics_node/files/surface_files.h"

namespace palpate::physics {
namespace {

// Contacts with persistent state; further contacts are evaluated without history (no friction, no
// puncture).
constexpr std::size_t kMostTouches = 128;

/// Keeps `contact` if it is among the deepest. Of equally deep ones the first tissue comes first,
/// so the order does not depend on the tree of the broad phase.
void keep_deepest(const Contact& contact, SceneForce& sum) noexcept {
  const auto is_before = [](const Contact& a, const Contact& b) {
    return a.penetration_m != b.penetration_m ? a.penetration_m > b.penetration_m
                                              : a.tissue < b.tissue;
  };
  std::size_t place = sum.listed_count;
  if (sum.listed_count < kMaxContacts) ++sum.listed_count;
  for (; place > 0 && is_before(contact, sum.contacts[place - 1]); --place) {
    if (place < kMaxContacts) sum.contacts[place] = sum.contacts[place - 1];
  }
  if (place < kMaxContacts) sum.contacts[place] = contact;
}

/// Clears the sum, except its counts, unless all of it is finite.
void clear_unless_finite(SceneForce& sum) noexcept {
  const auto is_finite = [](const Contact& contact) {
    return contact.elastic_force_on_tool_newton.allFinite() &&
           contact.d_force_d_position.allFinite() && contact.d_force_d_velocity.allFinite() &&
           std::isfinite(contact.stored_energy_joule) && contact.stretch_m.allFinite() &&
           contact.held_m.allFinite() && std::isfinite(contact.relaxed_m);
  };
  if (sum.force_on_tool_newton.allFinite() && sum.torque_on_tool_newton_m.allFinite() &&
      std::isfinite(sum.stored_energy_joule) &&
      std::all_of(sum.contacts.begin(), sum.contacts.begin() + sum.listed_count, is_finite)) {
    return;
  }
  const SceneCounts counts = sum;
  sum = {};
  static_cast<SceneCounts&>(sum) = counts;
}

}  // namespace

void add_contact(const Contact& contact, SceneForce& sum) noexcept {
  if (contact.penetration_m > 0.0) {
    sum.force_on_tool_newton += contact.force_on_tool_newton;
    sum.torque_on_tool_newton_m += contact.arm_m.cross(contact.force_on_tool_newton);
    sum.stored_energy_joule += contact.stored_energy_joule;
    ++sum.contact_count;
  }
  keep_deepest(contact, sum);
}

Scene::Scene(const SceneConfig& config, double reach_m) : tool_(config.tool()), reach_m_(reach_m) {
  std::vector<BoxTree::Item> items;
  std::set<const FileSurface*> surfaces;
  for (const TissueConfig& tissue : config.tissues) {
    const auto index = static_cast<std::uint32_t>(tissues_.size());
    if (!std::holds_alternative<KelvinVoigtMaterial>(tissue.material)) {
      ++elastic_;
      tissues_.push_back({.shape = Shape(SphereGeometry{}), .material = {}, .motion = {}});
      if (reach_m_ > 0.0) descriptions_.emplace_back();
      continue;
    }
    const auto& material = std::get<KelvinVoigtMaterial>(tissue.material);
    const bool is_relaxing = material.relaxing_stiffness_newton_per_m > 0.0;
    tissues_.push_back({.shape = to_shape(tissue.geometry),
                        .material = material,
                        .motion = tissue.motion,
                        .relaxing = is_relaxing ? relaxation_times_s_.size() : kNone});
    if (is_relaxing) relaxation_times_s_.push_back(material.relaxation_time_s);

    const Shape& shape = tissues_.back().shape;
    if (reach_m_ > 0.0) {
      descriptions_.push_back(described(shape, material, tissue.motion, tool_, index));
    }
    const FileSurface* const surface = shape.file_surface();
    if (surface != nullptr && !surfaces.insert(surface).second) ++shared_surfaces_;
    std::optional<Bounds> bounds = shape.bounds();
    if (!bounds) {
      unbounded_.push_back(index);
      continue;
    }
    const double radius_m = std::max(tool_.tip_radius_m, tool_.shaft_radius_m);
    Vector3 margin_m = Vector3::Constant(clearance_m(radius_m) + reach_m_);
    if (is_moving(tissue.motion)) margin_m += tissue.motion.amplitude_m.cwiseAbs();
    bounds->grow(margin_m);
    items.push_back({*bounds, bounds->center_m(), index});
  }
  bounded_ = BoxTree(std::move(items), 1);
}

void Scene::set_material(std::size_t tissue, double stiffness_newton_per_m,
                         double damping_newton_s_per_m) noexcept {
  const auto set = [&](KelvinVoigtMaterial& material) {
    material.stiffness_newton_per_m = stiffness_newton_per_m;
    material.damping_newton_s_per_m = damping_newton_s_per_m;
  };
  set(tissues_[tissue].material);
  if (!descriptions_.empty() && descriptions_[tissue].description) {
    set(descriptions_[tissue].description->material);
  }
}

TissueMemory Scene::new_memory() const {
  return TissueMemory(std::min(2 * tissues_.size(), kMostTouches), Relaxation(relaxation_times_s_));
}

// --- which tissues, and where they touch the tool -----------------------------------------------

/// Calls visit(tissue) once for each tissue that holds the tool or that the tool may have come near
/// to since the memory's pose. Returns the number of calls.
template <class Visit>
std::uint32_t Scene::visit_near(const ToolPose& now, const TissueMemory& memory,
                                const Visit& visit) const noexcept {
  std::uint32_t visited = 0;
  const std::span<const Touch> touches = memory.touches();
  const auto is_held_by = [](std::span<const Touch> some, std::uint32_t tissue) {
    return std::any_of(some.begin(), some.end(), [&](const Touch& touch) {
      return touch.tissue == tissue && touch.has_hold();
    });
  };
  for (std::size_t i = 0; i < touches.size(); ++i) {
    // a tissue may hold both tip and shaft
    if (!touches[i].has_hold() || is_held_by(touches.first(i), touches[i].tissue)) continue;
    ++visited;
    visit(touches[i].tissue);
  }
  const auto visit_other = [&](std::uint32_t tissue) {
    if (is_held_by(touches, tissue)) return;
    ++visited;
    visit(tissue);
  };
  for (const std::uint32_t tissue : unbounded_) visit_other(tissue);

  Bounds swept{now.tip_m, now.tip_m};
  const auto sweep = [&](const ToolPose& pose) {
    swept.include(pose.tip_m);
    if (tool_.shaft_length_m > 0.0) swept.include(pose.tip_m + tool_.shaft_length_m * pose.shaft);
  };
  sweep(now);
  const std::optional<ToolPose>& last = memory.pose();
  if (last && (now.tip_m - last->tip_m).norm() <= kLongestMotion_m) sweep(*last);
  bounded_.visit_near(swept, visit_other);
  return visited;
}

/// Calls take(touch, moved_m) for the tip and each near tissue, and for the shaft where it is near:
/// the touch before settle(), and the motion of its sphere relative to the tissue. take() settles
/// the touch.
template <class Take>
SceneCounts Scene::visit_touches(const ToolPose& now, const TissueMemory& memory,
                                 const Take& take) const noexcept {
  SceneCounts counts;
  const auto take_and_count = [&](Touch& touch, const Vector3& moved_m) {
    counts.octree_cells_visited += touch.proxy.hint.octree_cells_visited;
    counts.octree_last_cell_hits += touch.proxy.hint.last_cell_hits;
    take(touch, moved_m);
  };
  counts.tissues_visited = visit_near(now, memory, [&](std::uint32_t index) {
    const Tissue& tissue = tissues_[index];
    const TissueStep step(tissue.shape, tissue.motion, tool_, now, memory.pose());
    Touch tip = step.follow_tip(index, memory.find(index, false));
    take_and_count(tip, step.moved_m());
    // in punctured tissue the shaft is in the hole
    if (tip.is_punctured || !(tool_.shaft_length_m > 0.0)) return;
    Touch shaft;
    ShaftSearch search;
    Vector3 moved_m = Vector3::Zero();
    if (step.follow_shaft(index, memory.find(index, true), reach_m_, search, shaft, moved_m)) {
      take_and_count(shaft, moved_m);
    }
  });
  counts.tissues_skipped =
      static_cast<std::uint32_t>(tissues_.size() - elastic_) - counts.tissues_visited;
  return counts;
}

// --- the force ----------------------------------------------------------------------------------

/// Under the shaft tissue counts as fully relaxed.
double Scene::relaxed_m(const Touch& touch, const TissueMemory& memory) const noexcept {
  if (touch.is_shaft) return touch.penetration_m();
  return memory.relaxation().relaxed_m(tissues_[touch.tissue].relaxing);
}

/// Adds a settled touch to the sum, if it touches or is within reach.
void Scene::add(const Touch& touch, const TissueMemory& memory,
                const ToolVelocity& tool_velocity_world, double time_s,
                SceneForce& sum) const noexcept {
  const double penetration_m = touch.penetration_m();
  if (!touch.is_punctured && !(penetration_m > 0.0) && !(penetration_m > -reach_m_)) return;
  const Tissue& tissue = tissues_[touch.tissue];
  const Contact contact = acting_contact(touch, tissue.material, relaxed_m(touch, memory),
                                         tissue.motion, tool_velocity_world, time_s);
  add_contact(contact, sum);
}

SceneForce Scene::step(TissueMemory& memory, const Vector3& tip_position_world_m,
                       const ToolVelocity& tool_velocity_world, double time_s,
                       const Vector3& shaft_to_handle) const noexcept {
  const ToolPose now{tip_position_world_m, shaft_to_handle, time_s};
  SceneForce sum;
  memory.begin_step(now);
  SceneCounts counts = visit_touches(now, memory, [&](Touch& touch, const Vector3& moved_m) {
    const Tissue& tissue = tissues_[touch.tissue];
    if (!touch.is_shaft && tissue.relaxing != kNone) {
      memory.press(tissue.relaxing, touch.is_punctured ? 0.0 : touch.penetration_m());
    }
    settle(touch, moved_m, tissue.material, relaxed_m(touch, memory));
    // a touch without room acts in this step only
    if (!memory.keep(touch)) add(touch, memory, tool_velocity_world, time_s, sum);
  });
  memory.end_step();
  counts.tissues_asleep =
      static_cast<std::uint32_t>(relaxation_times_s_.size() - memory.relaxation().awake_count());
  memory.set_counts(counts);

  static_cast<SceneCounts&>(sum) = counts;
  for (const Touch& touch : memory.touches()) {
    add(touch, memory, tool_velocity_world, time_s, sum);
  }
  clear_unless_finite(sum);
  return sum;
}

SceneForce Scene::evaluate(const Vector3& tip_position_world_m,
                           const ToolVelocity& tool_velocity_world, double time_s,
                           const TissueMemory& memory,
                           const Vector3& shaft_to_handle) const noexcept {
  const ToolPose now{tip_position_world_m, shaft_to_handle, time_s};
  SceneForce sum;
  SceneCounts& counts = sum;
  if (memory.is_complete_at(now)) {
    counts = memory.counts();
    for (const Touch& touch : memory.touches()) {
      add(touch, memory, tool_velocity_world, time_s, sum);
    }
  } else {
    counts = visit_touches(now, memory, [&](Touch& touch, const Vector3& moved_m) {
      settle(touch, moved_m, tissues_[touch.tissue].material, relaxed_m(touch, memory));
      add(touch, memory, tool_velocity_world, time_s, sum);
    });
    counts.tissues_asleep =
        static_cast<std::uint32_t>(relaxation_times_s_.size() - memory.relaxation().awake_count());
  }
  clear_unless_finite(sum);
  return sum;
}

}  // namespace palpate::physics
