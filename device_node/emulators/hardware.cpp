// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/hardware.h"

#include <algorithm>
#include <utility>

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

/// In which held currents and past positions are followed.
constexpr Duration kStep = 100us;

ManualClock started_at(TimePoint now) {
  ManualClock clock;
  clock.sleep_until(now);
  return clock;
}

}  // namespace

Hardware::Hardware(const SimulatedDeviceConfig& device, const HandConfig& hand, const Clock& clock,
                   std::uint64_t seed)
    : clock_(clock),
      time_(started_at(clock.now())),
      random_(seed),
      device_(device, hand, time_, seed),
      ends_at_(TimePoint::max()) {}

DeviceSample Hardware::read() {
  catch_up();
  return seen();
}

DeviceSample Hardware::switch_to(const Vector3& force_newton) {
  catch_up();
  begin({.due = {}, .force = [force_newton](const Vector3&) { return force_newton; }});
  DeviceSample sample = seen();
  sample.applied_force_newton = force_newton;
  return sample;
}

DeviceSample Hardware::switch_to(HeldForce force_newton) {
  catch_up();
  DeviceSample sample = seen();
  sample.applied_force_newton = force_newton(sample.hand_position_m);
  begin({.due = {}, .force = std::move(force_newton), .is_held = true});
  return sample;
}

void Hardware::let_go() {
  catch_up();
  switches_.clear();
  acting_ = {};
  ends_at_ = TimePoint::max();
  make(Vector3::Zero());
}

void Hardware::begin(Switch next) {
  told_at_ = time_.now();
  next.due = told_at_ + drawn(vices_.actuation);
  if (!switches_.empty()) next.due = std::max(next.due, switches_.back().due);
  switches_.push_back(std::move(next));
  catch_up();
}

void Hardware::catch_up() {
  const TimePoint now = clock_.now();
  for (;;) {
    const TimePoint watchdog_at = told_at_ + vices_.watchdog;
    const TimePoint due = switches_.empty() ? TimePoint::max() : switches_.front().due;
    const TimePoint ends = acting_.force ? std::min(ends_at_, watchdog_at) : TimePoint::max();
    const TimePoint next = std::min({now, due, ends});
    advance_to(next);
    if (due <= next) {
      acting_ = std::move(switches_.front());
      switches_.pop_front();
      ends_at_ = vices_.acts_for > Duration::zero() ? due + vices_.acts_for : TimePoint::max();
      make(acting_.force(device_.true_state().hand_position_m));
    } else if (ends <= next) {
      acting_ = {};
      make(Vector3::Zero());
    } else {
      return;
    }
  }
}

void Hardware::advance_to(TimePoint to) {
  const bool must_follow = acting_.is_held || vices_.sensing > Duration::zero();
  while (time_.now() < to) {
    time_.sleep_until(must_follow ? std::min(to, time_.now() + kStep) : to);
    DeviceSample sample;
    static_cast<void>(device_.read(sample));
    if (vices_.sensing > Duration::zero()) past_.push_back(sample);
    if (acting_.is_held) make(acting_.force(device_.true_state().hand_position_m));
  }
}

void Hardware::make(const Vector3& force_newton) {
  DeviceSample passed;
  static_cast<void>(device_.apply(vices_.gain * force_newton, HardwareVices::kNever, passed));
}

Duration Hardware::drawn(Duration most) {
  if (!vices_.has_jitter || most <= Duration::zero()) return most;
  return from_seconds(random_.uniform() * to_seconds(most));
}

DeviceSample Hardware::seen() {
  DeviceSample sample;
  static_cast<void>(device_.read(sample));
  if (vices_.sensing <= Duration::zero()) {
    past_.clear();
    return sample;
  }
  // never back in time
  seen_at_ = std::max(seen_at_, time_.now() - drawn(vices_.sensing));
  while (past_.size() > 1 && past_.front().sampled_at < time_.now() - vices_.sensing - kStep) {
    past_.pop_front();
  }
  for (const DeviceSample& past : past_) {
    if (past.sampled_at > seen_at_ && &past != &past_.front()) break;
    sample.hand_position_m = past.hand_position_m;
    sample.buttons = past.buttons;
  }
  return sample;
}

}  // namespace palpate::device
