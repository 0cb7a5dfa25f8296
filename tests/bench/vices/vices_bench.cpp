// SPDX-License-Identifier: Apache-2.0
// The drivers of real devices and the vices of hardware: the table of docs/devices.md, and many
// random runs of hardware with vices in memory.
//   vices_bench            the table, as Markdown
//   vices_bench RUNS       so many random runs within the claim; a tenth as many with simple books,
//                          the twin, and beyond the claim
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/core/random.h"
#include "device_node/simulation/hand.h"
#include "tests/support/device_node_bench.h"
#include "tests/support/wired/hostile_commands.h"
#include "tests/support/wired/viced_runs.h"
#include "tests/support/wired/wired_on_bench.h"

namespace palpate::bench {
namespace {

using namespace std::chrono_literals;
using device::WireFault;
using test::WiredDriver;

constexpr double kRoundingJoule = 1e-6;
constexpr double kFrom_s = 0.5;
constexpr double kLength_s = 0.5;
// Of what is there as the device is enabled: after it was opened, and until then at most.
constexpr double kOpened_s = 1e-4;
constexpr double kEnabled_s = 30.0;

struct Vice {
  const char* name;
  std::vector<WireFault> kinds;
  Duration stall{};     ///< of the process, every 50 ms
  Duration watchdog{};  ///< 0: that of the emulator
  Duration latency{};   ///< that the session names
  enum Hold { kHostile, kStill, kNobody } hold = kHostile;
};

const std::vector<Vice>& vices() {
  static const std::vector<Vice> all{
      {"none", {}},
      {"no watchdog", {WireFault::kNoWatchdog}},
      {"the same, stalls of 20 ms", {WireFault::kNoWatchdog}, 20ms},
      {"watchdog of 20 ms, stalls of 60 ms", {WireFault::kWatchdog20}, 60ms},
      {"watchdog of 100 ms, stalls of 60 ms", {WireFault::kWatchdog100}, 60ms},
      {"watchdog of 500 ms, stalls of 60 ms", {WireFault::kWatchdog500}, 60ms},
      {"positions and forces up to 1 ms late, named", {WireFault::kLate}, {}, {}, 2100us},
      {"the same, not named", {WireFault::kLate}},
      {"currents held while the arm turns", {WireFault::kTurning}},
      {"a force ends after 0.5 ms", {WireFault::kOneTick}},
      {"motors of the wrong sign", {WireFault::kReversed}},
      {"motors twice as strong", {WireFault::kStrong}},
      {"positions stand still", {WireFault::kStuck}},
      {"counters at 0", {WireFault::kEncoderZero}},
      {"power cycle", {WireFault::kPowerCycle}},
      {"none at the start", {}, {}, {}, {}, Vice::kStill},
      {"none at the start, nobody holds it", {}, {}, {}, {}, Vice::kNobody},
      {"wrong sign at the start", {WireFault::kReversed}, {}, {}, {}, Vice::kStill},
      {"the same, nobody holds it", {WireFault::kReversed}, {}, {}, {}, Vice::kNobody},
      {"twice as strong at the start", {WireFault::kStrong}, {}, {}, {}, Vice::kStill},
      {"the same, nobody holds it", {WireFault::kStrong}, {}, {}, {}, Vice::kNobody},
      {"positions stand still at the start", {WireFault::kStuck}, {}, {}, {}, Vice::kStill},
      {"no supply at the start", {WireFault::kNoSupply}, {}, {}, {}, Vice::kStill},
      {"no supply", {WireFault::kNoSupply}},
      {"calibration lost", {WireFault::kUncalibrated}},
      {"answers doubled", {WireFault::kDoubled}},
      {"unplugged", {WireFault::kUnplugged}},
      {"garbage", {WireFault::kGarbage}},
      {"short answers", {WireFault::kShort}}};
  return all;
}

struct Wired {
  const char* name;
  WiredDriver driver;
  double resolution_m;
  bool is_exact;  ///< the hand's position reaches the driver's own encoders unrounded
};
constexpr Wired kWired[] = {{"haply_inverse", WiredDriver::kHaply, 55e-6, false},
                            {"hapi", WiredDriver::kHapi, 1e-4, true},
                            {"falcon", WiredDriver::kFalcon, 1.1e-4, true},
                            {"wooden", WiredDriver::kWooden, 1.1e-4, true}};

/// Whether its emulator has such a fault.
bool has(WiredDriver driver, WireFault kind) {
  const bool is_haply = driver == WiredDriver::kHaply;
  const bool is_hapi = driver == WiredDriver::kHapi;
  const bool is_wooden = driver == WiredDriver::kWooden;
  switch (kind) {
    case WireFault::kTurning:
    case WireFault::kEncoderZero:
      return !is_haply && !is_hapi;
    case WireFault::kPowerCycle:
      return is_hapi || is_wooden;
    case WireFault::kUncalibrated:
    case WireFault::kDoubled:
      return is_haply;
    default:
      return true;
  }
}

void print_row(const Wired& wired, const Vice& vice) {
  test::WiredSpec spec{.side = {}, .driver = wired.driver, .faults = {}};
  DeviceConfig& config = spec.side.device;
  config = test::device_config();
  config.longest_lease = 10ms;
  config.profile.position_resolution_m = wired.resolution_m;
  config.monitor = {.is_on = true, .v_max_m_per_s = 0.5};
  config.accepts_no_motor_watchdog = true;
  config.latency = vice.latency;
  spec.side.simulated.position_resolution_m = wired.is_exact ? 0.0 : wired.resolution_m;
  spec.side.hand = {.mass_kg = 0.1,
                    .stiffness_newton_per_m = 2000.0,
                    .damping_newton_s_per_m = 40.0,
                    .path = HostilePath{.radius_m = 0.012, .v_max_m_per_s = 0.25}};
  const bool is_at_start = vice.hold != Vice::kHostile;
  config.skips_motor_check = !is_at_start;
  if (vice.hold == Vice::kStill) spec.side.hand.path = HoldPath{};
  if (vice.hold == Vice::kNobody) spec.side.hand = device::nobody();
  for (const WireFault kind : vice.kinds) {
    spec.faults.push_back({.kind = kind,
                           .from_s = is_at_start ? kOpened_s : kFrom_s,
                           .length_s = is_at_start ? kEnabled_s : kLength_s});
  }
  test::DeviceNodeBench<test::WiredOnBench> bench(config, spec);
  bench.node.acknowledge();
  test::HostileCommands commands(2, 3.3);
  double most_unbooked = 0.0;
  bench.on_state = [&](const DeviceState& state) {
    most_unbooked = std::max(most_unbooked,
                             bench.node.monitor_joule() - bench.device.true_state().energy_joule);
    bench.send_answer(state.header.session_id, state.header.sequence,
                      commands.next(state.hand_position_m));
  };
  int fault_ticks = 0;
  const TimePoint end(is_at_start ? from_seconds(kEnabled_s) : Duration(1500ms));
  for (int tick = 0; bench.clock.now() < end; ++tick) {
    if (is_at_start && bench.node.phase() != DevicePhase::kChecking) break;
    if (vice.stall > 0ms && tick % 50 == 49) bench.clock.advance(vice.stall);
    // each release of a silent device takes a second of real time
    if (bench.node.has_fault() && ++fault_ticks > 10) bench.clock.advance(100ms);
    bench.tick();
  }
  Duration pushed{};
  for (const device::FaultOutcome& outcome : bench.device.outcomes()) {
    pushed = std::max(pushed, outcome.pushed_for);
  }
  const DeviceCounters counters = bench.node.counters();
  const bool is_fault = counters.device_faults > 0;
  std::string until = "–";
  if (is_fault && !is_at_start) {
    char text[32];
    std::snprintf(text, sizeof(text), "%.1f ms", 1e3 * to_seconds(pushed));
    until = text;
  }
  std::string told = is_fault ? name(counters.last_fault) : "–";
  if (is_at_start && !is_fault) {
    char text[64];
    std::snprintf(text, sizeof(text), "%s, gain ≥ %.2f", name(bench.node.phase()),
                  counters.checked_motor_gain);
    told = text;
  }
  if (!is_fault && counters.frozen_ticks > 0) told = "position stands still";
  std::printf("| %s | %s | %.0f | %.0f | %s | %s |\n", wired.name, vice.name,
              std::round(1e6 * bench.device.true_state().minimum_energy_joule) + 0.0,
              1e6 * most_unbooked, until.c_str(), told.c_str());
  std::fflush(stdout);
}

void print_table() {
  std::printf(
      "| driver | vice | least true energy, µJ | books above it, µJ | zero force after | told |\n"
      "|---|---|---|---|---|---|\n");
  for (const Wired& wired : kWired) {
    for (const Vice& vice : vices()) {
      if (std::all_of(vice.kinds.begin(), vice.kinds.end(),
                      [&](WireFault kind) { return has(wired.driver, kind); })) {
        print_row(wired, vice);
      }
    }
  }
}

void print_runs(const char* what, std::uint64_t runs,
                test::VicedRun (*make_run)(std::uint64_t seed),
                test::Books books = test::Books::kTrue) {
  double least = 0.0;
  double unbooked = 0.0;
  std::uint64_t leaks = 0;
  std::uint64_t faults = 0;
  std::uint64_t pushed = 0;    // runs with a force above f_co
  std::vector<double> beyond;  // of each run, the share of its ticks with a force above f_co
  std::vector<double> newton;
  std::vector<double> joule;
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    const test::VicedResult result = test::run_with_vices(make_run(seed), books, seed);
    least = std::min(least, result.least_true_joule);
    unbooked = std::max(unbooked, result.most_unbooked_joule);
    if (result.least_true_joule < -kRoundingJoule) ++leaks;
    faults += result.faults;
    if (result.ticks_beyond_friction > 0) ++pushed;
    beyond.push_back(static_cast<double>(result.ticks_beyond_friction) /
                     static_cast<double>(result.ticks));
    newton.push_back(result.mean_force_newton);
    joule.push_back(result.most_true_joule);
    if (seed % 10'000 == 0) {
      std::fprintf(stderr, "%s: %llu runs, so far %.3g µJ\n", what,
                   static_cast<unsigned long long>(seed), 1e6 * least);
    }
  }
  const auto quantile = [](std::vector<double>& values, double q) {
    const auto nth =
        values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
  };
  std::printf("| %s | %llu | %.1f | %llu | %.0f | %llu |", what,
              static_cast<unsigned long long>(runs), 1e6 * least + 0.0,
              static_cast<unsigned long long>(leaks), 1e6 * unbooked + 0.0,
              static_cast<unsigned long long>(faults));
  std::printf(" %.1f %% | %.1f, %.0f %% | %.2f, %.2f N | %.1f, %.0f mJ |\n",
              1e2 * static_cast<double>(pushed) / static_cast<double>(runs),
              1e2 * quantile(beyond, 0.5), 1e2 * quantile(beyond, 0.95), quantile(newton, 0.5),
              quantile(newton, 0.95), 1e3 * quantile(joule, 0.5), 1e3 * quantile(joule, 0.95));
  std::fflush(stdout);
}

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  if (argc < 2) {
    palpate::bench::print_table();
    return 0;
  }
  char* end = nullptr;
  const std::uint64_t runs = std::strtoull(argv[1], &end, 10);
  if (argc > 2 || *end != '\0' || runs == 0) {
    std::fprintf(stderr, "vices_bench: \"%s\": give a number of runs above 0, or nothing\n",
                 argv[1]);
    return 2;
  }
  using palpate::bench::print_runs;
  using palpate::test::Books;
  std::printf(
      "| runs | number | least true energy, µJ | runs below −1 µJ | books above it, µJ | faults | "
      "runs with a force above f_co | ticks above f_co | mean force | most energy of the hand |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n");
  print_runs("within the claim", runs, palpate::test::random_run_within_the_claim);
  const std::uint64_t fewer = std::max<std::uint64_t>(1, runs / 10);
  print_runs("the same, simple books", fewer, palpate::test::random_run_within_the_claim,
             Books::kSimple);
  print_runs("beyond it", fewer, palpate::test::random_run_with_stalls);
  return 0;
}
