// SPDX-License-Identifier: Apache-2.0
// wrong_physics — a physics with one fault, for `palpate conform physics`. Its argument names it.
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <deque>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <utility>

#include "common/core/check.h"
#include "physics_node/display/display.h"
#include "physics_node/engine.h"
#include "physics_node/engine_process/process.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

constexpr double kStiffness = 400.0;

class WrongEngine final : public physics::Engine {
 public:
  WrongEngine(std::string fault, std::string side)
      : fault_(std::move(fault)), side_(std::move(side)) {}

  bool step(const ToolMotion& motion, bool is_new, TimePoint now,
            Interaction& answer) noexcept override {
    ++steps_;
    const double depth_m = -motion.tool_position_world_m.z();
    Vector3 force = std::max(0.0, kStiffness * depth_m) * Vector3::UnitZ();
    // a step comes once a period, if nothing stops the process
    is_dead_ = is_dead_ || (steps_ > 1 && now - stepped_at_ > 300ms);
    stepped_at_ = now;
    if (fault_ == "suspension" && is_dead_) return false;
    if (fault_ == "silence" && !is_new) return false;
    if (fault_ == "answers" && steps_ % 300 > 150) return false;
    if (fault_ == "rest" && depth_m > 0.0) force.z() += 0.1 * std::sin(70.0 * seconds_of(now));
    if (fault_ == "air") force.z() += 0.5;
    if (fault_ == "jumps" && depth_m > 0.003) force.z() += 3.0;
    // round the circle it pushes ahead; up and down it presses harder on the way up
    if (fault_ == "energy" && depth_m > 0.0) force += 20.0 * motion.tool_velocity_world_m_per_s;
    const Vector3& at_m = motion.tool_position_world_m;
    const Vector3 round(-at_m.y(), at_m.x(), 0.0);
    if (fault_ == "whirl" && depth_m > 0.0) force += 100.0 * round;
    if (fault_ == "whirl back" && depth_m > 0.0) force -= 100.0 * round;
    if (fault_ == "loop") force *= 1.0 + 150.0 * (at_m.x() + at_m.y());
    if (fault_ == "loop back") force *= 1.0 - 150.0 * (at_m.x() + at_m.y());
    if (fault_ == "slow")
      force *= 1.0 + 0.8 * std::sin(2.0 * std::numbers::pi * 0.24 * seconds_of(now));
    if (fault_ == "rate" && steps_ % 25 != 0) return false;
    if (fault_ == "busy") compute(5ms);
    if (fault_ == "sides" && side_ == "right") return false;
    if (fault_ == "pull") force = -force;
    answer.listed_count = answer.contact_count = depth_m > 0.0 ? 1 : 0;
    answer.contacts[0] = {.penetration_m = std::max(0.0, depth_m),
                          .elastic_force_on_tool_newton = force,
                          .d_force_d_position = Vector3(0.0, 0.0, -kStiffness).asDiagonal(),
                          .trust_radius_m = 0.001,
                          .force_on_tool_newton = force};
    if (fault_ == "model") answer.contacts[0].d_force_d_position *= -10.0;
    if (fault_ == "against" && depth_m > 0.0) answer.contacts[0].normal_world = -Vector3::UnitZ();
    if (fault_ == "stamps") answer.device_sequence += 1;
    if (fault_ == "pose") answer.tool_position_world_m.x() += 0.001;
    if (fault_ == "frames" && depth_m > 0.002) answer.stored_energy_joule = -1.0;
    answer.force_on_tool_newton = force;
    if (fault_ == "delay") return delay(answer, now);
    if (fault_ == "dies" && !std::isfinite(depth_m)) std::abort();
    return true;
  }

 private:
  /// Never sleeps: this step takes so long on a processor of its own.
  static void compute(std::chrono::milliseconds time) noexcept {
    const auto used = [] {
      timespec now{};
      clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
      return std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec);
    };
    const auto begin = used();
    while (used() - begin < time) {
    }
  }
  /// The answer of 60 ms ago.
  bool delay(Interaction& answer, TimePoint now) {
    answers_.emplace_back(now, answer);
    if (now - answers_.front().first < 60ms) return false;
    const Header header = answer.header;
    answer = answers_.front().second;
    answer.header = header;
    answers_.pop_front();
    return true;
  }

  std::string fault_;
  std::string side_;
  std::uint64_t steps_ = 0;
  TimePoint stepped_at_{};
  bool is_dead_ = false;
  std::deque<std::pair<TimePoint, Interaction>> answers_;
};

class NoDisplay final : public physics::Display {
 public:
  void publish(const physics::Watchers& /*watchers*/, std::span<const PhysicsTick> /*newest*/,
               TimePoint /*now*/) override {}
  [[nodiscard]] bool is_too_large() const override { return false; }
  void count_into(PhysicsCounters& /*counters*/) const override {}
};

}  // namespace
}  // namespace palpate

int main(int argc, char** argv) {
  using namespace palpate;
  const std::string fault = argc > 1 ? argv[1] : "";
  --argc;
  ++argv;
  if (fault == "start") return 3;
  const int status = run_node(
      argc, argv, {.name = "physics", .program = "wrong_physics", .description = "Wrong."},
      [&](NodeContext& context) {
        ProcessLinks links(context.session.side().realtime);
        // a fixed one is not that of a restarted program
        if (fault == "restart") context.session_id = 7;
        physics::run_process(
            context, links,
            {.make_engine =
                 [&](const Side& side) { return std::make_unique<WrongEngine>(fault, side.name); },
             .make_display = [](Sender<SceneState>&,
                                Sender<MeshFrame>&) { return std::make_unique<NoDisplay>(); }});
      });
  return fault == "stop" ? 5 : status;
}
