// SPDX-License-Identifier: Apache-2.0
// ros_engine.h — a source of forces behind topics of ROS 2 as the tissue of one tool.
//
//   out  PREFIX/servo_cp     PoseStamped    the tool's tip in W: every step
//   in   PREFIX/measured_cf  WrenchStamped  the force on the tool; wrench_gate.h says which count
//
// A step without a force that counts gives no answer: mofc_node continues with what it knows and
// fades when physics stays silent (mofc.stale_after_ms). Where mofc_node uses contact models, they
// are estimated from the forces (foreign/contact_estimator.h), each at the pose that it answers.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <string>

#include <spdlog/logger.h>

#include "common/core/clock.h"
#include "common/telemetry/event_throttle.h"
#include "common/telemetry/metrics.h"
#include "deploy/ros/dds/node.h"
#include "deploy/ros/physics/wrench_gate.h"
#include "physics_node/engine.h"
#include "physics_node/foreign/foreign_engine.h"

namespace palpate::ros {

/// What has come so far.
struct WrenchCounts {
  std::uint64_t poses = 0;           ///< while somebody listens
  std::uint64_t poses_left_out = 0;  ///< reliable subscribers, the server or the source is behind
  std::uint64_t taken = 0;
  std::uint64_t sources = 0;  ///< of these: from another publisher than the one before
  std::array<std::uint64_t, kWrenchRefusals> refused{};  ///< by WrenchRefusal
  DurationHistogram round_trip{};  ///< from a pose to the force that answers it by name, taken
  DurationHistogram transit{};     ///< from its writer to here; of clocks that agree
};

class RosEngine final : public physics::Engine {
 public:
  /// @param node    must outlive it      @param clock  likewise
  /// @param pose_topic   out  @param force_topic  in
  /// @param has_estimate  false: no contact models, mofc_node holds the force
  RosEngine(Node& node, const Clock& clock, const std::string& pose_topic,
            const std::string& force_topic, Offer offer, const WrenchSettings& settings,
            bool has_estimate);

  bool step(const ToolMotion& motion, bool is_new, TimePoint now,
            Interaction& answer) noexcept override;
  void rethrow() override;

  /// By any thread.
  [[nodiscard]] WrenchCounts counts() const;
  /// Tells what is refused, and when the source falls silent or is heard; by one thread.
  void report(TimePoint now, spdlog::logger& log);

 private:
  /// What the estimator sees: an engine that tells only a force.
  class ToldForce final : public sdk::Engine {
   public:
    explicit ToldForce(const Vector3& force_newton) : force_newton_(force_newton) {}
    sdk::Answer step(const sdk::Motion& motion) override;

   private:
    const Vector3& force_newton_;
  };

  void send(const ToolMotion& motion, std::int64_t now_ns);
  [[nodiscard]] bool take(TimePoint now, std::int64_t now_ns);

  const Clock& clock_;
  const std::string force_topic_;
  const std::string world_frame_;
  Writer<PoseStamped> poses_;
  Reader<WrenchStamped> wrenches_;
  WrenchGate gate_;
  TakenForce taken_;
  Vector3 force_newton_ = Vector3::Zero();
  physics::ForeignEngine estimate_;
  ToolMotion answered_;
  std::int64_t last_stamp_ns_ = 0;
  std::int64_t last_pose_ns_ = 0;  // that was sent
  std::exception_ptr error_;

  mutable std::mutex mutex_;  // what the thread of report() reads: these, and what gate_ has taken
  WrenchCounts counts_;

  WrenchCounts reported_;
  std::array<EventThrottle, kWrenchRefusals> throttles_;
  bool was_heard_ = false;
};

}  // namespace palpate::ros
