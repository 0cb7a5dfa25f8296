// SPDX-License-Identifier: Apache-2.0
// event_log.h — turns changes of a node's counters into log lines.
// The tick thread counts, the telemetry thread compares and writes.
#pragma once

#include <spdlog/spdlog.h>

#include "common/telemetry/event_throttle.h"
#include "common/telemetry/telemetry.h"

namespace palpate {

/// A count that should not grow: a throttled line `event=… count=…` when it does.
class GrowthEvent {
 public:
  GrowthEvent(spdlog::logger& log, spdlog::level::level_enum level, const char* event)
      : log_(log), level_(level), event_(event) {}
  void note(std::uint64_t count, TimePoint now);

 private:
  spdlog::logger& log_;
  spdlog::level::level_enum level_;
  const char* event_;
  EventThrottle throttle_;
  std::uint64_t last_ = 0;
};

/// A state that is counted in ticks: `event=…_began` when the count starts to grow, `event=…_ended
/// ticks=…` once it has not grown for a second. States that recur within a second are one episode.
class EpisodeEvent {
 public:
  EpisodeEvent(spdlog::logger& log, const char* event) : log_(log), event_(event) {}
  void note(std::uint64_t ticks, TimePoint now);

 private:
  spdlog::logger& log_;
  const char* event_;
  bool is_under_way_ = false;
  std::uint64_t ticks_ = 0;
  std::uint64_t ticks_before_ = 0;
  TimePoint grew_at_{};
};

/// An incoming link: first message, restart of the sender, rejected messages, answers ahead.
class LinkEvents {
 public:
  LinkEvents(spdlog::logger& log, const char* link) : log_(log), link_(link) {}
  void note(const LinkCounters& counters, TimePoint now);

 private:
  spdlog::logger& log_;
  const char* link_;
  EventThrottle rejections_;
  EventThrottle ahead_;
  LinkCounters last_;
};

/// The events of one node. Call note() regularly, on one thread, with the newest counters.
template <class Counters>
class EventLog;

template <>
class EventLog<DeviceCounters> {
 public:
  explicit EventLog(spdlog::logger& log);
  void note(const DeviceCounters& counters, TimePoint now);

 private:
  void note_phase(DevicePhase phase);

  LinkEvents force_command_;
  spdlog::logger& log_;
  std::uint64_t faults_ = 0;
  std::uint64_t fault_resets_ = 0;
  bool is_release_unconfirmed_ = false;
  DevicePhase phase_ = DevicePhase::kUnknown;
  GrowthEvent non_finite_commands_;
  GrowthEvent late_switches_;
  GrowthEvent monitor_reductions_;
  GrowthEvent ledger_excesses_;
  GrowthEvent too_fast_;
  GrowthEvent coarse_readings_;
  GrowthEvent outside_;
  GrowthEvent frozen_;
  GrowthEvent acknowledged_;
  GrowthEvent not_acknowledged_;
  double motor_gain_ = 0.0;
  GrowthEvent overruns_;
  EpisodeEvent fallback_;
  bool was_answered_ = false;
  std::uint64_t limp_ticks_at_start_ = 0;
};

template <>
class EventLog<MofcCounters> {
 public:
  explicit EventLog(spdlog::logger& log);
  void note(const MofcCounters& counters, TimePoint now);

 private:
  LinkEvents device_state_;
  LinkEvents interaction_;
  LinkEvents standby_interaction_;
  spdlog::logger& log_;
  std::uint64_t physics_switches_ = 0;
  bool has_told_debt_ = false;
  GrowthEvent late_physics_;
  GrowthEvent too_fast_;
  GrowthEvent motions_dropped_;
  GrowthEvent ledger_resets_;
  GrowthEvent grips_;
  GrowthEvent grips_torn_;
  GrowthEvent grips_slipped_;
  GrowthEvent punctures_;
  EpisodeEvent stale_;
};

template <>
class EventLog<PhysicsCounters> {
 public:
  explicit EventLog(spdlog::logger& log);
  void note(const PhysicsCounters& counters, TimePoint now);

 private:
  LinkEvents tool_motion_;
  GrowthEvent overruns_;
  GrowthEvent tissue_changes_refused_;
  GrowthEvent removed_;
  GrowthEvent loose_;
  GrowthEvent refused_;
  GrowthEvent restored_;
  GrowthEvent torn_;
  GrowthEvent cut_;
};

}  // namespace palpate
