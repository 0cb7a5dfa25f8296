#include "physics_node/scene.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <variant>

#include "physics_node/geometry.h"
#include "physics_node/material.h"

namespace palpate::physics {
namespace {

// Keeps `contact` if it is among the deepest; of equally deep ones the first tissue comes first, so
// the order does not depend on the tree of the broad phase.
void keep_deepest(const Contact& contact, SceneForce& sum) noexcept {
  const auto is_before = [](const Contact& a, const Contact& b) {
    return a.penetration_m != b.penetration_m ? a.penetration_m > b.penetration_m
                                              : a.tissue < b.tissue;
  };
  std::size_t place = std::min<std::size_t>(sum.contact_count, kMaxContacts);
  ++sum.contact_count;
  for (; place > 0 && is_before(contact, sum.contacts[place - 1]); --place) {
    if (place < kMaxContacts) sum.contacts[place] = sum.contacts[place - 1];
  }
  if (place < kMaxContacts) sum.contacts[place] = contact;
}

}  // namespace

Scene::Scene(const SceneConfig& config) : tip_radius_m_(config.tip_radius_m) {
  std::vector<BroadPhase::Item> items;
  const Vector3 margin_m = Vector3::Constant(tip_radius_m_);
  for (const TissueConfig& tissue : config.tissues) {
    const auto index = static_cast<std::uint32_t>(tissues_.size());
    tissues_.push_back({to_shape(tissue.geometry), tissue.material});
    if (const std::optional<Bounds> bounds = bounds_of(tissues_.back().shape)) {
      items.push_back({{bounds->lowest_m - margin_m, bounds->highest_m + margin_m}, index});
    } else {
      unbounded_.push_back(index);
    }
  }
  bounded_ = BroadPhase(std::move(items));
}

void Scene::touch(std::uint32_t index, const Vector3& tip_position_world_m,
                  const Vector3& tip_velocity_world_m_per_s, SceneForce& sum) const noexcept {
  const Tissue& tissue = tissues_[index];
  const SurfaceView surface = std::visit(
      [&](const auto& shape) { return view(shape, tip_position_world_m); }, tissue.shape);
  const double penetration_m = tip_radius_m_ - surface.distance_m;
  if (!(penetration_m > 0.0)) return;

  const TissueForce tissue_force = std::visit(
      [&](const auto& material) {
        return respond(material, surface, penetration_m, tip_velocity_world_m_per_s);
      },
      tissue.material);
  sum.force_on_tool_newton += tissue_force.force_on_tool_newton;
  sum.d_force_d_position += tissue_force.d_force_d_position;
  sum.d_force_d_velocity += tissue_force.d_force_d_velocity;
  sum.stored_energy_joule += tissue_force.stored_energy_joule;
  keep_deepest({.tissue = index,
                .penetration_m = penetration_m,
                .normal_world = surface.normal,
                .force_on_tool_newton = tissue_force.force_on_tool_newton},
               sum);
}

SceneForce Scene::evaluate(const Vector3& tip_position_world_m,
                           const Vector3& tip_velocity_world_m_per_s) const noexcept {
  SceneForce sum;
  const auto visit = [&](std::uint32_t index) {
    touch(index, tip_position_world_m, tip_velocity_world_m_per_s, sum);
  };
  for (const std::uint32_t index : unbounded_) visit(index);
  sum.tissues_skipped = bounded_.visit_near(tip_position_world_m, visit);
  if (sum.contact_count == 0) return sum;

  const bool is_finite = sum.force_on_tool_newton.allFinite() &&
                         sum.d_force_d_position.allFinite() &&
                         std::isfinite(sum.stored_energy_joule);
  if (!is_finite) {
    const std::uint32_t skipped = sum.tissues_skipped;
    sum = SceneForce{};
    sum.tissues_skipped = skipped;
  }
  return sum;
}

}  // namespace palpate::physics
