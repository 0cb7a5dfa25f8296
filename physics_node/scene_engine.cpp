// SPDX-License-Identifier: Apache-2.0
#include "physics_node/scene_engine.h"

#include <algorithm>
#include <span>
#include <utility>

namespace palpate::physics {
namespace {

// Of lengths in a contact, on the wire [m].
constexpr double kLongest_m = 1e3;

/// Scales down to components within ±most; rounding may leave one just beyond, so it cuts too.
template <class M>
void reduce(M& m, double most) noexcept {
  const double largest = m.cwiseAbs().maxCoeff();
  if (largest > most) m = (most / largest * m).cwiseMax(-most).cwiseMin(most).eval();
}

/// Reduces what no real tissue has, as of a tool metres deep in stiffening tissue, to the ranges of
/// hop 3, so that mofc_node never refuses the message.
void reduce_to_range(Interaction& interaction) noexcept {
  for (std::size_t i = 0; i < interaction.listed_count; ++i) {
    Contact& contact = interaction.contacts[i];
    reduce(contact.force_on_tool_newton, kMaxTissueForceNewton);
    reduce(contact.elastic_force_on_tool_newton, kMaxTissueForceNewton);
    reduce(contact.curvature_per_m, kMaxCurvaturePerM);
    reduce(contact.stretch_m, kLongest_m);
    reduce(contact.held_m, kLongest_m);
    contact.penetration_m = std::clamp(contact.penetration_m, -kLongest_m, kLongest_m);
    contact.relaxed_m = std::clamp(contact.relaxed_m, -kLongest_m, kLongest_m);
    reduce(contact.d_force_d_position, kMaxSlopeNewtonPerM);
    reduce(contact.d_force_d_velocity, kMaxDampingNewtonSPerM);
    contact.stiffening_newton_per_m2 = std::clamp(
        contact.stiffening_newton_per_m2, -kMaxStiffeningNewtonPerM2, kMaxStiffeningNewtonPerM2);
    // a stiffness map may multiply it
    contact.hunt_crossley_stiffness_newton_per_m =
        std::min(contact.hunt_crossley_stiffness_newton_per_m, kMaxStiffnessNewtonPerM);
    contact.stored_energy_joule = std::min(contact.stored_energy_joule, kMaxStoredEnergyJoule);
    contact.grip.slip_newton = std::min(contact.grip.slip_newton, kMaxTissueForceNewton);
    reduce(contact.arm_m, kLongest_m);
  }
  reduce(interaction.force_on_tool_newton, kMaxTissueForceNewton);
  reduce(interaction.torque_on_tool_newton_m, kMaxTissueForceNewton);
  interaction.stored_energy_joule =
      std::min(interaction.stored_energy_joule, kMaxStoredEnergyJoule);
}

bool is_pressed(const ToolMotion& motion, std::uint32_t button) noexcept {
  return ((motion.buttons >> button) & 1U) != 0;
}

bool is_energised(const ToolMotion& motion, const ElasticTissues* elastic) noexcept {
  return elastic != nullptr && elastic->electrode() &&
         is_pressed(motion, elastic->electrode()->button);
}

JawInput jaw_of(const ToolMotion& motion, std::uint64_t session_id,
                const ElasticTissues* elastic) noexcept {
  if (elastic == nullptr || !elastic->gripper()) return {};
  const GripperConfig& gripper = *elastic->gripper();
  JawInput jaw{.is_closed = !gripper.is_needle() && is_pressed(motion, gripper.button),
               .velocity_m_per_s = motion.tool_velocity_world_m_per_s,
               .is_felt_elsewhere = motion.elastic_receipts.has_value()};
  if (motion.grip && motion.grip->physics_session_id == session_id) jaw.report = motion.grip;
  return jaw;
}

}  // namespace

SceneEngine::SceneEngine(const SceneConfig& scene, const PhysicsConfig& physics, InteractionUse use)
    : SceneEngine(std::make_shared<const Scene>(
                      scene, use == InteractionUse::kLocal ? physics.reach_m : 0.0),
                  physics.rate_hz, use, use == InteractionUse::kLocal ? physics.reach_m : 0.0,
                  ElasticTissues::of(scene, 1, ElasticPace::kVirtual), 0) {}

SceneEngine::SceneEngine(std::shared_ptr<const Scene> scene, double rate_hz, InteractionUse use,
                         double reach_m, std::shared_ptr<ElasticTissues> elastic, std::size_t tool)
    : tool_(std::move(scene), reach_m, std::move(elastic), tool),
      surface_(use == InteractionUse::kLocal ? tool_.scene().descriptions()
                                             : std::span<const DescribedTissue>{},
               rate_hz) {
  counters_.surfaces_shared = tool_.scene().shared_surface_count();
}

bool SceneEngine::step(const ToolMotion& motion, bool /*is_new*/, TimePoint now,
                       Interaction& answer) noexcept {
  const double time_s = to_seconds((now + answer.scene_ahead).time_since_epoch());
  ElasticTissues* const elastic = tool_.elastic();
  if (elastic != nullptr && motion.elastic_receipts) {
    elastic->describe_ahead(tool_.index(), motion.tool_velocity_world_m_per_s,
                            to_seconds(motion.receipts.loop_age));
  }
  const SceneForce force = tool_.step({.position_m = motion.tool_position_world_m,
                                       .velocity = motion.tool_velocity_world(),
                                       .orientation = motion.tool_orientation_world,
                                       .jaw = jaw_of(motion, answer.header.session_id, elastic),
                                       .is_energised = is_energised(motion, elastic)},
                                      time_s);
  answer.force_on_tool_newton = force.force_on_tool_newton;
  answer.torque_on_tool_newton_m = force.torque_on_tool_newton_m;
  answer.stored_energy_joule = force.stored_energy_joule;
  std::copy_n(force.contacts.begin(), force.listed_count, answer.contacts.begin());
  answer.listed_count = force.listed_count;
  answer.contact_count = force.contact_count;
  reduce_to_range(answer);
  surface_.fill(motion, now, answer);
  if (elastic != nullptr) patches_.fill(*elastic, tool_.index(), motion, now, answer);

  counters_.tissues_skipped += force.tissues_skipped;
  counters_.tissues_visited += force.tissues_visited;
  counters_.octree_cells_visited += force.octree_cells_visited;
  counters_.octree_last_cell_hits += force.octree_last_cell_hits;
  counters_.tissues_asleep += force.tissues_asleep;
  return true;
}

void SceneEngine::count_into(PhysicsCounters& counters) const noexcept {
  counters.tissues_skipped = counters_.tissues_skipped;
  counters.tissues_visited = counters_.tissues_visited;
  counters.octree_cells_visited = counters_.octree_cells_visited;
  counters.octree_last_cell_hits = counters_.octree_last_cell_hits;
  counters.tissues_asleep = counters_.tissues_asleep;
  counters.surfaces_shared = counters_.surfaces_shared;
  const ElasticTissues* const elastic = tool_.elastic();
  if (elastic == nullptr) return;
  elastic->count_into(counters);
  elastic->count_tool_into(tool_.index(), counters);
}

}  // namespace palpate::physics
