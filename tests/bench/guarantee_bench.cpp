// guarantee_bench — can a hand extract energy? Every controller mode against every adversity of
// physics, network, scheduler, encoder and profile, with a hand that tries to, in lockstep; beside
// the run without any controller. And whether mode guard depends on the past.
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <atomic>
#include <chrono>
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
#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "device_node/monitor/force_monitor.h"
#include "tests/bench/bench_output.h"
#include "tests/support/adversity.h"

namespace palpate::bench {
namespace {

using test::AdverseResult;
using test::AdverseRun;

/// A run fails below this true energy: more than the rounding of the inner steps.
constexpr double kNegativeJoule = -1e-6;
/// The adversity has an effect if the run without a controller falls below this true energy.
constexpr double kBiteJoule = -1e-3;

struct Mode {
  const char* label;
  std::vector<std::string> overrides;
};
const Mode kNone{"none", {"mofc.controller=none", "device.monitor=off"}};
const Mode kPaper{"paper", {"mofc.mode=paper", "device.monitor=off"}};
const Mode kPaperIsotropic{
    "paper/√3",
    {"mofc.mode=paper", "mofc.paper_settings.friction=isotropic", "device.monitor=off"}};
const Mode kVector{"vector", {"mofc.mode=vector"}};
const Mode kGuard{"guard", {"mofc.mode=guard"}};

/// Of the simulated device; the profile agrees with it unless an adversity says otherwise.
struct Friction {
  const char* label;
  bool is_per_axis;
  std::vector<const Mode*> modes;  // the first one is the run without a controller
};
const Friction kFrictions[] = {
    {"isotropic", false, {&kNone, &kPaper, &kPaperIsotropic, &kVector, &kGuard}},
    {"per axis", true, {&kNone, &kPaper, &kVector, &kGuard}}};

struct Adversity {
  std::string label;
  AdverseRun run;
  double profile_ratio = 1.0;  // friction of the profile / true friction
  bool is_other_kind = false;  // the profile says isotropic for per axis (the mean), or vice versa
};

/// 0.1 N·s/m and 0.1 N, or a half and twice that on two of the axes.
std::vector<std::string> overrides_of(const Friction& friction, const Adversity& adversity) {
  const double ratio = adversity.profile_ratio;
  const auto isotropic = [](const std::string& path, double scale) {
    return std::vector<std::string>{fmt::format("{}.viscous_newton_s_per_m={}", path, 0.1 * scale),
                                    fmt::format("{}.coulomb_newton={}", path, 0.1 * scale)};
  };
  const auto per_axis = [](const std::string& path, double x, double y, double z) {
    const std::string axes = fmt::format("{{ x: {} y: {} z: {} }}", x, y, z);
    return std::vector<std::string>{
        fmt::format("{}.viscous_per_axis_newton_s_per_m={}", path, axes),
        fmt::format("{}.coulomb_per_axis_newton={}", path, axes)};
  };
  std::vector<std::string> overrides;
  const auto add = [&](const std::vector<std::string>& more) {
    overrides.insert(overrides.end(), more.begin(), more.end());
  };
  if (friction.is_per_axis) {
    add(per_axis("device.simulated", 0.05, 0.1, 0.2));
    add(adversity.is_other_kind
            ? isotropic("device.profile", 0.35 / 3.0 / 0.1)
            : per_axis("device.profile", 0.05 * ratio, 0.1 * ratio, 0.2 * ratio));
  } else {
    add(isotropic("device.simulated", 1.0));
    add(adversity.is_other_kind ? per_axis("device.profile", 0.1, 0.1, 0.1)
                                : isotropic("device.profile", ratio));
  }
  return overrides;
}

std::vector<std::string> on_physics_hops(const std::string& field) {
  return {"faults.tool_motion." + field, "faults.interaction." + field};
}

std::vector<Adversity> adversities() {
  std::vector<Adversity> all;
  const auto add = [&](const std::string& label, std::vector<std::string> overrides,
                       const char* physics = "honest") {
    overrides.push_back(std::string("adversary.physics=") + physics);
    all.push_back({label, {.overrides = std::move(overrides)}});
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
      "new_sessions");

  // what physics answers
  add("±peak square wave", {}, "square_wave");
  add("the same, no slew limit", {"device.slew_newton_per_s=0"}, "square_wave");
  add("peak along the velocity", {}, "push_along");
  add("the same, a third NaN (inproc)", {}, "not_a_number");
  all.back().run.links = LockstepLinks::kInproc;

  // hops 1 and 4, inside the tick, answers due within 0.5 ms; with hostile physics they matter
  add("answers 0.2…0.6 ms late",
      {"faults.force_command.delay_ms=0.2", "faults.force_command.jitter_ms=0.4"}, "push_along");
  add("answers lost 30 %", {"faults.force_command.loss_ratio=0.3"}, "push_along");
  add("states lost 30 %", {"faults.device_state.loss_ratio=0.3"}, "push_along");
  add("states 0…0.7 ms late", {"faults.device_state.jitter_ms=0.7"}, "push_along");

  // scheduler
  add("interval 0.5…1.5 T", {}, "push_along");
  all.back().run.overrides.emplace_back("adversary.tick_jitter_ratio=0.5");
  add("2 % of ticks 1…5 T late", {}, "push_along");
  all.back().run.overrides.emplace_back("adversary.late_tick_ratio=0.02");
  add("ticks skipped for 6 ms, 20/s", {"faults.device.skip={until_s: 0.006 every_s: 0.05}"},
      "push_along");
  add("2 % of switches 0…2 ms late",
      {"faults.device.late_switch_ratio=0.02", "faults.device.late_switch_us=2000"}, "push_along");

  // encoder
  for (const char* q_m : {"0", "55e-6", "5e-4"}) {
    add(fmt::format("encoder {:g} mm", 1e3 * std::stod(q_m)),
        {fmt::format("device.simulated.position_resolution_m={}", q_m),
         fmt::format("device.profile.position_resolution_m={}", q_m)},
        "push_along");
  }

  // outside the assumptions
  for (const int factor : {1, 2, 5}) {
    add(fmt::format("profile friction {}× the true", factor), {}, "everything");
    all.back().profile_ratio = factor;
  }
  add("profile with the other kind of friction", {}, "everything");
  all.back().is_other_kind = true;
  add("hand of 1 m/s, v_max 0.5",
      {"hand.hostile.v_max_m_per_s=1", "device.profile.position_resolution_m=0",
       "device.simulated.position_resolution_m=0", "mofc.guard_settings.credit_cap_joule=10"},
      "everything");
  add("hand of 2 m/s, v_max 0.25",
      {"hand.hostile.v_max_m_per_s=2", "mofc.guard_settings.v_max_m_per_s=0.25",
       "device.profile.position_resolution_m=0", "device.simulated.position_resolution_m=0",
       "mofc.guard_settings.credit_cap_joule=10"},
      "everything");
  return all;
}

/// The worst and the mean of the seeds of one row.
struct Summary {
  int seeds = 0;
  int negative = 0;
  double least_joule = 0.0;
  double peak_newton = 0.0;
  double largest_jump_newton = 0.0;
  double longest_fallback_s = 0.0;
  double top_speed_m_per_s = 0.0;
  std::uint64_t too_fast_ticks = 0;
  std::uint64_t monitor_reductions = 0;
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
    largest_jump_newton = std::max(largest_jump_newton, result.device.largest_jump_newton);
    longest_fallback_s = std::max(longest_fallback_s, s.longest_fallback_s());
    top_speed_m_per_s = std::max(top_speed_m_per_s, result.top_speed_m_per_s);
    too_fast_ticks += result.mofc.too_fast_ticks;
    monitor_reductions += result.device.monitor_reductions;
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

/// Runs all jobs on as many threads as there are processors; rethrows an exception of a job.
void in_parallel(std::size_t jobs, const std::function<void(std::size_t)>& job) {
  Steps steps(jobs);
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::mutex failure_mutex;
  const auto work = [&] {
    try {
      for (std::size_t i = next++; i < jobs; i = next++) {
        job(i);
        steps.next();
      }
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

Table adversity_table(int seeds, const std::vector<std::string>& more_overrides) {
  constexpr const char* kPhysicsRates[] = {"1000", "50"};
  struct Row {
    const Adversity* adversity;
    const Friction* friction;
    const char* physics_hz;
    const Mode* mode;
    Summary summary;
  };
  const std::vector<Adversity> all = adversities();
  std::vector<Row> rows;
  for (const Adversity& adversity : all) {
    for (const Friction& friction : kFrictions) {
      for (const char* physics_hz : kPhysicsRates) {
        for (const Mode* mode : friction.modes) {
          // pools for isotropic friction need a profile with isotropic friction
          if (adversity.is_other_kind && mode == &kPaperIsotropic) continue;
          rows.push_back({&adversity, &friction, physics_hz, mode, {}});
        }
      }
    }
  }
  in_parallel(rows.size(), [&](std::size_t i) {
    Row& row = rows[i];
    AdverseRun run = row.adversity->run;
    const auto add = [&](const std::vector<std::string>& more) {
      run.overrides.insert(run.overrides.end(), more.begin(), more.end());
    };
    add(overrides_of(*row.friction, *row.adversity));
    add({fmt::format("physics.rate_hz={}", row.physics_hz)});
    add(row.mode->overrides);
    add(more_overrides);
    for (int seed = 1; seed <= seeds; ++seed) {
      row.summary.add(test::run_adverse(run, static_cast<std::uint64_t>(seed)));
    }
  });

  Table table({{"adversity", "adversity", ""},
               {"friction", "friction", ""},
               {"physics_hz", "physics Hz", ""},
               {"mode", "mode", ""},
               {"seeds", "seeds", "{:.0f}"},
               {"negative_runs", "below −1 µJ", "{:.0f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"},
               {"peak_force_n", "peak N", "{:.2f}"},
               {"largest_jump_n", "jump N", "{:.2f}"},
               {"longest_fallback_ms", "fallback ms", "{:.1f}"},
               {"transparency_percent", "transp. %", "{:.1f}"},
               {"clamped_percent", "clamped %", "{:.1f}"},
               {"top_speed_m_per_s", "hand m/s", "{:.2f}"},
               {"too_fast_ticks", "too fast", "{:.0f}"},
               {"bites", "effect", ""}});
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    const Summary& s = row.summary;
    const bool is_twin = row.mode == &kNone;
    if (i > 0 && row.adversity != rows[i - 1].adversity) table.add_gap();
    table.add({row.adversity->label, std::string(row.friction->label), std::string(row.physics_hz),
               std::string(row.mode->label), static_cast<double>(s.seeds),
               static_cast<double>(s.negative), 1e6 * s.least_joule, s.peak_newton,
               s.largest_jump_newton, 1e3 * s.longest_fallback_s,
               Summary::mean_percent(s.transparency_sum, s.transparency_runs),
               Summary::mean_percent(s.clamped_sum, s.clamped_runs), s.top_speed_m_per_s,
               static_cast<double>(s.too_fast_ticks),
               std::string(!is_twin                     ? ""
                           : s.least_joule < kBiteJoule ? "yes"
                                                        : "no")});
  }
  return table;
}

// --- monitor ------------------------------------------------------------------------------------

/// Clamps that lie, without and with the monitor; friction that the profile overestimates, without
/// and with a hands-off check at the start. Mode guard, physics at 1 kHz.
Table monitor_table(int seeds, const std::vector<std::string>& more_overrides) {
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
                       {"full force 0.2 s of every 0.5 s", "mostly_right"}};
  struct Row {
    std::string label;
    const Friction* friction;
    const char* protection;
    AdverseRun run;
    Summary summary;
  };
  std::vector<Row> rows;
  const auto add = [&](const std::string& label, const Friction& friction, double profile_ratio,
                       const char* protection, AdverseRun run) {
    for (const std::string& override :
         overrides_of(friction, {.label = label, .run = {}, .profile_ratio = profile_ratio})) {
      run.overrides.push_back(override);
    }
    for (const auto* more : {&kGuard.overrides, &more_overrides}) {
      run.overrides.insert(run.overrides.end(), more->begin(), more->end());
    }
    rows.push_back({label, &friction, protection, std::move(run), {}});
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
  in_parallel(rows.size(), [&](std::size_t i) {
    for (int seed = 1; seed <= seeds; ++seed) {
      rows[i].summary.add(test::run_adverse(rows[i].run, static_cast<std::uint64_t>(seed)));
    }
  });

  Table table({{"case", "case", ""},
               {"friction", "friction", ""},
               {"protection", "beside the clamp", ""},
               {"seeds", "seeds", "{:.0f}"},
               {"negative_runs", "below −1 µJ", "{:.0f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"},
               {"peak_force_n", "peak N", "{:.2f}"},
               {"transparency_percent", "transp. %", "{:.2f}"},
               {"monitor_reductions", "reduced", "{:.0f}"}});
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& [label, friction, protection, run, s] = rows[i];
    if (i > 0 && label != rows[i - 1].label) table.add_gap();
    table.add({label, std::string(friction->label), std::string(protection),
               static_cast<double>(s.seeds), static_cast<double>(s.negative), 1e6 * s.least_joule,
               s.peak_newton, Summary::mean_percent(s.transparency_sum, s.transparency_runs),
               static_cast<double>(s.monitor_reductions)});
  }
  return table;
}

/// Time of one tick of the monitor [µs]: a reading, a command, a switch. The best of 20 rounds.
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

// --- history ------------------------------------------------------------------------------------

/// Time for the V after the free motion, and for the hand to come to rest.
constexpr double kVSeconds = 3.0;

/// Soft, rigid and mixed tissue of the paper after increasing lengths of free motion: device and
/// clamp at 1 kHz, physics at 50 Hz, with its contact model or its held force; and all at 50 Hz.
/// The V begins at many phases of the physics, because one tick earlier or later already changes
/// the chatter: the remaining difference between the means is the influence of the past.
Table history_table(bool is_quick, const std::vector<std::string>& more_overrides) {
  constexpr std::size_t kLongPhases = 4;  // after 600 s
  constexpr std::size_t kPhases = 20;
  constexpr double kPhysicsPeriodSeconds = 0.02;
  struct Tissue {
    const char* label;
    const char* session;
  };
  constexpr Tissue kTissues[] = {
      {"soft", "paper_soft"}, {"rigid", "paper_rigid"}, {"mixed", "paper_mixed"}};
  struct Rates {
    const char* label;
    std::vector<std::string> overrides;
    std::size_t fewer;  // phases
  };
  const std::vector<std::string> fast{"device.rate_hz=1000", "device.lease_us=2000",
                                      "mofc.wait_for_physics_ms=0",
                                      "mofc.velocity_estimator={ kalman_acceleration {} }"};
  std::vector<std::string> fast_local = fast;
  fast_local.emplace_back("mofc.interaction=local");
  const Rates kRates[] = {
      {"1000/50", fast_local, 1}, {"1000/50 held", fast, 1}, {"50/50 held", {}, 4}};
  struct Row {
    const Tissue* tissue;
    const Rates* rates;
    const Mode* mode;
    double free_s;
    std::vector<RunStatistics> runs;
  };
  std::vector<Row> rows;
  for (const Rates& rates : kRates) {
    for (const Tissue& tissue : kTissues) {
      for (const Mode* mode : {&kPaper, &kGuard}) {
        for (const double free_s : {0.0, 14.0, 40.0, 600.0}) {
          const bool is_long = free_s > 100.0;
          const std::size_t phases = (is_long ? kLongPhases : kPhases) / rates.fewer;
          const std::size_t quick_phases = is_long ? 1 : 5;
          rows.push_back({&tissue, &rates, mode, free_s,
                          std::vector<RunStatistics>(is_quick ? quick_phases : phases)});
        }
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
    std::vector<std::string> overrides = row.rates->overrides;
    const auto add = [&](const std::vector<std::string>& more) {
      overrides.insert(overrides.end(), more.begin(), more.end());
    };
    add(row.mode->overrides);
    add({fmt::format("hand.v.free_motion_s={}", free_s)});
    add(more_overrides);
    const Session session =
        load_session(sessions / (std::string(row.tissue->session) + ".txtpb"), overrides);
    row.runs[phase] = run_loopback(session, {.seconds = free_s + kVSeconds}).statistics;
  });

  Table table({{"rates_hz", "device/physics Hz", ""},
               {"tissue", "tissue", ""},
               {"mode", "mode", ""},
               {"t_free_s", "t_free s", "{:g}"},
               {"phases", "phases", "{:.0f}"},
               {"transparency_percent", "transp. %", "{:.2f}"},
               {"transparency_sd_percent", "± one run", "{:.2f}"},
               {"change_percent", "change %", "{:+.2f}"},
               {"change_error_percent", "± mean", "{:.2f}"},
               {"largest_change_percent", "one run %", "{:.1f}"},
               {"clamped_percent", "clamped %", "{:.1f}"},
               {"excess_reversals", "excess rev.", "{:.1f}"},
               {"change_excess_reversals", "change", "{:+.1f}"},
               {"most_excess_reversals", "most", "{:.0f}"},
               {"peak_force_n", "peak N", "{:.2f}"},
               {"min_true_energy_uj", "min energy µJ", "{:.1f}"}});
  struct Means {
    double transparency = 0.0;  // %
    double sd = 0.0;            // over the phases
    double phases = 0.0;
    double reversals = 0.0;
  };
  Means first;
  const Row* first_row = nullptr;
  for (const Row& row : rows) {
    Means m{.phases = static_cast<double>(row.runs.size())};
    double sum2 = 0.0;
    double clamped = 0.0;
    double most_reversals = 0.0;
    double peak_newton = 0.0;
    double least_joule = 0.0;
    for (const RunStatistics& s : row.runs) {
      const double transparency = 100.0 * s.vector_transparency();
      const auto excess = static_cast<double>(s.excess_reversals());
      m.transparency += transparency / m.phases;
      sum2 += transparency * transparency / m.phases;
      clamped += 100.0 * s.clamp_ratio() / m.phases;
      m.reversals += excess / m.phases;
      most_reversals = std::max(most_reversals, excess);
      peak_newton = std::max(peak_newton, s.maximum_force_newton());
      least_joule = std::min(least_joule, s.minimum_true_energy_joule());
    }
    m.sd = std::sqrt(std::max(0.0, sum2 - m.transparency * m.transparency));
    if (row.free_s == 0.0) {
      if (first_row != nullptr) table.add_gap();
      first = m;
      first_row = &row;
    }
    // each run against that at the same phase without history
    double largest_change = 0.0;
    const std::size_t stride = first_row->runs.size() / row.runs.size();
    for (std::size_t phase = 0; phase < row.runs.size(); ++phase) {
      const double before = first_row->runs[phase * stride].vector_transparency();
      const double change = row.runs[phase].vector_transparency() / before - 1.0;
      largest_change = std::max(largest_change, 100.0 * std::abs(change));
    }
    const double change_error =
        100.0 / first.transparency *
        std::hypot(first.sd / std::sqrt(first.phases), m.sd / std::sqrt(m.phases));
    table.add({std::string(row.rates->label), std::string(row.tissue->label),
               std::string(row.mode->label), row.free_s, m.phases, m.transparency, m.sd,
               100.0 * (m.transparency / first.transparency - 1.0),
               row.free_s == 0.0 ? kNaN : change_error, row.free_s == 0.0 ? kNaN : largest_change,
               clamped, m.reversals, m.reversals - first.reversals, most_reversals, peak_newton,
               1e6 * least_joule});
  }
  return table;
}

struct GuaranteeOptions {
  BenchOptions bench;
  std::vector<std::string> overrides;  // of every session
  std::string only;                    // adversity, monitor, history or all ("")
};

void run(const GuaranteeOptions& options) {
  const BenchOptions& bench = options.bench;
  nlohmann::ordered_json json;
  const auto is_wanted = [&](const char* table) {
    return options.only.empty() || options.only == table;
  };
  if (is_wanted("adversity")) {
    const Table adversity = adversity_table(bench.is_quick ? 3 : 50, options.overrides);
    std::printf(
        "%s\nEach run: 2 s, device at 1 kHz, a hand that tries to extract energy, 0.3 m/s at most "
        "unless stated."
        "\nFriction of the device: 0.1 N·s/m and 0.1 N, isotropic; or per axis, x 0.05, y 0.1, z "
        "0.2 of both."
        "\nMin energy: least true energy of the device's port over all inner steps and seeds, "
        "never "
        "seen by the controller."
        "\nPeak, fallback (without the force of an answer), hand speed: the largest of all seeds; "
        "transparency (rendered against requested) and clamped: their mean."
        "\nToo fast: ticks in which the hand was certainly faster than mode guard assumes."
        "\nEffect: the run without a controller loses more than 1 mJ.\n",
        adversity.text().c_str());
    std::fflush(stdout);
    write_table(bench, adversity.csv());
    json["adversity"] = adversity.json();
  }
  if (is_wanted("monitor")) {
    const Table monitor = monitor_table(bench.is_quick ? 5 : 50, options.overrides);
    std::printf(
        "\n%s\nMode guard, physics that pushes along the motion or changes its law; else as "
        "above."
        "\nReduced: commands that the monitor of device_node reduced."
        "\nOne tick of the monitor: %.2f µs with isotropic friction, %.2f µs per axis.\n",
        monitor.text().c_str(), monitor_tick_us(false), monitor_tick_us(true));
    std::fflush(stdout);
    json["monitor"] = monitor.json();
  }
  if (is_wanted("history")) {
    const Table history = history_table(bench.is_quick, options.overrides);
    std::printf(
        "\n%s\nThe paper's tissues after t_free of free motion; means over the phases of the "
        "physics "
        "at which the V begins."
        "\n± one run: standard deviation over the phases, the scatter of single runs. "
        "Change "
        "of the mean: against t_free = 0, ± its standard error."
        "\nOne run: largest change of a single run against the one at the same phase with t_free = "
        "0.\n",
        history.text().c_str());
    json["history"] = history.json();
  }
  write_json(bench, json);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app(
      "Energy extracted by the hand, for every controller mode and adversity, in lockstep.");
  palpate::bench::GuaranteeOptions options;
  app.add_option("--only", options.only, "one of the three tables")
      ->check(CLI::IsMember({"adversity", "monitor", "history"}));
  app.add_option("--set", options.overrides, "path=value: overrides a field of every session");
  return palpate::bench::run_bench(app, options.bench, argc, argv,
                                   [&] { palpate::bench::run(options); });
}
