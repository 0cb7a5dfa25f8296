#include "deploy/lockstep/ideal.h"

#include <algorithm>

#include "common/core/random.h"

namespace palpate {

Ideal::Ideal(const Session& session)
    : scene_(session.scene),
      device_(session.device),
      peak_force_newton_(
          std::min(session.device.peak_force_newton, session.simulated.peak_force_newton)),
      memory_(scene_.new_memory()),
      run_map_(session.device.workspace),
      run_memory_(scene_.new_memory()),
      run_(
          session.simulated, session.device.peak_force_newton, session.hand,
          stream_seed(session.seed, "hand"), TimePoint{},
          [this](double time_s, const Vector3& hand_m, const Vector3& hand_m_per_s) {
            return force_on_hand(run_map_.is_clutched(), run_map_.tool_position_world_m(hand_m),
                                 run_map_.tool_velocity_world_m_per_s(hand_m_per_s), time_s,
                                 run_memory_)
                .first;
          },
          [this](double time_s, const Vector3& hand_m) {
            scene_.remember(run_memory_, run_map_.tool_position_world_m(hand_m), time_s);
          }) {}

void Ideal::judge(TickRow& row) {
  const DeviceTick& tick = row.device;
  const double time_s = to_seconds(tick.sampled_at.time_since_epoch());
  scene_.remember(memory_, tick.true_tool_position_world_m, time_s);
  const auto [force, has_contact] =
      force_on_hand(tick.is_clutched, tick.true_tool_position_world_m,
                    tick.true_tool_velocity_world_m_per_s, time_s, memory_);
  row.ideal_force_on_hand_newton = limited_to_norm(force, peak_force_newton_);
  row.is_truly_in_contact = has_contact;
}

IdealState Ideal::advance(const DeviceTick& tick) {
  run_.advance_to(tick.sampled_at);
  run_map_.update(run_.state().hand_position_m, tick.is_clutched);
  return {run_map_.tool_position_world_m(run_.state().hand_position_m),
          run_.force_on_hand_newton()};
}

std::pair<Vector3, bool> Ideal::force_on_hand(bool is_clutched, const Vector3& tool_m,
                                              const Vector3& tool_m_per_s, double time_s,
                                              const physics::TissueMemory& memory) const {
  const physics::SceneForce touch = scene_.evaluate(tool_m, tool_m_per_s, time_s, memory);
  if (is_clutched) return {Vector3::Zero(), touch.contact_count > 0};
  return {device_.workspace.force_ratio * touch.force_on_tool_newton, touch.contact_count > 0};
}

}  // namespace palpate
