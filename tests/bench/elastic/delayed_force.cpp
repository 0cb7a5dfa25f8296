// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/elastic/delayed_force.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <utility>

#include "common/core/random.h"
#include "common/link/codec/codec.h"
#include "common/session/mofc_config.h"
#include "common/session/session.h"
#include "mofc_node/tissue/tissue_model.h"
#include "physics_node/scene_engine.h"
#include "tests/bench/elastic/elastic_rows.h"

namespace palpate::bench {
namespace {

constexpr double kDelayedTick_s = 1e-3;
constexpr double kStallEvery_s = 0.5;
constexpr double kVelocitySpan_s = 5e-3;

/// A link: what is sent arrives after the delay or not at all.
template <class Message>
class Line {
 public:
  Line(const Network& network, std::uint64_t seed)
      : delay_s_(network.delay_s), loss_ratio_(network.loss_ratio), random_(seed) {}
  void send(const Message& message, double now_s) {
    if (random_.chance(loss_ratio_)) return;
    sent_.emplace_back(now_s + delay_s_, std::make_unique<Message>(message));
  }
  /// The newest that has arrived; null: none.
  std::unique_ptr<Message> take(double now_s) {
    std::unique_ptr<Message> newest;
    while (!sent_.empty() && sent_.front().first <= now_s + 1e-9) {
      newest = std::move(sent_.front().second);
      sent_.pop_front();
    }
    return newest;
  }

 private:
  double delay_s_;
  double loss_ratio_;
  Random random_;
  std::deque<std::pair<double, std::unique_ptr<Message>>> sent_;
};

}  // namespace

DelayedForces delayed_forces(const SceneConfig& scene, const std::function<Vector3(double)>& tip_m,
                             double seconds, int lead_ticks, const Network& network) {
  PhysicsConfig physics;
  physics.rate_hz = network.physics_hz;
  physics::SceneEngine engine(scene, physics, InteractionUse::kLocal);
  mofc::TissueModel model(true, MofcConfig{}.handover_newton_per_s, 1,
                          from_seconds(kDelayedTick_s));
  Line<ToolMotion> motions(network, network.seed);
  Line<Interaction> interactions(network, network.seed + 1);
  Codec<Interaction> encoder;
  std::unique_ptr<ToolMotion> motion;
  std::unique_ptr<Interaction> newest;
  DelayedForces forces;
  std::uint64_t steps = 0;
  double next_step_s = 0.0;
  double bytes = 0.0;
  const auto tip_at = [&](double path_s) { return tip_m(std::max(0.0, path_s)); };

  for (int tick = -lead_ticks; kDelayedTick_s * tick < seconds; ++tick) {
    const double path_s = kDelayedTick_s * tick;
    const double now_s = 1.0 + kDelayedTick_s * (tick + lead_ticks);
    const Vector3 here_m = tip_at(path_s);
    const Vector3 velocity = (here_m - tip_at(path_s - kVelocitySpan_s)) / kVelocitySpan_s;
    DeviceState state;
    state.header = {.session_id = 1,
                    .sequence = static_cast<std::uint64_t>(tick + lead_ticks),
                    .sampled_at = TimePoint(from_seconds(now_s))};
    const bool is_closed = network.is_closed && network.is_closed(path_s);
    state.buttons = is_closed && scene.gripper ? 1U << scene.gripper->button : 0U;

    // mofc_node
    const double begin_s = cpu_s();
    if (auto arrived = interactions.take(now_s)) {
      newest = std::move(arrived);
      model.receive(*newest, state.header);
    }
    Vector3 newton = Vector3::Zero();
    if (newest) {
      newton = model.step(*newest, state, here_m, velocity, kDelayedTick_s).force_on_tool_newton;
    }
    if (tick >= 0) {
      forces.newton.push_back(newton);
      forces.us.push_back(1e6 * (cpu_s() - begin_s));
      forces.grip.push_back(model.held_tissue().state());
    }
    ToolMotion sent;
    sent.header = {
        .session_id = 2, .sequence = state.header.sequence, .sampled_at = state.header.sampled_at};
    sent.device_session_id = 1;
    sent.device_sequence = state.header.sequence;
    sent.device_sampled_at = state.header.sampled_at;
    sent.tool_position_world_m = here_m;
    sent.tool_velocity_world_m_per_s = velocity;
    sent.receipts = model.receipts();
    sent.elastic_receipts = model.elastic_receipts();
    sent.buttons = state.buttons;
    sent.grip = model.held_tissue().report();
    motions.send(sent, now_s);

    // physics_node
    if (auto arrived = motions.take(now_s)) motion = std::move(arrived);
    const bool is_stalled =
        tick > 0 && std::fmod(path_s + 0.5 * kStallEvery_s, kStallEvery_s) < network.stall_s;
    if (!motion || is_stalled || now_s < next_step_s - 1e-9) continue;
    next_step_s = std::max(next_step_s, now_s - kDelayedTick_s) + 1.0 / network.physics_hz;
    auto answer = std::make_unique<Interaction>();
    answer->header = {
        .session_id = 3, .sequence = steps, .sampled_at = TimePoint(from_seconds(now_s))};
    answer->device_session_id = motion->device_session_id;
    answer->device_sequence = motion->device_sequence;
    answer->device_sampled_at = motion->device_sampled_at;
    answer->tool_position_world_m = motion->tool_position_world_m;
    answer->steps = ++steps;
    engine.step(*motion, true, answer->header.sampled_at, *answer);
    PhysicsCounters counters;
    engine.count_into(counters);
    forces.points_held = std::max(forces.points_held, counters.elastic_points_held);
    if (!network.has_rate) answer->elastic.state.relaxation_s = 0.0;
    if (tick >= 0) bytes += static_cast<double>(encoder.encode(*answer));
    interactions.send(*answer, now_s);
  }
  forces.bytes_per_s = bytes / seconds;
  return forces;
}

}  // namespace palpate::bench
