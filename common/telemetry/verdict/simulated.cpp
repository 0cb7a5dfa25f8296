// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/verdict/simulated.h"

#include <algorithm>
#include <vector>

namespace palpate {
namespace {

/// Of a late tick of `adversary`: 1 … 5.
constexpr double kLatePeriods = 3.0;

/// Share of the run that lies in windows.
double share_of(const std::vector<FaultWindow>& windows, double run_s) {
  double share = 0.0;
  for (const FaultWindow& window : windows) {
    const double whole_s = window.every.count() > 0 ? to_seconds(window.every) : run_s;
    const double length_s =
        std::min(to_seconds(window.until), whole_s) - std::min(to_seconds(window.from), whole_s);
    if (whole_s > 0.0) share += length_s / whole_s;
  }
  return share;
}

class Sum {
 public:
  Sum(double period_s, double run_s, double least_delay_s)
      : period_s_(period_s), run_s_(run_s), least_delay_s_(least_delay_s) {}

  void add(const char* field, bool is_set, double share) {
    if (!is_set) return;
    sum_.fields += (sum_.fields.empty() ? "" : ", ") + std::string(field);
    sum_.share = std::min(1.0, sum_.share + share);
  }
  void add(const char* field, const LinkFaults& link) {
    const double delay_s = std::max(0.0, to_seconds(link.delay + link.jitter) - least_delay_s_);
    add(field, link.any(),
        link.loss_ratio + link.burst_ratio * link.burst_length + link.reorder_ratio +
            delay_s / period_s_ + share_of(link.windows, run_s_));
  }
  void add(const char* field, const DeviceFaults& device) {
    add(field, !device.skips.empty() || device.late_ratio > 0.0 || device.late_switch_ratio > 0.0,
        device.late_ratio * device.late_periods + device.late_switch_ratio +
            share_of(device.skips, run_s_));
  }
  [[nodiscard]] SimulatedDisturbance result() && { return std::move(sum_); }

 private:
  double period_s_;
  double run_s_;
  double least_delay_s_;
  SimulatedDisturbance sum_;
};

}  // namespace

SimulatedDisturbance simulated_at(SimulatedAt place, const FaultsConfig& faults,
                                  const AdversaryConfig& adversary, double period_s, double run_s,
                                  double least_delay_s) {
  Sum sum(period_s, run_s, least_delay_s);
  switch (place) {
    case SimulatedAt::kExchange:
      sum.add("faults.device_state", faults.device_state);
      sum.add("faults.force_command", faults.force_command);
      break;
    case SimulatedAt::kPhysics:
      sum.add("faults.tool_motion", faults.tool_motion);
      sum.add("faults.interaction", faults.interaction);
      [[fallthrough]];
    case SimulatedAt::kHostile:
      sum.add("adversary.physics", adversary.physics != HostilePhysics::kHonest, 1.0);
      break;
    case SimulatedAt::kStandby:
      sum.add("faults.standby_tool_motion", faults.standby_tool_motion);
      sum.add("faults.standby_interaction", faults.standby_interaction);
      break;
    case SimulatedAt::kDevice:
      sum.add("faults.device", faults.device);
      sum.add("adversary.tick_jitter_ratio", adversary.tick_jitter_ratio > 0.0,
              adversary.tick_jitter_ratio);
      sum.add("adversary.late_tick_ratio", adversary.late_tick_ratio > 0.0,
              kLatePeriods * adversary.late_tick_ratio);
      break;
    case SimulatedAt::kClamp:
      sum.add("adversary.clamp", adversary.clamp != LyingClamp::kTruthful, 1.0);
      break;
  }
  return std::move(sum).result();
}

}  // namespace palpate
