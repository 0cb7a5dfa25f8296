// SPDX-License-Identifier: Apache-2.0
// Rows of transparency_bench: the shipped sessions with holes in their ticks and disturbed links,
// each beside its own undisturbed run and a goal.
#include <spdlog/fmt/fmt.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <optional>

#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "tests/bench/disturbed/disturbed.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

constexpr std::array kSessions{"default", "liver", "cloud"};

/// NaN: none.
struct Goal {
  double transparency = kNaN;         ///< at least
  double transparency_change = kNaN;  ///< against the undisturbed run, at most
  double path_rms_mm = kNaN;          ///< at most, or that of the undisturbed run

  [[nodiscard]] std::string text() const {
    std::string all;
    if (std::isfinite(transparency)) all += fmt::format("T ≥ {:g}", transparency);
    if (std::isfinite(transparency_change))
      all += fmt::format("T within {:g}", transparency_change);
    if (std::isfinite(path_rms_mm)) all += fmt::format(", path ≤ {:g}", path_rms_mm);
    return all.empty() ? "–" : all;
  }
  [[nodiscard]] std::string verdict(const RunStatistics& s,
                                    const RunStatistics& undisturbed) const {
    std::string missed;
    const double change = undisturbed.ideal_transparency() - s.ideal_transparency();
    if (s.ideal_transparency() < transparency || change > transparency_change) missed += " T";
    if (1e3 * s.path_deviation_rms_m() > path_rms_mm) {
      missed += undisturbed.path_deviation_rms_m() * 1e3 > path_rms_mm ? " path (so is undisturbed)"
                                                                       : " path";
    }
    if (s.minimum_true_energy_joule() < -1e-6) missed += " energy";
    if (!missed.empty()) return "missed:" + missed;
    return text() == "–" ? "–" : "met";
  }
};

struct Disturbance {
  std::string name;
  std::vector<std::string> overrides{};
  Goal goal{};
  std::vector<FaultWindow> windows{};  ///< of hops 2 and 3
};

std::vector<std::string> on_both_hops(const std::vector<std::string>& faults) {
  std::vector<std::string> all;
  for (const char* hop : {"tool_motion", "interaction"}) {
    for (const std::string& fault : faults) all.push_back(fmt::format("faults.{}.{}", hop, fault));
  }
  return all;
}

/// So many times a second the ticks, or their answers, are missing for that time.
Disturbance hole(bool is_skip, int ms, int per_second, Goal goal) {
  const double end_s = 0.02 + 1e-3 * ms;
  const char* const field = is_skip ? "device.skip" : "force_command.outage";
  // the tick at 20 ms is the last one before a skip, and the first one of an outage
  return {
      fmt::format("{} {} ms, {}/s", is_skip ? "ticks skipped" : "answers missing", ms, per_second),
      {fmt::format("faults.{}={{from_s: {} until_s: {} every_s: {}}}", field,
                   is_skip ? 0.0201 : 0.02, end_s, 1.0 / per_second)},
      goal};
}

std::vector<Disturbance> disturbances(double seconds) {
  constexpr Goal kHole{.transparency = 0.985, .path_rms_mm = 0.05};
  constexpr Goal kNetwork{.transparency_change = 0.01, .path_rms_mm = 0.05};
  std::vector<Disturbance> all;
  for (const bool is_skip : {true, false}) {
    for (const int per_second : {10, 20}) {
      for (const int ms : {2, 4, 6}) all.push_back(hole(is_skip, ms, per_second, kHole));
    }
  }
  for (const auto& [ms, least] : {std::pair{7, 0.97}, {8, 0.97}, {10, 0.9}}) {
    all.push_back(hole(true, ms, 20, {.transparency = least}));
    Disturbance latched = hole(true, ms, 20, {.transparency = least});
    latched.name += ", latch";
    latched.overrides.emplace_back("device.simulated.position_latch=true");
    all.push_back(latched);
  }
  for (const int percent : {1, 5, 20}) {
    all.push_back({fmt::format("{} % of hop 1 lost", percent),
                   {fmt::format("faults.device_state.loss_ratio={}", 0.01 * percent)},
                   {.transparency = 0.985}});
  }
  all.push_back({"5 % of the ticks 1 … 5 periods late",
                 {"faults.device.late_ratio=0.05"},
                 {.transparency = 0.98}});

  all.push_back({"20 … 40 ms, jitter", on_both_hops({"delay_ms=20", "jitter_ms=20"}), kNetwork});
  for (const auto& [hop, field] : {std::pair{2, "tool_motion"}, {3, "interaction"}}) {
    all.push_back({fmt::format("bursts of 20, 1 %, hop {}", hop),
                   {fmt::format("faults.{}.burst_ratio=0.01", field),
                    fmt::format("faults.{}.burst_length=20", field)},
                   kNetwork});
  }
  for (const auto& [hop, field] : {std::pair{2, "tool_motion"}, {3, "interaction"}}) {
    all.push_back(
        {fmt::format("stalls of 50 ms, 5/s, hop {}", hop),
         {fmt::format("faults.{}.stall={{from_s: 0.1 until_s: 0.15 every_s: 0.2}}", field)},
         kNetwork});
  }
  // measured networks: docs/theory.md §8
  all.push_back({"Wi-Fi of a campus [Sui16]", {}, kNetwork, wifi_stalls(seconds)});
  all.push_back(
      {"5G campus, 4 … 10 ms [Rischke21]", on_both_hops({"delay_ms=4", "jitter_ms=6"}), kNetwork});
  all.push_back({"5G of an operator, 23.5 ms [Testouri25]",
                 on_both_hops({"delay_ms=23.1", "jitter_ms=0.8"}), kNetwork});
  all.push_back({"the same, a pause of 100 ms every 2 s",
                 on_both_hops({"delay_ms=23.1", "jitter_ms=0.8",
                               "stall={from_s: 0.7 until_s: 0.8 every_s: 2}"}),
                 kNetwork});

  // silence, and a network that is bad in every respect
  all.push_back({"stalls of 200 ms, 1/s, both hops",
                 on_both_hops({"stall={from_s: 0.5 until_s: 0.7 every_s: 1}"}), kNetwork});
  all.push_back(
      {"silences of 0.5 s, physics at 30 Hz",
       {"physics.rate_hz=30", "faults.interaction.outage={from_s: 1 until_s: 1.5 every_s: 2}"},
       kNetwork});
  Disturbance bad{"80 … 110 ms, 10 % lost, bursts, physics at 30 Hz",
                  on_both_hops({"delay_ms=80", "jitter_ms=30", "loss_ratio=0.1", "burst_ratio=0.01",
                                "burst_length=10"}),
                  {.transparency = 0.97}};
  bad.overrides.emplace_back("physics.rate_hz=30");
  all.push_back(bad);

  // slow devices and a coarse encoder; by default the device has 1 kHz and 0.055 mm
  for (const auto& [hz, least] : {std::pair{250, 0.97}, {200, 0.97}, {100, 0.95}, {50, 0.6}}) {
    all.push_back({fmt::format("device at {} Hz", hz),
                   {fmt::format("device.rate_hz={}", hz)},
                   {.transparency = least}});
  }
  all.push_back(
      {"encoder of 0.3 mm",
       {"device.simulated.position_resolution_m=3e-4", "device.profile.position_resolution_m=3e-4"},
       {.transparency = 0.97}});
  return all;
}

}  // namespace

void run_disturbed_sessions(const BenchOptions& options) {
  const double seconds = options.is_quick ? 4.0 : 10.0;
  Table table({{"session", "session", ""},
               {"disturbance", "disturbance", ""},
               {"capped_transparency", "T", "{:.3f}"},
               {"transparency_change", "change", "{:+.3f}"},
               {"gain", "gain", "{:.3f}"},
               {"force_error_percent", "error %", "{:.1f}"},
               {"path_rms_mm", "path mm", "{:.3f}"},
               {"path_rms_change_mm", "change", "{:+.3f}"},
               {"excess_reversals", "exc. rev.", "{:.0f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"},
               {"goal", "goal", ""},
               {"verdict", "", ""}});
  std::vector<Disturbance> all = disturbances(seconds);
  all.insert(all.begin(), {"none"});
  for (const char* const name : kSessions) {
    std::optional<RunStatistics> undisturbed;
    for (const Disturbance& disturbance : all) {
      Session session =
          load_session(std::filesystem::path(test::source_dir() + "/deploy/sessions") /
                           fmt::format("{}.txtpb", name),
                       disturbance.overrides);
      for (LinkFaults* faults : {&session.faults.tool_motion, &session.faults.interaction}) {
        faults->windows.insert(faults->windows.end(), disturbance.windows.begin(),
                               disturbance.windows.end());
      }
      const RunStatistics s = run_loopback(session, {.seconds = seconds}).statistics;
      if (!undisturbed) undisturbed = s;
      table.add({std::string(name), disturbance.name, s.ideal_transparency(),
                 s.ideal_transparency() - undisturbed->ideal_transparency(), s.gain(),
                 100.0 * s.force_error_rms_ratio(), 1e3 * s.path_deviation_rms_m(),
                 1e3 * (s.path_deviation_rms_m() - undisturbed->path_deviation_rms_m()),
                 static_cast<double>(s.excess_reversals()), 1e6 * s.minimum_true_energy_joule(),
                 disturbance.goal.text(), disturbance.goal.verdict(s, *undisturbed)});
    }
    table.add_gap();
  }
  table.publish(options);
  std::printf(
      "\n%g s of each session as shipped, mode guard, physics at 1 kHz. T: capped transparency "
      "against the ideal force;\nerror: rms of the difference; path: rms distance to the ideal "
      "run, mm. Change: against the undisturbed run, the\nfirst row. Delay, jitter and pauses on "
      "hops 2 and 3 each. Latch: the watchdog of the motors stores the position.\n",
      seconds);
}

}  // namespace palpate::bench
