// SPDX-License-Identifier: Apache-2.0
// ideal.h — the ideal force and the ideal run that a lockstep run is compared with.
#pragma once

#include <optional>
#include <vector>

#include "common/core/workspace_map.h"
#include "common/session/session.h"
#include "common/telemetry/tick_row.h"
#include "device_node/simulation/ideal_run.h"
#include "device_node/simulation/simulated_device.h"
#include "physics_node/elastic_tissue/elastic_reference.h"
#include "physics_node/scene/scene.h"

namespace palpate {

/// The tissue in continuous time, without sampling and delay: its force on the hand in this run,
/// and the run it would have given (docs/theory.md §7.1). Elastic tissue: full solutions a
/// millisecond apart at the true position, in the run continued between two of them.
class Ideal {
 public:
  Ideal(const Session& session, const Side& side);
  Ideal(const Ideal&) = delete;  // its run refers to it
  Ideal& operator=(const Ideal&) = delete;

  /// Sets the ideal force and the true contact of a row, and what acted since the previous one
  /// against the ideal force at each inner step: the mean of both ends of the step.
  /// @param steps  of the device of this run since its start; those until the reading of the row
  /// are
  ///               taken out. May be empty: without them the row has no comparison
  void judge(TickRow& row, std::vector<device::InnerStep>& steps);
  /// State of the ideal run at the time of this tick.
  [[nodiscard]] IdealState advance(const DeviceTick& tick);

 private:
  struct At {
    double time_s;
    Vector3 tool_m;
    Vector3 tool_m_per_s;
    bool is_clutched;
    Vector3 wrist_rad;  // angles of its joints
    Vector3 wrist_rad_per_s;
    bool is_row = false;
  };
  /// What the tissue does to the hand, limited to the peaks.
  struct OnHand {
    Vector3 newton;
    Vector3 newton_m;  // per joint of the wrist
    bool is_in_contact;
  };
  /// Under the run's own tool.
  [[nodiscard]] OnHand own(const At& at);
  /// 0 while clutched.
  [[nodiscard]] Vector3 force_on_hand(bool is_clutched, const Vector3& force_on_tool) const;
  /// Per joint of a wrist at these angles; 0 while clutched.
  [[nodiscard]] Vector3 torque_on_hand(bool is_clutched, const Vector3& wrist_rad,
                                       const Vector3& torque_on_tool) const;
  void step_run(double time_s, const Vector3& hand_m);
  void note_buttons(std::uint32_t buttons);

  physics::Scene scene_;
  physics::ElasticReference elastic_;      // under the run's own tool
  physics::ElasticReference run_elastic_;  // under that of the ideal run
  std::uint32_t grip_buttons_;             // 0: no gripper
  std::uint32_t electrode_buttons_;        // 0: no electrode
  bool is_jaw_closed_ = false;             // at the newest tick
  bool is_energised_ = false;              // likewise
  DeviceConfig device_;
  double peak_force_newton_;         // the smaller of the session's and the device's own
  physics::TissueMemory memory_;     // of the run's own tool
  WorkspaceMap map_;                 // as of its last row
  std::optional<OnHand> ideal_;      // at the last inner step
  std::optional<double> stepped_s_;  // when the memory was brought up to date
  WorkspaceMap run_map_;
  physics::TissueMemory run_memory_;
  Vector3 run_newton_m_ = Vector3::Zero();  // per joint of its wrist, as of its last force
  device::IdealRun run_;
};

}  // namespace palpate
