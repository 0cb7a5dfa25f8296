#include "physics_node/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <variant>

#include "common/contact/contact_model.h"
#include "physics_node/surfaces/geometry.h"
#include "physics_node/contact/material.h"
#include "physics_node/scene/tissue_motion.h"

namespace palpate::physics {
namespace {

// Tissues near the tool that can be followed; more are felt, but as if never touched before.
constexpr std::size_t kMostTouches = 128;
// Tissue that has come back so far is at rest [m].
constexpr double kRelaxed_m = 1e-12;
// Punctured tissue drags at least as if so deep [m].
constexpr double kLeastPuncture_m = 1e-3;

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

// Force and stiffness of a spring that holds the tip where it is stuck, whatever the direction.
Contact drag(const KelvinVoigtMaterial& material, const SurfaceView& surface, double depth_m,
             const Vector3& stretch_m) noexcept {
  const double k = material.friction_stiffness_newton_per_m;
  Contact contact;
  contact.penetration_m = std::max(depth_m, kLeastPuncture_m);
  contact.normal_world = surface.normal;
  contact.elastic_force_on_tool_newton = -k * stretch_m;
  contact.d_force_d_position = -k * Matrix3::Identity();
  contact.stored_energy_joule = 0.5 * k * stretch_m.squaredNorm();
  contact.is_adhesive = true;
  // as far as it holds: beyond the trust radius the force stays as it is
  contact.trust_radius_m = kMinTrustRadiusM;
  if (k > 0.0) {
    const double most_m = material.cutting_newton / k - stretch_m.norm();
    contact.trust_radius_m = std::clamp(most_m, kMinTrustRadiusM, kMaxTrustRadiusM);
  }
  return contact;
}

}  // namespace

const TissueMemory::Touch* TissueMemory::find(std::uint32_t tissue, bool is_shaft) const noexcept {
  for (const Touch& touch : touches_) {
    if (touch.tissue == tissue && touch.is_shaft == is_shaft) return &touch;
  }
  return nullptr;
}

Scene::Scene(const SceneConfig& config, double reach_m)
    : tip_radius_m_(config.tip_radius_m),
      shaft_length_m_(config.shaft_length_m),
      shaft_radius_m_(config.shaft_radius_m),
      reach_m_(reach_m) {
  std::vector<BroadPhase::Item> items;
  std::set<const Surface*> surfaces;
  for (const TissueConfig& tissue : config.tissues) {
    const auto index = static_cast<std::uint32_t>(tissues_.size());
    const bool is_relaxing = law_of(tissue.material).relaxing_stiffness_newton_per_m > 0.0;
    tissues_.push_back({.shape = to_shape(tissue.geometry),
                        .material = tissue.material,
                        .motion = tissue.motion,
                        .relaxing = is_relaxing ? relaxing_.size() : kNone});
    if (is_relaxing) relaxing_.push_back(index);
    const Shape& shape = tissues_.back().shape;
    const auto* const placed = std::get_if<PlacedSurface>(&shape);
    if (placed != nullptr && !surfaces.insert(placed->surface.get()).second) ++shared_surfaces_;
    const std::optional<Bounds> bounds = bounds_of(shape);
    if (!bounds) {
      unbounded_.push_back(index);
      continue;
    }
    Vector3 margin_m =
        Vector3::Constant(std::max(clearance_m(tip_radius_m_) + reach_m_,
                                   shaft_length_m_ > 0.0 ? clearance_m(shaft_radius_m_) : 0.0));
    if (is_moving(tissue.motion)) margin_m += tissue.motion.amplitude_m.cwiseAbs();
    items.push_back({{bounds->lowest_m - margin_m, bounds->highest_m + margin_m}, index});
  }
  bounded_ = BroadPhase(std::move(items));
}

TissueMemory Scene::new_memory() const {
  TissueMemory memory;
  const std::size_t most = std::min(2 * tissues_.size(), kMostTouches);
  memory.touches_.reserve(most);
  memory.next_.reserve(most);
  memory.relaxing_.resize(relaxing_.size());
  memory.awake_.reserve(relaxing_.size());
  return memory;
}

// --- which tissues, and what they see of the tool -----------------------------------------------

/// Calls visit(tissue) once for each that the tool may have come near to since the memory's pose,
/// or that holds it. Returns how many.
template <class Visit>
std::uint32_t Scene::visit_near(const Pose& now, const TissueMemory& memory,
                                const Visit& visit) const noexcept {
  std::uint32_t visited = 0;
  const auto has_hold = [](const Touch& touch) {
    return touch.proxy.is_held() || touch.is_punctured;
  };
  const auto is_first = [&](const Touch& touch) {
    return std::none_of(memory.touches_.data(), &touch, [&](const Touch& other) {
      return other.tissue == touch.tissue && has_hold(other);
    });
  };
  for (const Touch& touch : memory.touches_) {
    if (!has_hold(touch) || !is_first(touch)) continue;
    ++visited;
    visit(touch.tissue);
  }
  const auto visit_other = [&](std::uint32_t index) {
    for (const Touch& touch : memory.touches_) {
      if (touch.tissue == index && has_hold(touch)) return;
    }
    ++visited;
    visit(index);
  };
  for (const std::uint32_t index : unbounded_) visit_other(index);

  Bounds swept{now.tip_m, now.tip_m};
  const auto sweep = [&](const Vector3& place_m) {
    swept.lowest_m = swept.lowest_m.cwiseMin(place_m);
    swept.highest_m = swept.highest_m.cwiseMax(place_m);
  };
  if (shaft_length_m_ > 0.0) sweep(now.tip_m + shaft_length_m_ * now.shaft);
  if (memory.has_pose_ && (now.tip_m - memory.pose_.tip_m).norm() <= kLongestMotion_m) {
    sweep(memory.pose_.tip_m);
    if (shaft_length_m_ > 0.0) sweep(memory.pose_.tip_m + shaft_length_m_ * memory.pose_.shaft);
  }
  bounded_.visit_near(swept, visit_other);
  return visited;
}

/// Where along the shaft it is nearest to the surface, m from the tip; below 0 if it is nowhere
/// nearer than `limit_m`. First in steps that the distance allows, then by the slope.
/// @param side  of a sheet; 0: either
double Scene::nearest_along(const Shape& shape, const Vector3& tip_m, const Vector3& shaft,
                            double side, double limit_m, SurfaceHint& hint) const noexcept {
  constexpr double kCoarseSteps = 16.0;
  constexpr int kFineSteps = 12;
  constexpr double kLevel = 1e-6;
  const double first_m = std::min(tip_radius_m_ + tip_radius_m_, shaft_length_m_);
  const double step_m = (shaft_length_m_ - first_m) / kCoarseSteps;
  const auto look = [&](double along_m) {
    SurfaceView seen = view(shape, tip_m + along_m * shaft, hint);
    if (side < 0.0 || (side == 0.0 && seen.distance_m < 0.0)) {
      seen.distance_m = -seen.distance_m;
      seen.normal = -seen.normal;
      seen.curvature_per_m = -seen.curvature_per_m;
    }
    return seen;
  };

  double best_m = first_m;
  SurfaceView best = look(first_m);
  double distance_m = best.distance_m;
  for (double along_m = first_m; along_m < shaft_length_m_;) {
    const double skip_m = std::max(step_m, distance_m - std::min(best.distance_m, limit_m));
    along_m = std::min(shaft_length_m_, along_m + skip_m);
    if (!(step_m > 0.0) || !std::isfinite(along_m)) break;
    const SurfaceView seen = look(along_m);
    distance_m = seen.distance_m;
    if (seen.distance_m < best.distance_m) {
      best = seen;
      best_m = along_m;
    }
  }
  if (!(best.distance_m < limit_m + step_m)) return -1.0;

  double low_m = std::max(first_m, best_m - step_m);
  double high_m = std::min(shaft_length_m_, best_m + step_m);
  for (int i = 0; i < kFineSteps; ++i) {
    const double slope = best.normal.dot(shaft);
    double& end_m = slope > 0.0 ? low_m : high_m;  // downhill
    if (std::abs(slope) < kLevel || end_m == best_m) break;
    const double bend = shaft.dot(best.curvature_per_m * shaft);
    const double newton_m = bend > 0.0 ? best_m - slope / bend : end_m;
    const bool is_within = low_m < newton_m && newton_m < high_m;
    const double next_m = is_within ? newton_m : 0.5 * (best_m + end_m);
    const SurfaceView seen = look(next_m);
    if (seen.distance_m < best.distance_m) {
      (slope > 0.0 ? high_m : low_m) = best_m;
      best = seen;
      best_m = next_m;
    } else {
      end_m = next_m;
    }
  }
  return best.distance_m < limit_m ? best_m : -1.0;
}

/// Calls take(touch, moved) for the tip, and for the shaft where it is near: the touch as it is
/// now, but for what settle() does, and how far its sphere has moved past the tissue.
template <class Take>
void Scene::follow(std::uint32_t index, const Pose& now, const TissueMemory& memory,
                   const Take& take) const noexcept {
  const Tissue& tissue = tissues_[index];
  const Shape& shape = tissue.shape;
  const Pose& last = memory.has_pose_ ? memory.pose_ : now;
  const double dt_s = std::max(0.0, now.time_s - last.time_s);
  const Vector3 tip_m = now.tip_m - displacement(tissue.motion, now.time_s).position_m;
  const Vector3 last_tip_m = last.tip_m - displacement(tissue.motion, last.time_s).position_m;
  const Vector3 moved_m = tip_m - last_tip_m;

  const auto start = [&](bool is_shaft) {
    const Touch* const known = memory.find(index, is_shaft);
    Touch touch = known != nullptr ? *known : Touch{.tissue = index, .is_shaft = is_shaft};
    touch.proxy.hint.octree_cells_visited = 0;
    touch.proxy.hint.last_cell_hits = 0;
    return std::pair(touch, known != nullptr);
  };
  auto [tip, is_known] = start(false);
  if (tip.is_punctured) {
    tip.proxy.point_m = tip.proxy.place_m = tip_m;
    tip.proxy.surface = view(shape, tip_m, tip.proxy.hint);
    const auto* const placed = std::get_if<PlacedSurface>(&shape);
    const bool is_sheet = placed != nullptr && placed->surface->is_sheet();
    const double distance_m =
        is_sheet ? std::abs(tip.proxy.surface.distance_m) : tip.proxy.surface.distance_m;
    const bool is_inside = distance_m <= clearance_m(tip_radius_m_) ||
                           (shaft_length_m_ > 0.0 &&
                            nearest_along(shape, tip_m, now.shaft, is_sheet ? 0.0 : 1.0,
                                          clearance_m(shaft_radius_m_), tip.proxy.hint) >= 0.0);
    if (!is_inside) {
      tip = {.tissue = index, .proxy = begun_at(shape, tip_radius_m_, tip_m, tip.proxy.hint)};
    }
    take(tip, moved_m);
    if (is_inside) return;  // the shaft is in the hole
  } else {
    if (!memory.has_pose_) {
      tip.proxy = begun_at(shape, tip_radius_m_, tip_m, tip.proxy.hint);
    } else {
      if (!is_known) tip.proxy = free_at(shape, last_tip_m, tip.proxy.hint);
      move(shape, tip_radius_m_, tip_m, dt_s, tip.proxy);
    }
    take(tip, moved_m);
    if (tip.is_punctured) return;
  }
  if (!(shaft_length_m_ > 0.0)) return;

  // the shaft, where it would be deepest were it held as it was
  auto [shaft, is_shaft_known] = start(true);
  const Vector3 held_m = shaft.proxy.place_m - shaft.proxy.point_m;
  const double travel_m =
      std::max(moved_m.norm(), (moved_m + shaft_length_m_ * (now.shaft - last.shaft)).norm());
  const auto* const placed = std::get_if<PlacedSurface>(&shape);
  const bool is_new_sheet = !is_shaft_known && placed != nullptr && placed->surface->is_sheet();
  const double along_m =
      nearest_along(shape, tip_m + held_m, now.shaft, is_new_sheet ? 0.0 : shaft.proxy.side,
                    clearance_m(shaft_radius_m_) + travel_m, shaft.proxy.hint);
  if (along_m < 0.0) return;
  const Vector3 point_m = tip_m + along_m * now.shaft;
  const Vector3 last_point_m = last_tip_m + along_m * last.shaft;
  if (!memory.has_pose_) {
    shaft.proxy = begun_at(shape, shaft_radius_m_, point_m, shaft.proxy.hint);
  } else {
    if (!is_shaft_known) shaft.proxy = free_at(shape, last_point_m, shaft.proxy.hint);
    shaft.proxy.point_m = last_point_m;
    shaft.proxy.place_m = last_point_m + held_m;
    move(shape, shaft_radius_m_, point_m, dt_s, shaft.proxy);
  }
  // seen along the shaft, which may slide, the surface does not bend
  const double bend = now.shaft.dot(shaft.proxy.surface.curvature_per_m * now.shaft);
  if (bend > 0.0 && along_m < shaft_length_m_) {
    const Vector3 bent = shaft.proxy.surface.curvature_per_m * now.shaft;
    shaft.proxy.surface.curvature_per_m -= bent * bent.transpose() / bend;
  }
  take(shaft, point_m - last_point_m);
}

// --- what they remember -------------------------------------------------------------------------

double Scene::relaxed_m(const Touch& touch, const TissueMemory& memory) const noexcept {
  if (touch.is_shaft) return radius_m(touch) - touch.proxy.surface.distance_m;  // as if relaxed
  const std::size_t relaxing = tissues_[touch.tissue].relaxing;
  return relaxing < memory.relaxing_.size() ? memory.relaxing_[relaxing].relaxed_m : 0.0;
}

void Scene::relax(TissueMemory& memory, std::size_t relaxing, double depth_m,
                  double time_s) const noexcept {
  TissueMemory::Relaxing& here = memory.relaxing_[relaxing];
  const double dt_s = memory.has_pose_ ? std::max(0.0, time_s - memory.pose_.time_s) : 0.0;
  const double now_m = depth_m > 0.0 && std::isfinite(depth_m) ? depth_m : 0.0;
  here.advanced_s = time_s;
  const double before_m = here.penetration_m;
  if (before_m == 0.0 && now_m == 0.0 && here.relaxed_m == 0.0) return;
  if (std::find(memory.awake_.begin(), memory.awake_.end(), relaxing) == memory.awake_.end()) {
    memory.awake_.push_back(static_cast<std::uint32_t>(relaxing));
  }

  // τ ż = p − z for p that goes from one depth to the next at an even rate: exact
  here.penetration_m = now_m;
  if (!(dt_s > 0.0)) return;
  const double tau_s = law_of(tissues_[relaxing_[relaxing]].material).relaxation_time_s;
  const double lag_m = (now_m - before_m) / dt_s * tau_s;
  here.relaxed_m = now_m - lag_m + (here.relaxed_m - before_m + lag_m) * std::exp(-dt_s / tau_s);
}

void Scene::settle(Touch& touch, const Vector3& moved_m,
                   const TissueMemory& memory) const noexcept {
  const KelvinVoigtMaterial& material = law_of(tissues_[touch.tissue].material);
  if (touch.is_punctured) {
    touch.stretch_m =
        friction_stretch(touch.stretch_m + moved_m, 1.0, material.friction_stiffness_newton_per_m,
                         material.cutting_newton);
    return;
  }
  const double penetration_m = radius_m(touch) - touch.proxy.surface.distance_m;
  const bool is_touching = penetration_m > 0.0 && std::isfinite(penetration_m);
  const bool may_puncture = material.puncture_newton > 0.0 && !touch.is_shaft;
  if (!is_touching || !(material.friction_coefficient > 0.0 || may_puncture)) {
    touch.is_rubbed = false;
    touch.stretch_m.setZero();
    return;
  }
  const Contact contact = describe(material, touch.proxy.surface, penetration_m,
                                   relaxed_m(touch, memory), touch.proxy.point_m);
  const Vector3& n = contact.normal_world;
  const double normal_newton = n.dot(contact.elastic_force_on_tool_newton);
  if (may_puncture && normal_newton > material.puncture_newton) {
    touch.is_punctured = true;
    touch.is_rubbed = false;
    touch.stretch_m.setZero();
    touch.proxy.place_m = touch.proxy.point_m;
    return;
  }
  Vector3 stretch_m = Vector3::Zero();
  if (touch.is_rubbed) {
    stretch_m = touch.stretch_m + moved_m;
    stretch_m -= n.dot(stretch_m) * n;
  }
  touch.is_rubbed = true;
  touch.stretch_m = friction_stretch(stretch_m, material.friction_coefficient,
                                     material.friction_stiffness_newton_per_m, normal_newton);
}

void Scene::remember(TissueMemory& memory, const Vector3& tip_position_world_m, double time_s,
                     const Vector3& shaft_to_handle) const noexcept {
  const Pose now{tip_position_world_m, shaft_to_handle, time_s};
  SceneCounts counts;
  bool has_all = true;
  memory.next_.clear();
  const auto take = [&](Touch& touch, const Vector3& moved_m) {
    counts.octree_cells_visited += touch.proxy.hint.octree_cells_visited;
    counts.octree_last_cell_hits += touch.proxy.hint.last_cell_hits;
    const std::size_t relaxing = tissues_[touch.tissue].relaxing;
    if (!touch.is_shaft && relaxing != kNone) {
      const double depth_m =
          touch.is_punctured ? 0.0 : tip_radius_m_ - touch.proxy.surface.distance_m;
      relax(memory, relaxing, depth_m, time_s);
    }
    settle(touch, moved_m, memory);
    has_all = has_all && memory.next_.size() < memory.next_.capacity();
    if (has_all) memory.next_.push_back(touch);
  };
  counts.tissues_visited =
      visit_near(now, memory, [&](std::uint32_t index) { follow(index, now, memory, take); });
  counts.tissues_skipped = static_cast<std::uint32_t>(tissues_.size()) - counts.tissues_visited;

  // tissue that still comes back; what has come back sleeps
  for (const std::uint32_t relaxing : memory.awake_) {
    TissueMemory::Relaxing& here = memory.relaxing_[relaxing];
    if (here.advanced_s != time_s) relax(memory, relaxing, 0.0, time_s);
    if (here.penetration_m == 0.0 && std::abs(here.relaxed_m) < kRelaxed_m) here.relaxed_m = 0.0;
  }
  std::erase_if(memory.awake_, [&](std::uint32_t relaxing) {
    const TissueMemory::Relaxing& here = memory.relaxing_[relaxing];
    return here.penetration_m == 0.0 && here.relaxed_m == 0.0;
  });
  counts.tissues_asleep = static_cast<std::uint32_t>(relaxing_.size() - memory.awake_.size());

  std::swap(memory.touches_, memory.next_);
  memory.pose_ = now;
  memory.has_pose_ = true;
  memory.has_all_ = has_all;
  memory.counts_ = counts;
}

// --- the force --------------------------------------------------------------------------------

Contact Scene::contact_of(const Touch& touch, const TissueMemory& memory) const noexcept {
  const KelvinVoigtMaterial& material = law_of(tissues_[touch.tissue].material);
  const SurfaceView& surface = touch.proxy.surface;
  const double penetration_m = radius_m(touch) - surface.distance_m;
  if (touch.is_punctured) return drag(material, surface, penetration_m, touch.stretch_m);
  Contact contact =
      describe(material, surface, penetration_m, relaxed_m(touch, memory), touch.proxy.point_m);
  if (material.friction_coefficient > 0.0) {
    contact.friction_coefficient = material.friction_coefficient;
    contact.friction_stiffness_newton_per_m = material.friction_stiffness_newton_per_m;
    contact.stretch_m =
        touch.stretch_m - contact.normal_world.dot(touch.stretch_m) * contact.normal_world;
    contact.stored_energy_joule +=
        0.5 * contact.friction_stiffness_newton_per_m * contact.stretch_m.squaredNorm();
  }
  return contact;
}

void Scene::add(const Touch& touch, const TissueMemory& memory,
                const Vector3& tip_velocity_world_m_per_s, double time_s,
                SceneForce& sum) const noexcept {
  const double penetration_m = radius_m(touch) - touch.proxy.surface.distance_m;
  const double reach_m = touch.is_shaft ? 0.0 : reach_m_;
  if (!touch.is_punctured && !(penetration_m > 0.0) && !(penetration_m > -reach_m)) return;
  Contact contact = contact_of(touch, memory);
  contact.tissue = touch.tissue;
  contact.surface_velocity_world_m_per_s =
      displacement(tissues_[touch.tissue].motion, time_s).velocity_m_per_s;
  if (contact.penetration_m > 0.0) {
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
                           const TissueMemory& memory,
                           const Vector3& shaft_to_handle) const noexcept {
  const Pose now{tip_position_world_m, shaft_to_handle, time_s};
  SceneForce sum;
  SceneCounts& counts = sum;
  const Pose& last = memory.pose_;
  if (memory.has_pose_ && memory.has_all_ && last.tip_m == now.tip_m && last.shaft == now.shaft &&
      last.time_s == now.time_s) {
    counts = memory.counts_;
    for (const Touch& touch : memory.touches_) {
      add(touch, memory, tip_velocity_world_m_per_s, time_s, sum);
    }
  } else {
    const auto take = [&](Touch& touch, const Vector3& moved_m) {
      counts.octree_cells_visited += touch.proxy.hint.octree_cells_visited;
      counts.octree_last_cell_hits += touch.proxy.hint.last_cell_hits;
      settle(touch, moved_m, memory);
      add(touch, memory, tip_velocity_world_m_per_s, time_s, sum);
    };
    counts.tissues_visited =
        visit_near(now, memory, [&](std::uint32_t index) { follow(index, now, memory, take); });
    counts.tissues_skipped = static_cast<std::uint32_t>(tissues_.size()) - counts.tissues_visited;
    counts.tissues_asleep = static_cast<std::uint32_t>(relaxing_.size() - memory.awake_.size());
  }
  if (sum.listed_count == 0) return sum;

  const auto is_finite = [](const Contact& contact) {
    return contact.elastic_force_on_tool_newton.allFinite() &&
           contact.d_force_d_position.allFinite() && contact.d_force_d_velocity.allFinite() &&
           std::isfinite(contact.stored_energy_joule) && contact.stretch_m.allFinite();
  };
  if (!sum.force_on_tool_newton.allFinite() || !std::isfinite(sum.stored_energy_joule) ||
      !std::all_of(sum.contacts.begin(), sum.contacts.begin() + sum.listed_count, is_finite)) {
    const SceneCounts seen = counts;
    sum = {};
    counts = seen;
  }
  return sum;
}

}  // namespace palpate::physics
