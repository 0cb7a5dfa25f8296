// guarantee_bench — can the hand be given energy? Every controller mode against every adversity of
// physics, network, scheduler, encoder and profile, in the hand that seeks it, in lockstep; beside
// the run without any controller. And whether mode guard remembers.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <exception>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/runtime/session_file.h"
#include "deploy/palpate/loopback.h"
#include "tests/bench/bench_output.h"
#include "tests/support/adversity.h"

namespace palpate::bench {
namespace {

using test::AdverseResult;
using test::AdverseRun;
using test::Physics;

/// What a run that went wrong has drawn: more than the rounding of the inner steps.
constexpr double kNegativeJoule = -1e-6;
/// What the twin without a controller has to draw for the adversity to have bitten.
constexpr double kBiteJoule = -1e-3;

struct Mode {
  const char* label;
  const char* override;
};
constexpr Mode kModes[] = {{"none", "mofc.controller=none"},
                           {"paper", "mofc.mode=paper"},
                           {"vector", "mofc.mode=vector"},
                           {"guard", "mofc.mode=guard"}};

struct Adversity {
  std::string label;
  AdverseRun run;
};

std::vector<std::string> on_physics_hops(const std::string& field) {
  return {"faults.tool_motion." + field, "faults.interaction." + field};
}

std::vector<Adversity> adversities() {
  std::vector<Adversity> all;
  const auto add = [&](const std::string& label, std::vector<std::string> overrides,
                       Physics physics = Physics::kHonest) {
    all.push_back({label, {.overrides = std::move(overrides), .physics = physics}});
  };
  const auto both = [](std::initializer_list<const char*> fields) {
    std::vector<std::string> overrides;
    for (const char* field : fields) {
      for (const std::string& one : on_physics_hops(field)) overrides.push_back(one);
    }
    return overrides;
  };

  // hops 2 and 3, each
  add("no fault", {});
  add("delay 50 ms", both({"delay_ms=25"}));
  add("delay 500 ms", both({"delay_ms=250"}));
  add("jitter 0…50 ms", both({"jitter_ms=25"}));
  add("loss 30 %", both({"loss_ratio=0.3"}));
  add("bursts of 30 lost", both({"burst_ratio=0.02", "burst_length=30"}));
  add("stalls 200 and 400 ms", {"faults.interaction.stall={from_s: 0.3 until_s: 0.5 every_s: 1.1}",
                                "faults.interaction.stall={from_s: 0.6 until_s: 1 every_s: 1.1}"});
  add("reordering 30 % by 20 ms", both({"reorder_ratio=0.3", "reorder_delay_ms=20"}));
  add("duplication 50 %", both({"duplicate_ratio=0.5"}));
  add("physics frozen 300 ms",
      {"faults.interaction.freeze={from_s: 0.3 until_s: 0.6 every_s: 0.7}"});
  add("physics killed and back",
      {"faults.interaction.outage={from_s: 0.6 until_s: 0.9 every_s: 0.9}",
       "faults.tool_motion.outage={from_s: 0.6 until_s: 0.9 every_s: 0.9}"},
      Physics::kNewSessions);

  // what physics says
  add("±peak square wave", {}, Physics::kSquareWave);
  add("peak along the velocity", {}, Physics::kPushAlong);
  add("the same, a third NaN (inproc)", {}, Physics::kNotANumber);
  all.back().run.links = LockstepLinks::kInproc;

  // hops 1 and 4, inside the tick, answers due within 0.5 ms; the hostile physics makes them bite
  add("answers 0.2…0.6 ms late",
      {"faults.force_command.delay_ms=0.2", "faults.force_command.jitter_ms=0.4"},
      Physics::kPushAlong);
  add("answers lost 30 %", {"faults.force_command.loss_ratio=0.3"}, Physics::kPushAlong);
  add("states lost 30 %", {"faults.device_state.loss_ratio=0.3"}, Physics::kPushAlong);
  add("states 0…0.7 ms late", {"faults.device_state.jitter_ms=0.7"}, Physics::kPushAlong);

  // scheduler
  add("interval 0.5…1.5 T", {}, Physics::kPushAlong);
  all.back().run.tick_jitter = 0.5;

  // encoder
  for (const char* q_m : {"0", "55e-6", "5e-4"}) {
    add(fmt::format("encoder {:g} mm", 1e3 * std::stod(q_m)),
        {fmt::format("device.simulated.position_resolution_m={}", q_m),
         fmt::format("device.profile.position_resolution_m={}", q_m)},
        Physics::kPushAlong);
  }

  // outside the assumptions
  for (const int factor : {1, 2, 5}) {
    add(fmt::format("friction told {}× the true", factor),
        {fmt::format("device.profile.viscous_newton_s_per_m={}", 0.1 * factor),
         fmt::format("device.profile.coulomb_newton={}", 0.1 * factor)},
        Physics::kEverything);
  }
  add("hand of 1 m/s, v_max 0.5",
      {"hand.hostile.v_max_m_per_s=1", "device.profile.position_resolution_m=0",
       "device.simulated.position_resolution_m=0", "mofc.guard_settings.credit_cap_joule=10"},
      Physics::kEverything);
  add("hand of 2 m/s, v_max 0.25",
      {"hand.hostile.v_max_m_per_s=2", "mofc.guard_settings.v_max_m_per_s=0.25",
       "device.profile.position_resolution_m=0", "device.simulated.position_resolution_m=0",
       "mofc.guard_settings.credit_cap_joule=10"},
      Physics::kEverything);
  return all;
}

/// The worst and the mean of the seeds of one row.
struct Summary {
  int seeds = 0;
  int negative = 0;
  double least_joule = 0.0;
  double peak_newton = 0.0;
  double longest_fallback_s = 0.0;
  double top_speed_m_per_s = 0.0;
  std::uint64_t too_fast_ticks = 0;
  double transparency_sum = 0.0;
  int transparency_runs = 0;
  double clamped_sum = 0.0;
  int clamped_runs = 0;

  void add(const AdverseResult& result) {
    const RunStatistics& s = result.statistics;
    ++seeds;
    if (s.minimum_true_energy_joule() < kNegativeJoule) ++negative;
    least_joule = std::min(least_joule, s.minimum_true_energy_joule());
    peak_newton = std::max(peak_newton, s.maximum_force_newton());
    longest_fallback_s = std::max(longest_fallback_s, result.longest_fallback_s);
    top_speed_m_per_s = std::max(top_speed_m_per_s, result.top_speed_m_per_s);
    too_fast_ticks += result.mofc.too_fast_ticks;
    add_mean(s.vector_transparency(), transparency_sum, transparency_runs);
    add_mean(s.clamp_ratio(), clamped_sum, clamped_runs);
  }
  static void add_mean(double value, double& sum, int& runs) {
    if (std::isnan(value)) return;
    sum += value;
    ++runs;
  }
  static double mean_percent(double sum, int runs) { return runs > 0 ? 100.0 * sum / runs : kNaN; }
};

/// Does all jobs on as many threads as there are processors; the first exception comes out.
void in_parallel(std::size_t jobs, const std::function<void(std::size_t)>& job) {
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < jobs; i = next++) job(i);
    } catch (...) {
      const std::lock_guard lock(failure_mutex);
      failure = std::current_exception();
      next = jobs;
    }
  };
  {
    std::vector<std::jthread> threads;
    for (unsigned i = std::max(1U, std::thread::hardware_concurrency()); i > 0; --i) {
      threads.emplace_back(work);
    }
  }
  if (failure) std::rethrow_exception(failure);
}

Table adversity_table(int seeds) {
  constexpr const char* kPhysicsRates[] = {"1000", "50"};
  struct Row {
    const Adversity* adversity;
    const char* physics_hz;
    const Mode* mode;
    Summary summary;
  };
  const std::vector<Adversity> all = adversities();
  std::vector<Row> rows;
  for (const Adversity& adversity : all) {
    for (const char* physics_hz : kPhysicsRates) {
      for (const Mode& mode : kModes) rows.push_back({&adversity, physics_hz, &mode, {}});
    }
  }
  in_parallel(rows.size(), [&](std::size_t i) {
    Row& row = rows[i];
    AdverseRun run = row.adversity->run;
    run.overrides.push_back(fmt::format("physics.rate_hz={}", row.physics_hz));
    run.overrides.emplace_back(row.mode->override);
    for (int seed = 1; seed <= seeds; ++seed) {
      row.summary.add(test::run_adverse(run, static_cast<std::uint64_t>(seed)));
    }
  });

  Table table({{"adversity", "adversity", ""},
               {"physics_hz", "physics Hz", ""},
               {"mode", "mode", ""},
               {"seeds", "seeds", "{:.0f}"},
               {"negative_runs", "below −1 µJ", "{:.0f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"},
               {"peak_force_n", "peak N", "{:.2f}"},
               {"longest_fallback_ms", "fallback ms", "{:.1f}"},
               {"transparency_percent", "transp. %", "{:.1f}"},
               {"clamped_percent", "clamped %", "{:.1f}"},
               {"top_speed_m_per_s", "hand m/s", "{:.2f}"},
               {"too_fast_ticks", "too fast", "{:.0f}"},
               {"bites", "bites", ""}});
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    const Summary& s = row.summary;
    const bool is_twin = row.mode == &kModes[0];
    if (is_twin && row.physics_hz == kPhysicsRates[0] && i > 0) table.add_gap();
    table.add({row.adversity->label, std::string(row.physics_hz), std::string(row.mode->label),
               static_cast<double>(s.seeds), static_cast<double>(s.negative), 1e6 * s.least_joule,
               s.peak_newton, 1e3 * s.longest_fallback_s,
               Summary::mean_percent(s.transparency_sum, s.transparency_runs),
               Summary::mean_percent(s.clamped_sum, s.clamped_runs), s.top_speed_m_per_s,
               static_cast<double>(s.too_fast_ticks),
               std::string(!is_twin                     ? ""
                           : s.least_joule < kBiteJoule ? "yes"
                                                        : "no")});
  }
  return table;
}

// --- history ------------------------------------------------------------------------------------

/// Time for the V after the free motion, and for the hand to come to rest.
constexpr double kVSeconds = 3.0;

/// Soft, rigid and mixed tissue of the paper after more and more free motion: device and clamp at
/// 1 kHz, physics at 50 Hz. The V begins at many phases of the physics, because one tick earlier or
/// later already gives another chatter: what is left between the means is memory.
Table history_table(bool is_quick) {
  const auto phases_after = [&](double free_s) -> std::size_t {
    if (free_s < 100.0) return is_quick ? 5 : 100;
    return is_quick ? 1 : 20;
  };
  constexpr double kPhysicsPeriodSeconds = 0.02;
  struct Tissue {
    const char* label;
    const char* session;
  };
  constexpr Tissue kTissues[] = {
      {"soft", "paper_soft"}, {"rigid", "paper_rigid"}, {"mixed", "paper_mixed"}};
  struct Row {
    const Tissue* tissue;
    const Mode* mode;
    double free_s;
    std::vector<RunStatistics> runs;
  };
  std::vector<Row> rows;
  for (const Tissue& tissue : kTissues) {
    for (const Mode* mode : {&kModes[1], &kModes[3]}) {
      for (const double free_s : {0.0, 14.0, 40.0, 600.0}) {
        rows.push_back({&tissue, mode, free_s, std::vector<RunStatistics>(phases_after(free_s))});
      }
    }
  }
  std::vector<std::pair<Row*, std::size_t>> jobs;
  for (Row& row : rows) {
    for (std::size_t phase = 0; phase < row.runs.size(); ++phase) jobs.emplace_back(&row, phase);
  }
  in_parallel(jobs.size(), [&](std::size_t i) {
    const std::size_t phase = jobs[i].second;
    Row& row = *jobs[i].first;
    const double free_s = row.free_s + kPhysicsPeriodSeconds * static_cast<double>(phase) /
                                           static_cast<double>(row.runs.size());
    const std::filesystem::path sessions =
        std::filesystem::path(PALPATE_SOURCE_DIR) / "deploy/sessions";
    const Session session =
        load_session(sessions / (std::string(row.tissue->session) + ".txtpb"),
                     {"device.rate_hz=1000", "device.lease_us=2000", "mofc.wait_for_physics_ms=0",
                      "mofc.velocity_estimator.difference.time_constant_ms=5", row.mode->override,
                      fmt::format("hand.v.free_motion_s={}", free_s)});
    row.runs[phase] = run_loopback(session, {.seconds = free_s + kVSeconds}).statistics;
  });

  Table table({{"tissue", "tissue", ""},
               {"mode", "mode", ""},
               {"t_free_s", "t_free s", "{:g}"},
               {"phases", "phases", "{:.0f}"},
               {"transparency_percent", "transp. %", "{:.2f}"},
               {"transparency_sd_percent", "± %", "{:.2f}"},
               {"change_percent", "change %", "{:+.2f}"},
               {"clamped_percent", "clamped %", "{:.1f}"},
               {"excess_reversals", "excess rev.", "{:.1f}"},
               {"most_excess_reversals", "most", "{:.0f}"},
               {"peak_force_n", "peak N", "{:.2f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"}});
  double first = kNaN;
  for (const Row& row : rows) {
    const auto phases = static_cast<double>(row.runs.size());
    double sum = 0.0;
    double sum2 = 0.0;
    double clamped = 0.0;
    double reversals = 0.0;
    double most_reversals = 0.0;
    double peak_newton = 0.0;
    double least_joule = 0.0;
    for (const RunStatistics& s : row.runs) {
      const double transparency = 100.0 * s.vector_transparency();
      const auto excess = static_cast<double>(s.excess_reversals());
      sum += transparency / phases;
      sum2 += transparency * transparency / phases;
      clamped += 100.0 * s.clamp_ratio() / phases;
      reversals += excess / phases;
      most_reversals = std::max(most_reversals, excess);
      peak_newton = std::max(peak_newton, s.maximum_force_newton());
      least_joule = std::min(least_joule, s.minimum_true_energy_joule());
    }
    if (row.free_s == 0.0) {
      if (&row != &rows.front()) table.add_gap();
      first = sum;
    }
    table.add({std::string(row.tissue->label), std::string(row.mode->label), row.free_s, phases,
               sum, std::sqrt(std::max(0.0, sum2 - sum * sum)), 100.0 * (sum / first - 1.0),
               clamped, reversals, most_reversals, peak_newton, 1e6 * least_joule});
  }
  return table;
}

void run(const BenchOptions& options) {
  const Table adversity = adversity_table(options.is_quick ? 4 : 100);
  std::printf(
      "%s\nEach run: 2 s, device at 1 kHz, a hand that seeks energy, 0.3 m/s at most unless said."
      "\nMin energy: least true energy of the device's port over all inner steps and seeds, never "
      "seen by the controller."
      "\nPeak, fallback (without the force of an answer), hand speed: the largest of all seeds; "
      "transparency (acting against asked) and clamped: their mean."
      "\nToo fast: ticks in which the hand was surely faster than mode guard assumes."
      "\nBites: the twin without a controller draws more than 1 mJ.\n",
      adversity.text().c_str());
  std::fflush(stdout);

  const Table history = history_table(options.is_quick);
  std::printf(
      "\n%s\nThe paper's tissues, device and clamp at 1 kHz, physics at 50 Hz, after t_free of "
      "free "
      "motion; mean and standard deviation over the phases of the physics at which the V begins. "
      "Change: against t_free = 0.\n",
      history.text().c_str());

  if (!options.csv_file.empty()) write_file(options.csv_file, adversity.csv());
  if (!options.json_file.empty()) {
    const nlohmann::ordered_json both{{"adversity", adversity.json()}, {"history", history.json()}};
    write_file(options.json_file, both.dump(2) + "\n");
  }
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("Energy given to the hand, for every controller mode and adversity, in lockstep.");
  palpate::bench::BenchOptions options;
  options.add_to(app);
  CLI11_PARSE(app, argc, argv);
  try {
    palpate::bench::run(options);
    return 0;
  } catch (const palpate::SetupError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
