#include "deploy/lockstep/ideal.h"

#include <algorithm>

#include "common/core/random.h"

namespace palpate {

Ideal::Ideal(const Session& session, const Side& side)
    : scene_(session.scene),
      device_(side.device),
      peak_force_newton_(std::min(side.device.peak_force_newton, side.simulated.peak_force_newton)),
      memory_(scene_.new_memory()),
      run_map_(side.device.workspace),
      run_memory_(scene_.new_memory()),
      run_(
          side.simulated, side.device.peak_force_newton, side.hand,
          stream_seed(session, side, "hand"), TimePoint{},
          [this](double time_s, const Vector3& hand_m, const Vector3& hand_m_per_s) {
            return force_on_hand(run_map_.is_clutched(),
                                 scene_.evaluate(run_map_.tool_position_world_m(hand_m),
                                                 run_map_.tool_velocity_world_m_per_s(hand_m_per_s),
                                                 time_s, run_memory_));
          },
          [this](double time_s, const Vector3& hand_m) {
            scene_.step(run_memory_, run_map_.tool_position_world_m(hand_m), Vector3::Zero(),
                        time_s);
          }) {}

void Ideal::judge(TickRow& row) {
  const DeviceTick& tick = row.device;
  const double time_s = to_seconds(tick.sampled_at.time_since_epoch());
  const physics::SceneForce touch = scene_.step(memory_, tick.true_tool_position_world_m,
                                                tick.true_tool_velocity_world_m_per_s, time_s);
  row.ideal_force_on_hand_newton =
      limited_to_norm(force_on_hand(tick.is_clutched, touch), peak_force_newton_);
  row.is_truly_in_contact = touch.contact_count > 0;
}

IdealState Ideal::advance(const DeviceTick& tick) {
  run_.advance_to(tick.sampled_at);
  run_map_.update(run_.state().hand_position_m, tick.is_clutched);
  return {run_map_.tool_position_world_m(run_.state().hand_position_m),
          run_.force_on_hand_newton()};
}

Vector3 Ideal::force_on_hand(bool is_clutched, const physics::SceneForce& touch) const {
  if (is_clutched) return Vector3::Zero();
  return device_.workspace.force_ratio * touch.force_on_tool_newton;
}

}  // namespace palpate
