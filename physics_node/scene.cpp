#include "physics_node/scene.h"

#include <algorithm>
#include <numbers>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>

#include "common/core/contact_model.h"
#include "physics_node/geometry.h"
#include "physics_node/material.h"

namespace palpate::physics {
namespace {

SurfaceView surface_of(const Shape& shape, const Vector3& point_m, SurfaceHint& hint) noexcept {
  return std::visit(
      [&](const auto& given) {
        if constexpr (std::is_same_v<std::decay_t<decltype(given)>, PlacedSurface>) {
          return view(given, point_m, hint);
        } else {
          return view(given, point_m);
        }
      },
      shape);
}

const KelvinVoigtMaterial& law_of(const Material& material) noexcept {
  return std::get<KelvinVoigtMaterial>(material);
}

// Keeps `contact` if it is among the deepest; of equally deep ones the first tissue comes first, so
// the order does not depend on the tree of the broad phase.
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

}  // namespace

Scene::Scene(const SceneConfig& config, double reach_m)
    : tip_radius_m_(config.tip_radius_m), reach_m_(reach_m) {
  std::vector<BroadPhase::Item> items;
  for (const TissueConfig& tissue : config.tissues) {
    const auto index = static_cast<std::uint32_t>(tissues_.size());
    const bool is_moving =
        tissue.motion.frequency_hz > 0.0 && !tissue.motion.amplitude_m.isZero(0.0);
    const bool is_relaxing = law_of(tissue.material).relaxing_stiffness_newton_per_m > 0.0;
    const bool is_rubbing = law_of(tissue.material).friction_coefficient > 0.0;
    tissues_.push_back({.shape = to_shape(tissue.geometry),
                        .material = tissue.material,
                        .motion = tissue.motion,
                        .is_moving = is_moving,
                        .relaxing = is_relaxing ? relaxing_.size() : kNone,
                        .rubbing = is_rubbing ? rubbing_.size() : kNone});
    if (is_relaxing) relaxing_.push_back(index);
    if (is_rubbing) rubbing_.push_back(index);
    const std::optional<Bounds> bounds = bounds_of(tissues_.back().shape);
    if (!bounds) {
      unbounded_.push_back(index);
      continue;
    }
    Vector3 margin_m = Vector3::Constant(tip_radius_m_ + reach_m_);
    if (is_moving) margin_m += tissue.motion.amplitude_m.cwiseAbs();
    items.push_back({{bounds->lowest_m - margin_m, bounds->highest_m + margin_m}, index});
  }
  bounded_ = BroadPhase(std::move(items));
}

TissueMemory Scene::new_memory() const {
  TissueMemory memory;
  memory.relaxing_.resize(relaxing_.size());
  memory.rubbing_.resize(rubbing_.size());
  return memory;
}

Scene::Displacement Scene::displacement(const Tissue& tissue, double time_s) noexcept {
  if (!tissue.is_moving) return {};
  const double omega = 2.0 * std::numbers::pi * tissue.motion.frequency_hz;
  const double angle = omega * time_s + tissue.motion.phase_rad;
  return {std::sin(angle) * tissue.motion.amplitude_m,
          omega * std::cos(angle) * tissue.motion.amplitude_m};
}

void Scene::remember(TissueMemory& memory, const Vector3& tip_position_world_m,
                     double time_s) const noexcept {
  if (relaxing_.empty() && rubbing_.empty()) return;
  const double dt_s = memory.has_time_ ? std::max(0.0, time_s - memory.time_s_) : 0.0;
  memory.time_s_ = time_s;
  memory.has_time_ = true;
  for (std::size_t i = 0; i < relaxing_.size(); ++i) {
    const Tissue& tissue = tissues_[relaxing_[i]];
    const Vector3 point_m = tip_position_world_m - displacement(tissue, time_s).position_m;
    SurfaceHint none;
    const double depth_m = tip_radius_m_ - surface_of(tissue.shape, point_m, none).distance_m;
    const double now_m = depth_m > 0.0 && std::isfinite(depth_m) ? depth_m : 0.0;

    // τ ż = p − z for p that goes from one depth to the next at an even rate: exact
    TissueMemory::Relaxing& here = memory.relaxing_[i];
    const double before_m = here.penetration_m;
    here.penetration_m = now_m;
    if (!(dt_s > 0.0)) continue;
    const double tau_s = law_of(tissue.material).relaxation_time_s;
    const double lag_m = (now_m - before_m) / dt_s * tau_s;
    here.relaxed_m = now_m - lag_m + (here.relaxed_m - before_m + lag_m) * std::exp(-dt_s / tau_s);
  }
  rub(memory, tip_position_world_m, time_s);
}

double Scene::relaxed_m(const Tissue& tissue, const TissueMemory& memory) const noexcept {
  return tissue.relaxing < memory.relaxing_.size() ? memory.relaxing_[tissue.relaxing].relaxed_m
                                                   : 0.0;
}

void Scene::rub(TissueMemory& memory, const Vector3& tip_position_world_m,
                double time_s) const noexcept {
  for (std::size_t i = 0; i < rubbing_.size(); ++i) {
    const Tissue& tissue = tissues_[rubbing_[i]];
    TissueMemory::Rubbing& here = memory.rubbing_[i];
    const Vector3 point_m = tip_position_world_m - displacement(tissue, time_s).position_m;
    SurfaceHint none;
    const SurfaceView surface = surface_of(tissue.shape, point_m, none);
    const double penetration_m = tip_radius_m_ - surface.distance_m;
    if (!(penetration_m > 0.0) || !std::isfinite(penetration_m)) {
      here = {};
      continue;
    }
    const KelvinVoigtMaterial& material = law_of(tissue.material);
    const Contact contact =
        describe(material, surface, penetration_m, relaxed_m(tissue, memory), point_m);
    const Vector3& n = contact.normal_world;
    Vector3 stretch_m = Vector3::Zero();
    if (here.is_touched) {
      stretch_m = here.stretch_m + point_m - here.point_m;
      stretch_m -= n.dot(stretch_m) * n;
    }
    here = {.point_m = point_m,
            .stretch_m = friction_stretch(stretch_m, material.friction_coefficient,
                                          material.friction_stiffness_newton_per_m,
                                          n.dot(contact.elastic_force_on_tool_newton)),
            .is_touched = true};
  }
}

void Scene::touch(std::uint32_t index, const Vector3& tip_position_world_m,
                  const Vector3& tip_velocity_world_m_per_s, double time_s,
                  const TissueMemory& memory, SceneForce& sum) const noexcept {
  const Tissue& tissue = tissues_[index];
  const Displacement moved = displacement(tissue, time_s);
  const Vector3 point_m = tip_position_world_m - moved.position_m;
  SurfaceHint hint;
  const SurfaceView surface = surface_of(tissue.shape, point_m, hint);
  ++sum.tissues_visited;
  sum.octree_cells_visited += hint.octree_cells_visited;
  const double penetration_m = tip_radius_m_ - surface.distance_m;
  if (!(penetration_m > 0.0) && !(penetration_m > -reach_m_)) return;

  const KelvinVoigtMaterial& material = law_of(tissue.material);
  Contact contact = describe(material, surface, penetration_m, relaxed_m(tissue, memory), point_m);
  if (tissue.rubbing != kNone) {
    contact.friction_coefficient = material.friction_coefficient;
    contact.friction_stiffness_newton_per_m = material.friction_stiffness_newton_per_m;
    if (tissue.rubbing < memory.rubbing_.size()) {
      const Vector3& stretch_m = memory.rubbing_[tissue.rubbing].stretch_m;
      contact.stretch_m = stretch_m - contact.normal_world.dot(stretch_m) * contact.normal_world;
      contact.stored_energy_joule +=
          0.5 * contact.friction_stiffness_newton_per_m * contact.stretch_m.squaredNorm();
    }
  }
  contact.tissue = index;
  contact.surface_velocity_world_m_per_s = moved.velocity_m_per_s;
  if (penetration_m > 0.0) {
    const ModelForce force =
        palpate::evaluate(contact, Vector3::Zero(), tip_velocity_world_m_per_s, 0.0);
    contact.force_on_tool_newton = force.force_on_tool_newton;
    sum.force_on_tool_newton += contact.force_on_tool_newton;
    sum.stored_energy_joule += contact.stored_energy_joule;
    ++sum.contact_count;
  }
  keep_deepest(contact, sum);
}

SceneForce Scene::evaluate(const Vector3& tip_position_world_m,
                           const Vector3& tip_velocity_world_m_per_s, double time_s,
                           const TissueMemory& memory) const noexcept {
  SceneForce sum;
  const auto visit = [&](std::uint32_t index) {
    touch(index, tip_position_world_m, tip_velocity_world_m_per_s, time_s, memory, sum);
  };
  for (const std::uint32_t index : unbounded_) visit(index);
  sum.tissues_skipped = bounded_.visit_near(tip_position_world_m, visit);
  if (sum.listed_count == 0) return sum;

  const auto is_finite = [](const Contact& contact) {
    return contact.elastic_force_on_tool_newton.allFinite() &&
           contact.d_force_d_position.allFinite() && contact.d_force_d_velocity.allFinite() &&
           std::isfinite(contact.stored_energy_joule) && contact.stretch_m.allFinite();
  };
  if (!sum.force_on_tool_newton.allFinite() || !std::isfinite(sum.stored_energy_joule) ||
      !std::all_of(sum.contacts.begin(), sum.contacts.begin() + sum.listed_count, is_finite)) {
    sum = SceneForce{.tissues_skipped = sum.tissues_skipped,
                     .tissues_visited = sum.tissues_visited,
                     .octree_cells_visited = sum.octree_cells_visited};
  }
  return sum;
}

}  // namespace palpate::physics
