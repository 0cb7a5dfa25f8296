// SPDX-License-Identifier: Apache-2.0
// side_topics.h — the topics of one side of a running session, by the names of CRTK:
//
//   measured_cp  PoseStamped     tool tip in W
//   measured_cv  TwistStamped    its velocity in W, mean of 10 ms; angular 0
//   measured_cf  WrenchStamped   force on the hand in D, as rendered; torque 0
//   servo_cf     WrenchStamped   force on the hand in D, as the clamp commanded it; torque 0
//   measured_js  JointState      the hand in D as three prismatic joints x, y, z
//   operating_state  OperatingState  DISABLED, ENABLED, FAULT: on a change, and every second
//   ledger_energy_joule, true_energy_joule, clamped_ratio  Float64  (simulated devices only: true)
//
// The newest tick of each batch of telemetry, or every tick. Stamps are wall time.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>

#include "common/core/time.h"
#include "common/telemetry/telemetry.h"
#include "deploy/ros/dds/node.h"
#include "viewer_node/feed/telemetry_mirror.h"

namespace palpate::ros {

inline constexpr const char* kWorldFrame = "world";

struct RosTopicOptions {
  std::string name_space = "palpate";
  Offer offer = Offer::kSensorData;
  bool has_every_tick = false;
};

/// Frames of one side besides that; CRTK has none of its own.
struct RosFrames {
  std::string tool;    ///< "tool" or "SIDE_tool"
  std::string device;  ///< "device_base" or "SIDE_device_base"
};

class SideTopics {
 public:
  SideTopics(Node& node, const RosTopicOptions& options, const std::string& side);

  void take(const DeviceBatch& batch);
  void take(const MofcBatch& batch);
  /// @param mirror  of this side
  void pump(const viewer::TelemetryMirror& mirror, TimePoint now);

  [[nodiscard]] const RosFrames& frames() const { return frames_; }
  /// Of its topics: "palpate/", "palpate/left/".
  [[nodiscard]] const std::string& prefix() const { return prefix_; }
  /// The newest pose, once after each batch.
  struct Pose {
    std::int64_t at_ns = 0;
    Vector3 position_m = Vector3::Zero();
    Quaternion orientation = Quaternion::Identity();
  };
  [[nodiscard]] std::optional<Pose> take_pose() { return std::exchange(pose_, std::nullopt); }
  /// Messages that reliable subscribers were too slow for.
  [[nodiscard]] std::uint64_t left_out() const { return left_out_; }

 private:
  SideTopics(Node& node, const RosTopicOptions& options, const std::string& side,
             const std::string& prefix);

  struct Place {
    TimePoint at{};
    Vector3 position_m = Vector3::Zero();
  };
  /// Device's clock to wall time, from the first batch of its session on.
  [[nodiscard]] std::int64_t wall_ns(std::uint64_t device_session_id, TimePoint sampled_at,
                                     TimePoint newest);
  void write(const DeviceTick& tick, std::int64_t at_ns);
  [[nodiscard]] Vector3 velocity_m_per_s(const DeviceTick& tick);
  void write_state(const viewer::TelemetryMirror& mirror, TimePoint now);
  void count(bool is_sent) { left_out_ += is_sent ? 0 : 1; }

  bool has_every_tick_;
  std::string prefix_;
  RosFrames frames_;
  std::array<std::string, 3> joints_;
  Writer<PoseStamped> pose_out_;
  Writer<TwistStamped> velocity_out_;
  Writer<WrenchStamped> applied_out_;
  Writer<WrenchStamped> commanded_out_;
  Writer<JointState> joints_out_;
  Writer<OperatingState> state_out_;
  Writer<Float64> ledger_energy_out_;
  Writer<Float64> true_energy_out_;
  Writer<Float64> clamped_out_;
  std::uint64_t device_session_id_ = 0;
  std::int64_t offset_ns_ = 0;
  std::deque<Place> places_;
  std::optional<Pose> pose_;
  std::string state_;
  bool was_homed_ = false;
  bool was_busy_ = false;
  TimePoint next_state_{};
  TimePoint next_share_{};
  std::uint64_t left_out_ = 0;
};

}  // namespace palpate::ros
