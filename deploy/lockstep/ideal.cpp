// SPDX-License-Identifier: Apache-2.0
#include "deploy/lockstep/ideal.h"

#include <algorithm>

#include "common/core/random.h"
#include "device_node/simulation/wrist_kinematics.h"

namespace palpate {
namespace {

constexpr double kElasticStep_s = 1e-3;
constexpr double kSameInstant_s = 0.5e-9;
/// What tissue remembers is brought up to date so often, or at every row, as physics does it.
constexpr double kMemoryStep_s = 1e-3 - kSameInstant_s;

Vector3 shaft_of(const Vector3& wrist_rad) {
  if (wrist_rad.isZero(0.0)) return Vector3::UnitZ();  // nearly always there is none
  return device::orientation_of_wrist(wrist_rad) * Vector3::UnitZ();
}

}  // namespace

Ideal::Ideal(const Session& session, const Side& side)
    : scene_(session.scene),
      elastic_(physics::elastic_bodies_of(session.scene), session.scene.tip_radius_m,
               kElasticStep_s, session.scene.holder(), session.scene.electrode),
      run_elastic_(elastic_.bodies(), session.scene.tip_radius_m, kElasticStep_s,
                   session.scene.holder(), session.scene.electrode),
      grip_buttons_(session.scene.gripper ? 1U << session.scene.gripper->button : 0U),
      electrode_buttons_(session.scene.electrode ? 1U << session.scene.electrode->button : 0U),
      device_(side.device),
      peak_force_newton_(std::min(side.device.peak_force_newton, side.simulated.peak_force_newton)),
      memory_(scene_.new_memory()),
      map_(side.device.workspace),
      run_map_(side.device.workspace),
      run_memory_(scene_.new_memory()),
      run_(
          side.simulated, side.device.peak_force_newton, side.hand,
          stream_seed(session, side, "hand"), TimePoint{},
          [this](double time_s, const Vector3& hand_m, const Vector3& hand_m_per_s) {
            const Vector3 tool_m = run_map_.tool_position_world_m(hand_m);
            const Vector3 wrist_rad = run_.wrist_angle_rad();
            const ToolVelocity velocity{
                run_map_.tool_velocity_world_m_per_s(hand_m_per_s),
                device::angular_velocity_of_wrist(wrist_rad, run_.wrist_velocity_rad_per_s())};
            const physics::SceneForce touch =
                scene_.evaluate(tool_m, velocity, time_s, run_memory_, shaft_of(wrist_rad));
            run_newton_m_ =
                torque_on_hand(run_map_.is_clutched(), wrist_rad, touch.torque_on_tool_newton_m);
            return force_on_hand(run_map_.is_clutched(),
                                 touch.force_on_tool_newton + run_elastic_.force_at(tool_m));
          },
          [this](double time_s, const Vector3& hand_m) { step_run(time_s, hand_m); },
          [this] { return run_newton_m_; }) {}

void Ideal::note_buttons(std::uint32_t buttons) {
  is_jaw_closed_ = (buttons & grip_buttons_) != 0;
  is_energised_ = (buttons & electrode_buttons_) != 0;
}

void Ideal::step_run(double time_s, const Vector3& hand_m) {
  const Vector3 tool_m = run_map_.tool_position_world_m(hand_m);
  scene_.step(run_memory_, tool_m, Vector3::Zero(), time_s, shaft_of(run_.wrist_angle_rad()));
  physics::SceneForce touch;
  run_elastic_.advance(time_s, tool_m, touch, is_jaw_closed_, is_energised_);
}

void Ideal::judge(TickRow& row, std::vector<device::InnerStep>& steps) {
  const DeviceTick& tick = row.device;
  const double time_s = to_seconds(tick.sampled_at.time_since_epoch());
  note_buttons(tick.buttons);
  ForceComparison comparison;
  ForceComparison turning;
  bool is_compared = false;
  const auto compare = [&](const device::InnerStep& step, const OnHand& ideal) {
    if (ideal_) {
      comparison.add(step.duration_s, ideal_->newton, ideal.newton, step.force_on_hand_newton);
      turning.add(step.duration_s, ideal_->newton_m / kTorqueArm_m, ideal.newton_m / kTorqueArm_m,
                  step.wrist_torque_newton_m / kTorqueArm_m);
      is_compared = true;
    }
    ideal_ = ideal;
  };

  // the steps until the reading; the last one ends there
  auto step = steps.begin();
  for (; step != steps.end() && step->until_s < time_s - kSameInstant_s; ++step) {
    compare(*step,
            own({.time_s = step->until_s,
                 .tool_m = map_.tool_position_world_m(step->hand_position_m),
                 .tool_m_per_s = map_.tool_velocity_world_m_per_s(step->hand_velocity_m_per_s),
                 .is_clutched = map_.is_clutched(),
                 .wrist_rad = step->wrist_angle_rad,
                 .wrist_rad_per_s = step->wrist_velocity_rad_per_s}));
  }
  const OnHand now =
      own({.time_s = time_s,
           .tool_m = tick.true_tool_position_world_m,
           .tool_m_per_s = tick.true_tool_velocity_world_m_per_s,
           .is_clutched = tick.is_clutched,
           .wrist_rad = device_.wrist ? tick.true_wrist_angle_rad : Vector3::Zero(),
           .wrist_rad_per_s = device_.wrist ? tick.true_wrist_velocity_rad_per_s : Vector3::Zero(),
           .is_row = true});
  row.ideal_force_on_hand_newton = now.newton;
  row.is_truly_in_contact = now.is_in_contact;
  if (step != steps.end() && step->until_s < time_s + kSameInstant_s) {
    compare(*step, now);
    ++step;
  }
  steps.erase(steps.begin(), step);

  ideal_ = now;
  map_.update(tick.measured_hand_position_m, tick.is_clutched);
  if (is_compared) row.to_ideal = comparison;
  if (!device_.wrist) return;
  row.ideal_wrist_torque_newton_m = now.newton_m;
  if (is_compared) row.wrist_to_ideal = turning;
}

Ideal::OnHand Ideal::own(const At& at) {
  const bool is_due = at.is_row || !stepped_s_ || at.time_s > *stepped_s_ + kMemoryStep_s;
  if (is_due) stepped_s_ = at.time_s;
  const Vector3 shaft = shaft_of(at.wrist_rad);
  const ToolVelocity velocity{at.tool_m_per_s,
                              device::angular_velocity_of_wrist(at.wrist_rad, at.wrist_rad_per_s)};
  physics::SceneForce touch = is_due
                                  ? scene_.step(memory_, at.tool_m, velocity, at.time_s, shaft)
                                  : scene_.evaluate(at.tool_m, velocity, at.time_s, memory_, shaft);
  elastic_.advance(at.time_s, at.tool_m, touch, is_jaw_closed_, is_energised_);
  return {.newton = limited_to_norm(force_on_hand(at.is_clutched, touch.force_on_tool_newton),
                                    peak_force_newton_),
          .newton_m = torque_on_hand(at.is_clutched, at.wrist_rad, touch.torque_on_tool_newton_m),
          .is_in_contact = touch.contact_count > 0};
}

IdealState Ideal::advance(const DeviceTick& tick) {
  note_buttons(tick.buttons);
  run_.advance_to(tick.sampled_at);
  run_map_.update(run_.state().hand_position_m, tick.is_clutched);
  return {run_map_.tool_position_world_m(run_.state().hand_position_m),
          run_.force_on_hand_newton()};
}

Vector3 Ideal::force_on_hand(bool is_clutched, const Vector3& force_on_tool) const {
  if (is_clutched) return Vector3::Zero();
  return device_.workspace.force_ratio * force_on_tool;
}

Vector3 Ideal::torque_on_hand(bool is_clutched, const Vector3& wrist_rad,
                              const Vector3& torque_on_tool) const {
  if (is_clutched || !device_.wrist) return Vector3::Zero();
  const double ratio = device_.workspace.force_ratio / device_.workspace.scale_ratio;
  return limited_per_component(
      ratio * device::axes_of_wrist(wrist_rad).transpose() * torque_on_tool,
      Vector3::Constant(device_.wrist->peak_torque_newton_m));
}

}  // namespace palpate
