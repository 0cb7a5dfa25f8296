// mofc_node.h — stands between the device and the simulation, on the device's side.
//
//   in   hop 1  DeviceState   device  → mofc     every device tick
//   out  hop 4  ForceCommand  mofc    → device   the answer to it, in the same tick
//   out  hop 2  ToolMotion    mofc    → physics  once per DeviceState, after the answer; with
//                                                `motion_deadband` only when the tool moves on
//   in   hop 3  Interaction   physics → mofc     every physics step; the newest counts
//   out  hop 5  MofcTick      mofc    → viewers  once per DeviceState
//
// Between two Interactions: their local contact model is evaluated at the device's rate with the
//   newest position and velocity (`interaction: local`), or their force is held (`held`).
// Before the first Interaction that answers this device's session: asks for no force.
// Nothing that answers a newer motion for `stale_after` (which is longer than the silence that the
//   deadbands of hops 2 and 3 keep, so physics that is frozen is told from a hand that rests): from
//   then on |F| never rises above what it was and fades to zero over `fade`; then
//   MofcState::kNoPhysics. When the physics speaks again, |F| rises from where it is over `fade`.
// New device session, a gap in the DeviceStates, or an echo that does not continue the one before:
//   ledger 0. New physics session: its first Interaction replaces the model as any next one does,
//   without a jump; the ledger stays.
// `wait_for_physics` > 0: answers from the Interaction that answers this very DeviceState; if that
//   does not come in time the force is at most f_co, which friction absorbs.
// Thread: everything runs on the caller's thread; no allocation, lock, log or throw.
#pragma once

#include <memory>

#include "common/core/clock.h"
#include "common/core/inbox.h"
#include "common/core/messages.h"
#include "common/telemetry/metrics.h"
#include "common/session/device_config.h"
#include "common/session/mofc_config.h"
#include "common/telemetry/mofc_telemetry.h"
#include "mofc_node/controllers/force_controller.h"
#include "mofc_node/model_handover.h"
#include "mofc_node/velocity_estimator.h"

namespace palpate::mofc {

/// The controller that the session asks for, with the device's profile.
[[nodiscard]] std::unique_ptr<controllers::ForceController> make_controller(
    const MofcConfig& mofc, const DeviceConfig& device);

class MofcNode {
 public:
  /// @param session_id  random per process start, ≠ 0
  MofcNode(const MofcConfig& mofc, const DeviceConfig& device, const Clock& clock,
           Sender<ToolMotion>& motion_out, Inbox<Interaction>& interaction_in,
           TickSink<MofcTick>& ticks, std::uint64_t session_id);

  /// The answer to one DeviceState; send it at once, then call finish_turn().
  [[nodiscard]] ForceCommand answer(const Received<DeviceState>& state) noexcept;

  /// What may wait until the device has its answer: relays the motion, leaves the record.
  void finish_turn() noexcept;

  /// Link counters of `interaction` are filled in; those of `device_state` are the caller's.
  [[nodiscard]] MofcCounters counters() const noexcept;

 private:
  void begin_device_session() noexcept;
  [[nodiscard]] bool continues_echo(const DeviceState& state) const noexcept;
  void note_echo(const DeviceState& state) noexcept;
  void relay(const DeviceState& state) noexcept;
  void send_motion() noexcept;
  [[nodiscard]] const Interaction* physics_answer(const DeviceState& state, TimePoint now) noexcept;
  [[nodiscard]] ModelForce tissue_force(const DeviceState& state,
                                        const Interaction* interaction) noexcept;
  [[nodiscard]] controllers::ControlOutput control(const DeviceState& state, bool has_gap,
                                                   const Interaction* interaction,
                                                   const Vector3& asked_newton,
                                                   double stored_joule) noexcept;
  [[nodiscard]] Vector3 recovering(const Vector3& force_newton, TimePoint now) noexcept;
  [[nodiscard]] Vector3 faded(const Vector3& force_newton, TimePoint now) noexcept;

  MofcConfig config_;
  DeviceConfig device_;
  const Clock& clock_;
  Sender<ToolMotion>& motion_out_;
  Inbox<Interaction>& interaction_in_;
  TickSink<MofcTick>& ticks_;
  std::uint64_t session_id_;
  std::unique_ptr<controllers::ForceController> controller_;
  std::unique_ptr<VelocityEstimator> velocity_;
  ModelHandover handover_;

  ForceCommand command_;
  ToolMotion motion_;
  bool is_motion_sent_ = false;
  ToolMotion sent_motion_;  // the last that the link took
  bool has_sent_motion_ = false;
  std::uint64_t next_motion_sequence_ = 0;
  MofcTick tick_;
  bool has_turn_ = false;

  TimePoint echo_until_{};  // the reading up to which the device has told what acted

  // staleness of hop 3
  TimePoint interaction_received_at_{};
  std::uint64_t used_interaction_ = ~std::uint64_t{0};  // sequence of the one last asked for
  std::uint64_t answered_sequence_ = 0;  // DeviceState that the newest Interaction answers
  bool has_interaction_ = false;
  bool is_stale_ = false;
  bool is_late_ = false;  // the physics of this very tick did not come in time
  double newton_when_declared_stale_ = 0.0;
  bool is_recovering_ = false;
  TimePoint recovering_since_{};
  double newton_when_recovering_ = 0.0;
  double commanded_newton_ = 0.0;  // |F| of the last answer

  // the running transparency: what the device says it applied against what was asked
  Vector3 asked_before_newton_ = Vector3::Zero();
  bool has_asked_before_ = false;
  ProjectedTransparency transparency_;

  MofcCounters counters_;
};

}  // namespace palpate::mofc
