// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/disturbed/disturbed.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <optional>

#include "common/core/random.h"
#include "common/link/codec/codec.h"
#include "common/telemetry/quantile.h"
#include "deploy/lockstep/loopback.h"
#include "mofc_node/tissue/tissue_model.h"
#include "tests/bench/disturbed/disturbed_scenes.h"
#include "tests/support/temp_folder.h"

namespace palpate::bench {
namespace {

// --- disturbances ---------------------------------------------------------------------------

struct Disturbance {
  std::string name;
  std::vector<std::string> overrides{};
  std::vector<FaultWindow> windows{};  ///< of hops 2 and 3
};

std::vector<std::string> on_both_hops(const std::string& field, double value) {
  return {fmt::format("faults.tool_motion.{}={}", field, value),
          fmt::format("faults.interaction.{}={}", field, value)};
}

std::vector<Disturbance> delays() {
  std::vector<Disturbance> all{{"none"}};
  for (const double delay_ms : {20.0, 50.0, 100.0, 200.0}) {
    all.push_back({fmt::format("{:g} ms each way", delay_ms), on_both_hops("delay_ms", delay_ms)});
  }
  for (const double delay_ms : {0.0, 20.0, 50.0, 100.0, 200.0}) {
    Disturbance one{fmt::format("{:g} ms, 20 % lost, 50 Hz", delay_ms),
                    on_both_hops("delay_ms", delay_ms)};
    for (const std::string& loss : on_both_hops("loss_ratio", 0.2)) one.overrides.push_back(loss);
    one.overrides.emplace_back("physics.rate_hz=50");
    all.push_back(one);
  }
  return all;
}

std::vector<Disturbance> other_disturbances(double seconds) {
  std::vector<Disturbance> all;
  Disturbance jitter{"20 … 40 ms, jitter", on_both_hops("delay_ms", 20)};
  for (const std::string& more : on_both_hops("jitter_ms", 20)) jitter.overrides.push_back(more);
  all.push_back(jitter);
  for (const auto& [hop, field] : {std::pair{2, "tool_motion"}, {3, "interaction"}}) {
    all.push_back({fmt::format("bursts of 20, 1 %, hop {}", hop),
                   {fmt::format("faults.{}.burst_ratio=0.01", field),
                    fmt::format("faults.{}.burst_length=20", field)}});
  }
  all.push_back({"stalls of 50 ms, 5/s, hop 3",
                 {"faults.interaction.stall={from_s: 0.1 until_s: 0.15 every_s: 0.2}"}});
  all.push_back({"Wi-Fi of a campus", {}, wifi_stalls(seconds)});
  // the packet delay budget (50 ms) and error rate (10⁻³) of 5QI 3, "real time gaming", used up
  Disturbance mobile{"mobile, limits of 5QI 3", on_both_hops("delay_ms", 20)};
  for (const auto& [field, value] : {std::pair{"jitter_ms", 30.0}, {"loss_ratio", 1e-3}}) {
    for (const std::string& more : on_both_hops(field, value)) mobile.overrides.push_back(more);
  }
  all.push_back(mobile);
  for (const int ms : {2, 4, 6}) {
    all.push_back({fmt::format("answers missing {} ms, 20/s", ms),
                   {fmt::format("faults.force_command.outage={{from_s: 0.02 until_s: {} "
                                "every_s: 0.05}}",
                                0.02 + 1e-3 * ms)}});
  }
  all.push_back(
      {"5 % of the answers 2 ms late",
       {"faults.force_command.reorder_ratio=0.05", "faults.force_command.reorder_delay_ms=2"}});
  for (const double percent : {1.0, 5.0, 20.0}) {
    all.push_back({fmt::format("{:g} % of hop 1 lost", percent),
                   {fmt::format("faults.device_state.loss_ratio={}", 0.01 * percent)}});
  }
  return all;
}

// --- runs -----------------------------------------------------------------------------------

/// What the tissue costs mofc_node and hop 3.
struct Cost {
  std::vector<double> evaluations_us;
  std::vector<double> tile_bytes_per_s;  ///< descriptions and tiles, by second
};

/// Times the evaluation of the tissue where physics answers, with what it sends.
class CostMeter {
 public:
  CostMeter(const Session& session, Cost& cost)
      : cost_(cost),
        tissue_(true, session.side().mofc.handover_newton_per_s, kLockstepMofc,
                from_seconds(1.0 / session.side().device.rate_hz)) {}

  void note(const Interaction& interaction) {
    DeviceState state;
    state.header = {.session_id = interaction.device_session_id,
                    .sequence = interaction.device_sequence,
                    .sampled_at = interaction.device_sampled_at};
    state.tool_orientation_world = interaction.tool_orientation_world;
    tissue_.receive(interaction, state.header);
    const double dt_s = last_ ? to_seconds(state.header.sampled_at - *last_) : 0.0;
    last_ = state.header.sampled_at;
    const auto from = std::chrono::steady_clock::now();
    const ModelForce force =
        tissue_.step(interaction, state, interaction.tool_position_world_m, Vector3::Zero(), dt_s);
    const auto until = std::chrono::steady_clock::now();
    if (force.is_touching) {
      cost_.evaluations_us.push_back(
          std::chrono::duration<double, std::micro>(until - from).count());
    }

    const auto second =
        static_cast<std::size_t>(to_seconds(interaction.header.sampled_at.time_since_epoch()));
    if (cost_.tile_bytes_per_s.size() <= second) cost_.tile_bytes_per_s.resize(second + 1);
    if (interaction.surface.number == 0) return;
    Interaction without = interaction;
    without.surface.number = 0;
    without.surface.has_description = false;
    without.surface.tile_count = 0;
    cost_.tile_bytes_per_s[second] += static_cast<double>(codec_.encode(interaction)) -
                                      static_cast<double>(codec_.encode(without));
  }

 private:
  Cost& cost_;
  mofc::TissueModel tissue_;
  Codec<Interaction> codec_;
  std::optional<TimePoint> last_;
};

RunStatistics run(const DisturbedScene& scene, const Disturbance& disturbance, double seconds,
                  Cost* cost) {
  Session session = scene.session(disturbance.overrides);
  for (LinkFaults* faults : {&session.faults.tool_motion, &session.faults.interaction}) {
    faults->windows.insert(faults->windows.end(), disturbance.windows.begin(),
                           disturbance.windows.end());
  }
  LoopbackOptions options{.seconds = seconds};
  std::optional<CostMeter> meter;
  if (cost != nullptr) {
    meter.emplace(session, *cost);
    options.lockstep.tamper_with_interaction = [&](Interaction& interaction) {
      meter->note(interaction);
    };
  }
  return run_loopback(session, options).statistics;
}

}  // namespace

std::vector<FaultWindow> wifi_stalls(double seconds) {
  constexpr double kNormal90 = 1.2816;  // quantiles of the standard normal distribution
  constexpr double kNormal99 = 2.3263;
  const double sigma = std::log(250.0 / 20.0) / (kNormal99 - kNormal90);
  const double mu = std::log(0.020) - kNormal90 * sigma;
  Random random(16);
  std::vector<FaultWindow> windows;
  for (double at_s = 0.1; at_s < seconds;) {
    const double latency_s = std::min(std::exp(mu + sigma * random.normal()), 1.0);
    windows.push_back({.kind = FaultWindow::Kind::kStall,
                       .from = from_seconds(at_s),
                       .until = from_seconds(at_s + latency_s)});
    at_s += std::max(0.1, latency_s);
  }
  return windows;
}

void run_disturbed(const BenchOptions& options, const std::vector<std::string>& meshes,
                   const DisturbedRows& rows) {
  const test::TempFolder folder;
  const double most_seconds = rows.is_excerpt ? 3.0 : options.is_quick ? 4.0 : 10.0;
  Table table({{"surface", "scene", ""},
               {"disturbance", "disturbance", ""},
               {"capped_transparency", "transp.", "{:.3f}"},
               {"transparency_change", "change", "{:+.3f}"},
               {"gain", "gain", "{:.3f}"},
               {"force_error_percent", "error %", "{:.1f}"},
               {"force_error_change_percent", "change", "{:+.1f}"},
               {"path_rms_mm", "path mm", "{:.3f}"},
               {"path_rms_change_mm", "change", "{:+.3f}"},
               {"path_peak_mm", "peak mm", "{:.2f}"},
               {"excess_reversals", "exc. rev.", "{:.0f}"},
               {"excess_reversals_change", "change", "{:+.0f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"},
               {"evaluation_p50_us", "eval. µs", "{:.2f}"},
               {"evaluation_p99_us", "p99", "{:.2f}"},
               {"first_second_kb", "tiles kB 1st s", "{:.1f}"},
               {"later_kb_per_s", "later kB/s", "{:.1f}"}});
  const std::vector<Disturbance> few = delays();
  std::vector<Disturbance> all = few;
  for (Disturbance& other : other_disturbances(most_seconds)) all.push_back(std::move(other));
  const auto is_wanted = [&](const Disturbance& one) {
    const auto has = [&](const char* text) { return one.name.starts_with(text); };
    if (rows.is_excerpt) return has("none") || has("50 ms, 20 %") || has("100 ms, 20 %");
    return !options.is_quick || (!has("20 ms") && !has("200 ms"));
  };
  for (const DisturbedScene& scene : disturbed_scenes(folder, meshes)) {
    if (scene.name.find(rows.only) == std::string::npos) continue;
    if (rows.is_excerpt && !scene.is_in_excerpt) continue;
    const double seconds = std::min(most_seconds, scene.seconds);
    std::optional<RunStatistics> undisturbed;
    std::vector<Disturbance> own{{"none"}};
    for (const OwnDisturbance& one : scene.own_disturbances) {
      own.push_back({one.name, one.overrides});
    }
    // beside each the run without a controller
    if (scene.has_uncontrolled) {
      const std::vector<Disturbance> controlled = own;
      own.clear();
      for (const Disturbance& one : controlled) {
        own.push_back(one);
        own.push_back(one);
        own.back().name += ", no controller";
        own.back().overrides.insert(own.back().overrides.end(),
                                    {"mofc.controller=none", "device.monitor=off"});
      }
    }
    const bool has_own = scene.has_uncontrolled || !scene.own_disturbances.empty();
    for (const Disturbance& disturbance : has_own ? own : scene.has_all_disturbances ? all : few) {
      if (!has_own && !is_wanted(disturbance)) continue;
      Cost cost;
      const bool is_first = !undisturbed;
      const RunStatistics s = run(scene, disturbance, seconds, is_first ? &cost : nullptr);
      if (is_first) undisturbed = s;
      const auto reversals = static_cast<double>(s.excess_reversals());
      constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
      const bool has_times = !cost.evaluations_us.empty();
      const std::vector<double>& bytes = cost.tile_bytes_per_s;
      const double later_s = static_cast<double>(bytes.size()) - 1.0;
      table.add({scene.name, disturbance.name, s.ideal_transparency(),
                 s.ideal_transparency() - undisturbed->ideal_transparency(), s.gain(),
                 100.0 * s.force_error_rms_ratio(),
                 100.0 * (s.force_error_rms_ratio() - undisturbed->force_error_rms_ratio()),
                 1e3 * s.path_deviation_rms_m(),
                 1e3 * (s.path_deviation_rms_m() - undisturbed->path_deviation_rms_m()),
                 1e3 * s.path_deviation_peak_m(), reversals,
                 reversals - static_cast<double>(undisturbed->excess_reversals()),
                 1e6 * s.minimum_true_energy_joule(),
                 has_times ? quantile(cost.evaluations_us, 0.5) : kNone,
                 has_times ? quantile(cost.evaluations_us, 0.99) : kNone,
                 bytes.empty() ? kNone : 1e-3 * bytes.front(),
                 later_s > 0.0
                     ? 1e-3 * std::accumulate(bytes.begin() + 1, bytes.end(), 0.0) / later_s
                     : kNone});
    }
    table.add_gap();
  }
  table.publish(options);
  std::printf(
      "\nThe hand presses 16 mm to and fro, 0.7 times a second, on 300 N/m and 1 N s/m; on rock "
      "and "
      "ribs it also\nslides at up to 47 mm/s. At most %g s, physics at 1 kHz unless stated; delay, "
      "loss and jitter on hops 2 and\n3 each. Change: against the first row of the scene. Wi-Fi: "
      "log-normal latency with 20 ms at 90 %% and 250 ms\nat 99 %% [Sui16], drawn anew every 100 "
      "ms. "
      "Mobile: 20 … 50 ms and 0.1 %% loss each way. Evaluation: of the\ntissue by mofc_node in "
      "contact. Tiles: descriptions and tiles on hop 3.\n",
      most_seconds);
}

}  // namespace palpate::bench
