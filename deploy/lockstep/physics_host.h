// SPDX-License-Identifier: Apache-2.0
// physics_host.h — one physics_node of a lockstep run, which all sides share.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "common/core/clock.h"
#include "common/core/physics_term.h"
#include "common/core/tick_schedule.h"
#include "common/session/session.h"
#include "deploy/lockstep/virtual_time.h"
#include "physics_node/answer/speaker.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/physics_node.h"

namespace palpate {

/// The clock of another host.
class HostClock final : public Clock {
 public:
  HostClock(const VirtualTime& time, Duration ahead) : time_(time), ahead_(ahead) {}
  [[nodiscard]] TimePoint now() const noexcept override { return time_.now() + ahead_; }
  /// Nothing that runs on another host waits.
  void sleep_until(TimePoint /*deadline*/) override {}

 private:
  const VirtualTime& time_;
  Duration ahead_;
};

/// Steps the tools of one physics at its rate.
class PhysicsHost {
 public:
  /// @param ahead       its clock before that of the run
  /// @param is_stopped  whether its process is suspended; may be empty
  PhysicsHost(const Session& session, VirtualTime& time, PhysicsRole role, Duration ahead,
              std::function<bool(TimePoint)> is_stopped)
      : time_(time),
        clock_(time, ahead),
        ahead_(ahead),
        is_stopped_(std::move(is_stopped)),
        schedule_(TimePoint{}, session.physics.rate_hz),
        elastic_(physics::ElasticTissues::of(session.scene, session.sides.size(),
                                             physics::ElasticPace::kVirtual)) {
    if (session.physics.standby) speaker_.emplace(role);
  }

  [[nodiscard]] const Clock& clock() const { return clock_; }
  [[nodiscard]] physics::Speaker* speaker() { return speaker_ ? &*speaker_ : nullptr; }

  /// Of all tools; null in a scene without elastic tissue.
  [[nodiscard]] const std::shared_ptr<physics::ElasticTissues>& elastic() const { return elastic_; }

  void add(physics::PhysicsNode& tool) { tools_.push_back(&tool); }

  /// Steps at the rate of the physics from now on.
  void start(int rank) {
    time_.schedule(schedule_.next(), rank, [this, rank] {
      turn();
      start(rank);
    });
  }
  /// One step of all tools, now.
  void turn() {
    Tick tick = schedule_.begin(time_.now());
    tick.scheduled_at += ahead_;
    tick.now += ahead_;
    if (!is_stopped_ || !is_stopped_(time_.now())) {
      for (physics::PhysicsNode* tool : tools_) tool->step(tick);
    }
    schedule_.finish(time_.now());
  }

 private:
  VirtualTime& time_;
  HostClock clock_;
  Duration ahead_;
  std::function<bool(TimePoint)> is_stopped_;
  TickSchedule schedule_;
  std::shared_ptr<physics::ElasticTissues> elastic_;
  std::optional<physics::Speaker> speaker_;
  std::vector<physics::PhysicsNode*> tools_;
};

}  // namespace palpate
