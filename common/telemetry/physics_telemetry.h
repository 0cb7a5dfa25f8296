// SPDX-License-Identifier: Apache-2.0
// physics_telemetry.h — one record per physics step, and the counters since the start.
#pragma once

#include <cstdint>
#include <limits>

#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/telemetry/loop_counters.h"

namespace palpate {

/// One physics step.
struct PhysicsTick {
  std::uint64_t sequence = 0;
  TimePoint stepped_at{};  ///< clock of physics_node
  std::uint64_t device_sequence = 0;
  Vector3 tool_position_world_m = Vector3::Zero();
  Vector3 force_on_tool_newton = Vector3::Zero();
  double stored_energy_joule = 0.0;
  std::uint32_t contact_count = 0;
  Duration compute_time{};
  double penetration_m = 0.0;           ///< of the deepest contact; 0 without one; NaN: unknown
  double stiffness_newton_per_m = 0.0;  ///< along its normal, −n·∂f/∂x·n; NaN: unknown
};

struct PhysicsCounters {
  LoopCounters loop;
  LinkCounters tool_motion;
  std::uint64_t contact_steps = 0;
  bool is_started_in_contact = false;       ///< the tool was in tissue at the first step
  std::uint64_t tissues_skipped = 0;        ///< by the broad phase, summed over steps
  std::uint64_t tissues_visited = 0;        ///< not skipped, summed over steps
  std::uint64_t octree_cells_visited = 0;   ///< of clouds, summed over steps; 0 without clouds
  std::uint64_t octree_last_cell_hits = 0;  ///< nearest points in the same cell as the previous one
  std::uint64_t tissues_asleep = 0;   ///< viscoelastic, at rest, not advanced; summed over steps
  std::uint64_t surfaces_shared = 0;  ///< tissues that share the file of an earlier tissue
  std::uint64_t interactions_suppressed = 0;  ///< not sent: within physics.interaction_deadband
  std::uint64_t mesh_frames = 0;              ///< computed for viewers; all tools
  std::uint64_t meshes_skipped = 0;           ///< due at 30 Hz, not computed: no subscriber
  std::uint64_t tissue_changes = 0;           ///< applied; all tools
  std::uint64_t tissue_changes_refused = 0;   ///< no such tissue, or it cannot be changed
  // elastic bodies, of all tools but for the steps and the bound at the last one
  std::uint64_t elastic_solves = 0;          ///< full solutions
  std::uint64_t elastic_solves_skipped = 0;  ///< not needed: at rest and untouched
  std::uint64_t elastic_solves_late = 0;     ///< took longer than their period
  /// Had a tip on the wrong side of the surface and were undone, or gave no compliance.
  std::uint64_t elastic_solves_failed = 0;
  /// Of these: contact went on with a state that holds the tip on the right side.
  std::uint64_t elastic_solves_repaired = 0;
  std::uint64_t elastic_steps_skipped = 0;  ///< steps out of reach of an elastic body
  /// Unbalanced force of the last full solution over all its forces.
  double elastic_residual_ratio = 0.0;
  /// Of the condensed model, measured at the last full solution in contact [N]; NaN: unknown.
  double elastic_error_newton = std::numeric_limits<double>::quiet_NaN();
  /// Stated bound of it, at the last step in contact [N]; NaN: unknown.
  double elastic_bound_newton = std::numeric_limits<double>::quiet_NaN();
  std::uint64_t elastic_bound_violations = 0;  ///< measured errors above their bound
  std::uint64_t elastic_bounds_checked = 0;    ///< measured errors for whose place one was stated
  std::uint64_t elastic_contact_steps = 0;     ///< of the tool, on elastic bodies,
  std::uint64_t elastic_unknown_bound_steps = 0;  ///< of these without a bound
  std::uint64_t elastic_tips_appeared = 0;        ///< inside a body; all tools
  std::uint32_t elastic_points_held = 0;          ///< by jaws; all tools
  std::uint64_t elastic_energised_steps = 0;      ///< of the tool, with its electrode on
  std::uint64_t elastic_bodies_remade = 0;        ///< because they had been ablated; all tools
  std::uint64_t elastic_elements_removed = 0;     ///< have vanished; all tools,
  std::uint64_t elastic_elements_loose = 0;       ///< of these no longer held by the rest
  std::uint64_t elastic_bodies_refused = 0;       ///< could not be remade; what was there went on
  std::uint64_t elastic_bodies_restored = 0;      ///< made whole again at a viewer's request
  std::uint64_t elastic_attachments_torn = 0;     ///< nodes torn off what they were attached to
  double elastic_torn_joule = 0.0;                ///< what tearing has taken
  std::uint64_t elastic_faces_cut = 0;            ///< between elements, that blades have separated
  double elastic_cut_joule = 0.0;                 ///< toughness × area that blades have swept
  Duration worst_compute_time{};
};

}  // namespace palpate
