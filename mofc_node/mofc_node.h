// SPDX-License-Identifier: Apache-2.0
// mofc_node.h — stands between the device and the physics, on the device's side.
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
// Before the first Interaction that answers this device's session: the requested force is zero.
// No Interaction that answers a newer motion for `stale_after`: |F| never exceeds what it was then
//   and fades to zero over `fade`; then MofcState::kNoPhysics. `stale_after` is longer than the
//   silence that the deadbands of hops 2 and 3 allow, so that frozen physics is distinguished from
//   a resting hand. While the force comes from described tissue alone, it stays for
//   `still_after`, or for one period of the motion of tissue that moves, unless the physics sends
//   without having stepped. When the physics speaks again, |F| rises from where it is over `fade`.
// New device session: ledger 0. An echo that does not continue the last one answered: no credit is
//   left. New physics session: its first Interaction replaces the model as any next one does,
//   without a jump; the ledger stays.
// Physics that is gone for longer than its force takes to fade: what it has described is dropped,
//   as is what needs more than a tick can spend (LocalTissues::work_in()); a standby then speaks.
// With `standby_after` there are two physics: both get every motion, both are heard, one is used
//   (PhysicsChoice); the force passes from one to the other as between two contact models.
// `wait_for_physics` > 0: answers from the Interaction that answers this very DeviceState; if that
//   does not come in time the force is at most f_co, which friction absorbs.
// Thread: everything runs on the caller's thread; no allocation, lock, log or throw.
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "common/contact/contact_model.h"
#include "common/core/clock.h"
#include "common/core/inbox.h"
#include "common/core/messages.h"
#include "common/session/clamped_device.h"
#include "common/session/mofc_config.h"
#include "common/telemetry/mofc_telemetry.h"
#include "mofc_node/controllers/force_controller.h"
#include "mofc_node/device_echo.h"
#include "mofc_node/failover/physics_choice.h"
#include "mofc_node/failover/tissue_pair.h"
#include "mofc_node/motion_relay.h"
#include "mofc_node/physics_input.h"
#include "mofc_node/silence_fade.h"
#include "mofc_node/wrench_clamp.h"

namespace palpate::mofc {

/// Hops 2 and 3 of physics.standby.
struct StandbyLinks {
  Sender<ToolMotion>& motion_out;
  Inbox<Interaction>& interaction_in;
};

class MofcNode {
 public:
  /// All references must outlive the node.
  /// @param session_id  random per process start, ≠ 0
  /// @param standby     with mofc.standby_after
  /// @param controller  null: the one that the session selects
  MofcNode(const MofcConfig& mofc, const ClampedDevice& device, const Clock& clock,
           Sender<ToolMotion>& motion_out, Inbox<Interaction>& interaction_in,
           TickSink<MofcTick>& ticks, std::uint64_t session_id,
           std::optional<StandbyLinks> standby = std::nullopt,
           std::unique_ptr<controllers::ForceController> controller = nullptr);

  /// The answer to one DeviceState; send it at once, then call finish_turn().
  [[nodiscard]] ForceCommand answer(const Received<DeviceState>& state) noexcept;

  /// What can wait until the device has its answer: relays the motion, keeps the record.
  void finish_turn() noexcept;

  /// Reads what the physics has sent by now, so that the next answer need not; between two turns.
  void read_ahead() noexcept;

  /// Includes the link counters of `interaction`; those of `device_state` are the caller's.
  [[nodiscard]] MofcCounters counters() const noexcept;

 private:
  /// What the tissue requests, at the tool.
  struct Request {
    ModelForce tissue;
    MofcState state = MofcState::kNoPhysics;
  };

  void begin_device_session() noexcept;
  [[nodiscard]] Wave returned_wave(const Interaction* interaction) const noexcept;
  [[nodiscard]] PhysicsAnswer take_physics(const DeviceState& state, TimePoint now) noexcept;
  [[nodiscard]] Request request(const DeviceState& state, const Interaction* interaction,
                                Duration since_previous) noexcept;
  [[nodiscard]] bool is_fresh(const Interaction* interaction) noexcept;
  [[nodiscard]] ForceCommand make_command(const DeviceState& state, const Vector3& force_newton,
                                          Duration lease, TimePoint now) noexcept;
  void count(const MofcTick& turn, const DeviceEcho::Report& echo, const PhysicsAnswer& physics,
             const controllers::ControlOutput& output, SilenceFade::Phase phase) noexcept;
  void count_grip(GripState grip) noexcept;

  InteractionUse interaction_use_;
  ClampedDevice device_;
  const Clock& clock_;
  TickSink<MofcTick>& ticks_;
  std::uint64_t session_id_;

  DeviceEcho echo_;
  MotionRelay relay_;
  PhysicsInput physics_;
  std::optional<PhysicsInput> standby_;
  PhysicsChoice choice_;
  std::array<const Interaction*, kPhysicsRoles> newest_{};  // of this turn
  TissuePair tissue_;
  std::unique_ptr<controllers::ForceController> controller_;
  std::optional<WrenchClamp> wrench_;  // instead, with a wrist
  Duration still_after_;
  Duration gone_after_;  // of silence: the force has faded
  Duration fade_time_;
  SilenceFade fade_;
  SilenceFade torque_fade_;  // of the wrist

  Duration period_;                     // of the device
  std::optional<TimePoint> disturbed_;  // newest reading that something disturbed
  bool has_lost_press_ = false;  // lost its force or the ledger; until the tool leaves the tissue
  std::optional<Header> newest_state_;
  std::uint64_t next_command_ = 1;
  std::optional<std::uint64_t> used_interaction_;  // sequence of the last one that was evaluated
  GripState grip_ = GripState::kNone;              // of the previous turn
  std::uint64_t wave_stream_ = 0;                  // a new one after every clutch
  std::optional<MofcTick> turn_;                   // its record, until finish_turn()
  MofcCounters counters_;
};

}  // namespace palpate::mofc
