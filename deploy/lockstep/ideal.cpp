#include "deploy/lockstep/ideal.h"

#include <algorithm>

#include "common/core/random.h"

namespace palpate {
namespace {

constexpr double kElasticStep_s = 1e-3;

}  // namespace

Ideal::Ideal(const Session& session)
    : scene_(session.scene),
      elastic_(physics::elastic_bodies_of(session.scene), session.scene.tip_radius_m,
               kElasticStep_s),
      run_elastic_(elastic_.bodies(), session.scene.tip_radius_m, kElasticStep_s),
      device_(session.side().device),
      peak_force_newton_(std::min(session.side().device.peak_force_newton,
                                  session.side().simulated.peak_force_newton)),
      memory_(scene_.new_memory()),
      run_map_(session.side().device.workspace),
      run_memory_(scene_.new_memory()),
      run_(
          session.side().simulated, session.side().device.peak_force_newton, session.side().hand,
          stream_seed(session, session.side(), "hand"), TimePoint{},
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

void Ideal::step_run(double time_s, const Vector3& hand_m) {
  const Vector3 tool_m = run_map_.tool_position_world_m(hand_m);
  scene_.step(run_memory_, tool_m, Vector3::Zero(), time_s);
  physics::SceneForce touch;
  run_elastic_.advance(time_s, tool_m, touch);
}

void Ideal::judge(TickRow& row) {
  const DeviceTick& tick = row.device;
  const double time_s = to_seconds(tick.sampled_at.time_since_epoch());
  const Vector3& tool_m = tick.true_tool_position_world_m;
  physics::SceneForce touch =
      scene_.step(memory_, tool_m, tick.true_tool_velocity_world_m_per_s, time_s);
  elastic_.advance(time_s, tool_m, touch);
  row.ideal_force_on_hand_newton = limited_to_norm(
      force_on_hand(tick.is_clutched, touch.force_on_tool_newton), peak_force_newton_);
  row.is_truly_in_contact = touch.contact_count > 0;
}

IdealState Ideal::advance(const DeviceTick& tick) {
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
