// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "device_node/monitor/force_monitor.h"
#include "tests/bench/guarantee/adverse_rows.h"
#include "tests/bench/guarantee/guarantee_tables.h"

namespace palpate::bench {

using test::AdverseRun;

Table monitor_table(int seeds, const std::vector<std::string>& more_overrides, const Shard& shard) {
  struct Lie {
    const char* label;
    const char* clamp;
    std::vector<std::string> overrides = {};
  };
  const Lie kLies[] = {{"honest clamp", "truthful"},
                       {"full force, for an hour", "full_force"},
                       {"honest force, for an hour; no tick for 9 ms, 50/s",
                        "wrong_lease",
                        {"faults.device.skip={until_s: 0.009 every_s: 0.02}"}},
                       {"full force, one tick ahead", "ahead"},
                       {"commands of 100 ms ago", "replay"},
                       {"full force, a third NaN", "full_force_not_a_number"},
                       {"ledger that drifts", "drift"},
                       {"full force 0.2 s of every 0.5 s", "mostly_right"},
                       {"all that is covered, and the rounding", "rounding"},
                       {"honest force, a ledger of 1 J more", "lying_ledger"}};
  std::vector<AdverseRow> rows;
  const auto add = [&](const std::string& label, const Friction& friction, double profile_ratio,
                       const char* protection, AdverseRun run) {
    append(run.overrides, overrides_of(friction, {.ratio = profile_ratio}));
    append(run.overrides, kGuard.overrides);
    append(run.overrides, more_overrides);
    rows.push_back({label, &friction, {protection}, std::move(run)});
  };
  for (const Lie& lie : kLies) {
    for (const Friction& friction : kFrictions) {
      AdverseRun run{.overrides = lie.overrides};
      run.overrides.emplace_back("adversary.physics=push_along");
      run.overrides.push_back(std::string("adversary.clamp=") + lie.clamp);
      AdverseRun without = run;
      without.overrides.emplace_back("device.monitor=off");
      add(lie.label, friction, 1.0, "–", without);
      add(lie.label, friction, 1.0, "monitor", run);
    }
  }
  for (const int factor : {1, 2, 5}) {
    for (const Friction& friction : kFrictions) {
      const std::string label = fmt::format("profile friction {}× the true", factor);
      const AdverseRun run{.overrides = {"adversary.physics=everything"}};
      AdverseRun checked = run;
      checked.overrides.emplace_back("device.hands_off_check=true");
      add(label, friction, factor, "monitor", run);
      add(label, friction, factor, "monitor, hands-off check", checked);
    }
  }
  run_rows(rows, seeds, shard);
  return table_of(rows, "case", {{"protection", "beside the clamp", ""}},
                  {{"transparency_percent", "transp. %", "{:.2f}"},
                   {"monitor_reductions", "reduced", "{:.0f}"},
                   {"ledger_excesses", "ledger too high", "{:.0f}"}},
                  [](const AdverseRow& row) -> std::vector<Table::Cell> {
                    return {row.summary.transparency_percent(),
                            static_cast<double>(row.summary.monitor_reductions),
                            static_cast<double>(row.summary.ledger_excesses)};
                  });
}

double monitor_tick_us(bool is_per_axis) {
  constexpr int kTicks = 50'000;
  DeviceConfig config;
  config.reply = std::chrono::microseconds(500);
  config.lease = std::chrono::milliseconds(2);
  if (is_per_axis) {
    config.profile.per_axis = FrictionPerAxis{.viscous_newton_s_per_m = {0.05, 0.1, 0.2},
                                              .coulomb_newton = {0.05, 0.1, 0.2}};
  }
  double best_us = 1e9;
  for (int round = 0; round < 20; ++round) {
    device::ForceMonitor monitor(config);
    TimePoint now{};
    Vector3 force = Vector3::Zero();
    const auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < kTicks; ++i) {
      const double t_s = 1e-3 * i;
      const double x_m = config.profile.position_resolution_m * std::round(200.0 * std::sin(t_s));
      now += std::chrono::microseconds(900);
      monitor.read(now, {x_m, -x_m, 0.5 * x_m});
      now += std::chrono::microseconds(100);
      const auto covered =
          monitor.cover({0.01 * (i % 300), 0.0, 1.0}, std::chrono::milliseconds(3));
      monitor.switched(now, {x_m, -x_m, 0.5 * x_m}, covered.force_on_hand_newton, covered.lease);
      force += covered.force_on_hand_newton;
    }
    const std::chrono::duration<double, std::micro> elapsed =
        std::chrono::steady_clock::now() - begin;
    if (std::isfinite(force.norm())) best_us = std::min(best_us, elapsed.count() / kTicks);
  }
  return best_us;
}

}  // namespace palpate::bench
