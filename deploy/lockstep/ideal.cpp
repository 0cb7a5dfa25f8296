// SPDX-License-Identifier: Apache-2.0
#include "deploy/lockstep/ideal.h"

#include <algorithm>

#include "common/core/random.h"

namespace palpate {
namespace {

constexpr double kElasticStep_s = 1e-3;
constexpr double kSameInstant_s = 0.5e-9;
/// What tissue remembers is brought up to date so often, or at every row, as physics does it.
constexpr double kMemoryStep_s = 1e-3 - kSameInstant_s;

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
            return force_on_hand(
                run_map_.is_clutched(),
                scene_.evaluate(tool_m, run_map_.tool_velocity_world_m_per_s(hand_m_per_s), time_s,
                                run_memory_)
                        .force_on_tool_newton +
                    run_elastic_.force_at(tool_m));
          },
          [this](double time_s, const Vector3& hand_m) { step_run(time_s, hand_m); }) {}

void Ideal::note_buttons(std::uint32_t buttons) {
  is_jaw_closed_ = (buttons & grip_buttons_) != 0;
  is_energised_ = (buttons & electrode_buttons_) != 0;
}

void Ideal::step_run(double time_s, const Vector3& hand_m) {
  const Vector3 tool_m = run_map_.tool_position_world_m(hand_m);
  scene_.step(run_memory_, tool_m, Vector3::Zero(), time_s);
  physics::SceneForce touch;
  run_elastic_.advance(time_s, tool_m, touch, is_jaw_closed_, is_energised_);
}

void Ideal::judge(TickRow& row, std::vector<device::InnerStep>& steps) {
  const DeviceTick& tick = row.device;
  const double time_s = to_seconds(tick.sampled_at.time_since_epoch());
  note_buttons(tick.buttons);
  ForceComparison comparison;
  bool is_compared = false;
  bool is_in_contact = false;
  const auto compare = [&](const device::InnerStep& step, const Vector3& ideal_newton) {
    if (ideal_newton_) {
      comparison.add(step.duration_s, *ideal_newton_, ideal_newton, step.force_on_hand_newton);
      is_compared = true;
    }
    ideal_newton_ = ideal_newton;
  };

  // the steps until the reading; the last one ends there
  auto step = steps.begin();
  for (; step != steps.end() && step->until_s < time_s - kSameInstant_s; ++step) {
    compare(*step, own_newton({.time_s = step->until_s,
                               .tool_m = map_.tool_position_world_m(step->hand_position_m),
                               .tool_m_per_s =
                                   map_.tool_velocity_world_m_per_s(step->hand_velocity_m_per_s),
                               .is_clutched = map_.is_clutched()},
                              is_in_contact));
  }
  row.ideal_force_on_hand_newton =
      own_newton({.time_s = time_s,
                  .tool_m = tick.true_tool_position_world_m,
                  .tool_m_per_s = tick.true_tool_velocity_world_m_per_s,
                  .is_clutched = tick.is_clutched,
                  .is_row = true},
                 is_in_contact);
  row.is_truly_in_contact = is_in_contact;
  if (step != steps.end() && step->until_s < time_s + kSameInstant_s) {
    compare(*step, row.ideal_force_on_hand_newton);
    ++step;
  }
  steps.erase(steps.begin(), step);

  ideal_newton_ = row.ideal_force_on_hand_newton;
  map_.update(tick.measured_hand_position_m, tick.is_clutched);
  if (is_compared) row.to_ideal = comparison;
}

Vector3 Ideal::own_newton(const At& at, bool& is_in_contact) {
  const bool is_due = at.is_row || !stepped_s_ || at.time_s > *stepped_s_ + kMemoryStep_s;
  if (is_due) stepped_s_ = at.time_s;
  physics::SceneForce touch = is_due
                                  ? scene_.step(memory_, at.tool_m, at.tool_m_per_s, at.time_s)
                                  : scene_.evaluate(at.tool_m, at.tool_m_per_s, at.time_s, memory_);
  elastic_.advance(at.time_s, at.tool_m, touch, is_jaw_closed_, is_energised_);
  is_in_contact = touch.contact_count > 0;
  return limited_to_norm(force_on_hand(at.is_clutched, touch.force_on_tool_newton),
                         peak_force_newton_);
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

}  // namespace palpate
