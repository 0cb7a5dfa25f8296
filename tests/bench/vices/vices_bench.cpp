// SPDX-License-Identifier: Apache-2.0
// The drivers of real devices and the vices of hardware: the table of docs/devices.md, and many
// random runs of hardware with vices in memory.
//   vices_bench            the table, as Markdown: the worst of five hands each
//   vices_bench RUNS       so many random runs within the claim; a tenth as many with simple books,
//                          the twin, and beyond the claim
//   vices_bench --pairs RUNS   so many runs of each driver over its wire with two vices at once,
//                          drawn at random; status 1 if one gave energy or booked what was not
//                          there
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/random.h"
#include "device_node/simulation/hand.h"
#include "tests/support/device_node_bench.h"
#include "tests/support/machine/machine.h"
#include "tests/support/wired/hostile_commands.h"
#include "tests/support/wired/viced_runs.h"
#include "tests/support/wired/wired_on_bench.h"

namespace palpate::bench {
namespace {

using namespace std::chrono_literals;
using device::WireFault;
using test::WiredDriver;

constexpr double kRoundingJoule = 1e-6;
constexpr double kAfterwards_s = 0.5;
// Of what is there as the device is enabled: after it was opened, and until then at most.
constexpr double kOpened_s = 1e-4;
constexpr double kEnabled_s = 30.0;
constexpr int kSleepTick = 600;
constexpr std::uint64_t kHands = 5;
constexpr Duration kLate = 4100us;  // of a vice of that name, and the step in which it is emulated

struct Vice {
  const char* name;
  std::vector<WireFault> kinds;
  Duration stall{};     ///< of the process, every 50 ms
  Duration watchdog{};  ///< 0: that of the emulator
  Duration latency{};   ///< that the session names
  enum Hold { kHostile, kStill, kNobody } hold = kHostile;
  bool has_dead_man_button = false;  ///< held until the end, and let go once before
  Duration sleep{};                  ///< of the machine, once
  bool is_accepted = true;           ///< forces above f_co, by the session
  bool is_acknowledged_again = false;
  double from_s = 0.5;
  double length_s = 0.5;
};

const std::vector<Vice>& vices() {
  static const std::vector<Vice> all{
      {"none", {}},
      {"no watchdog", {WireFault::kNoWatchdog}},
      {"the same, stalls of 20 ms", {WireFault::kNoWatchdog}, 20ms},
      {"watchdog of 20 ms, stalls of 60 ms", {WireFault::kWatchdog20}, 60ms},
      {"watchdog of 100 ms, stalls of 60 ms", {WireFault::kWatchdog100}, 60ms},
      {"watchdog of 500 ms, stalls of 60 ms", {WireFault::kWatchdog500}, 60ms},
      {"positions and forces up to 2 ms late, named", {WireFault::kLate}, {}, {}, kLate},
      {"the same, not named", {WireFault::kLate}},
      {"currents held while the arm turns", {WireFault::kTurning}},
      {.name = "the machine sleeps for 0.3 s", .kinds = {}, .sleep = 300ms},
      {.name = "the same, no watchdog", .kinds = {WireFault::kNoWatchdog}, .sleep = 300ms},
      {.name = "no watchdog, held currents, stalls of 200 ms, not accepted",
       .kinds = {WireFault::kNoWatchdog, WireFault::kTurning},
       .stall = 200ms,
       .is_accepted = false},
      {"a force ends after 0.5 ms", {WireFault::kOneTick}},
      {"motors of the wrong sign", {WireFault::kReversed}},
      {"motors twice as strong", {WireFault::kStrong}},
      {"positions stand still", {WireFault::kStuck}},
      {"counters at 0", {WireFault::kEncoderZero}},
      {"power cycle", {WireFault::kPowerCycle}},
      {"nothing compensates the arm's weight", {WireFault::kWeight}},
      {"the grip is gone, its button held",
       {WireFault::kGripGone},
       {},
       {},
       {},
       Vice::kHostile,
       true},
      {"the grip is off, its button held", {WireFault::kGripOff}, {}, {}, {}, Vice::kHostile, true},
      {"the grip stands still, its button held",
       {WireFault::kGripFrozen},
       {},
       {},
       {},
       Vice::kHostile,
       true},
      {"late, named, and held currents", {WireFault::kLate, WireFault::kTurning}, {}, {}, kLate},
      {"late, named, no watchdog, stalls of 20 ms",
       {WireFault::kLate, WireFault::kNoWatchdog},
       20ms,
       {},
       kLate},
      {"no watchdog, unplugged", {WireFault::kNoWatchdog, WireFault::kUnplugged}},
      {"no watchdog, no answers", {WireFault::kNoWatchdog, WireFault::kSilent}},
      {"positions stand still, held currents", {WireFault::kStuck, WireFault::kTurning}},
      {"none at the start", {}, {}, {}, {}, Vice::kStill},
      {"none at the start, nobody holds it", {}, {}, {}, {}, Vice::kNobody},
      {"wrong sign at the start", {WireFault::kReversed}, {}, {}, {}, Vice::kStill},
      {"the same, nobody holds it", {WireFault::kReversed}, {}, {}, {}, Vice::kNobody},
      {"twice as strong at the start", {WireFault::kStrong}, {}, {}, {}, Vice::kStill},
      {"the same, nobody holds it", {WireFault::kStrong}, {}, {}, {}, Vice::kNobody},
      {"positions stand still at the start", {WireFault::kStuck}, {}, {}, {}, Vice::kStill},
      {"no supply at the start", {WireFault::kNoSupply}, {}, {}, {}, Vice::kStill},
      {"the board is set up elsewhere", {WireFault::kSetUpAnywhere}},
      {"weight at the start, nobody holds it", {WireFault::kWeight}, {}, {}, {}, Vice::kNobody},
      {"no supply", {WireFault::kNoSupply}},
      {"calibration lost", {WireFault::kUncalibrated}},
      {"answers doubled", {WireFault::kDoubled}},
      {"one answer in 20 is lost", {WireFault::kDropped}},
      {"answers in two transfers", {WireFault::kPartial}},
      {"two answers in one transfer", {WireFault::kMerged}},
      {"not in the service's list", {WireFault::kUnlisted}},
      {"answers of another device", {WireFault::kWrongId}},
      {"no answers", {WireFault::kSilent}},
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
    case WireFault::kPartial:
      return !is_haply;
    case WireFault::kEncoderZero:
      return !is_haply && !is_hapi;
    case WireFault::kSetUpAnywhere:
      return is_hapi;
    case WireFault::kPowerCycle:
      return is_hapi || is_wooden;
    case WireFault::kUncalibrated:
    case WireFault::kGripGone:
    case WireFault::kGripOff:
    case WireFault::kGripFrozen:
    case WireFault::kUnlisted:
      return is_haply;
    case WireFault::kWrongId:
      return is_haply || is_hapi;
    default:
      return true;
  }
}

bool is_of_motors(WireFault kind) {
  return kind == WireFault::kNoWatchdog || kind == WireFault::kTurning;
}

struct Outcome {
  double least_joule = 0.0;
  double most_unbooked_joule = 0.0;
  double top_speed_m_per_s = 0.0;
  double mean_newton = 0.0;
  std::uint64_t ticks_beyond_friction = 0;
  Duration pushed{};  ///< the motors, in the vice
  DeviceCounters counters;
  DevicePhase phase{};
};

Outcome run(const Wired& wired, const Vice& vice, std::uint64_t seed) {
  test::WiredSpec spec{.side = {}, .driver = wired.driver, .faults = {}, .seed = seed};
  DeviceConfig& config = spec.side.device;
  config = test::device_config();
  config.longest_lease = 10ms;
  config.profile.position_resolution_m = wired.resolution_m;
  config.monitor = {.is_on = true, .v_max_m_per_s = 0.5};
  config.accepts_no_motor_watchdog = vice.is_accepted;
  config.latency = vice.latency;
  spec.side.simulated.position_resolution_m = wired.is_exact ? 0.0 : wired.resolution_m;
  spec.side.hand = {.mass_kg = 0.1,
                    .stiffness_newton_per_m = 2000.0,
                    .damping_newton_s_per_m = 40.0,
                    .path = HostilePath{.radius_m = 0.012, .v_max_m_per_s = 0.25}};
  const bool is_at_start = vice.hold != Vice::kHostile;
  config.skips_motor_check = !is_at_start;
  if (vice.has_dead_man_button) {
    config.dead_man_button = 1;
    spec.side.hand.presses = {{.button = 1, .from_s = 0.1, .until_s = 9.0}};
  }
  if (vice.hold == Vice::kStill) spec.side.hand.path = HoldPath{};
  if (vice.hold == Vice::kNobody) spec.side.hand = device::nobody();
  for (const WireFault kind : vice.kinds) {
    // motors are what they are from the start: where nothing reaches them, nothing changes them
    const bool is_always = is_at_start || is_of_motors(kind);
    const bool is_of_opening = kind == WireFault::kSetUpAnywhere;
    spec.faults.push_back({.kind = kind,
                           .from_s = is_of_opening ? 0.0
                                     : is_always   ? kOpened_s
                                                   : vice.from_s,
                           .length_s = is_always ? kEnabled_s : vice.length_s});
  }
  // a silent device costs some of these, in real time
  spec.limit = vice.is_acknowledged_again ? 200ms : test::patience(100ms);
  test::DeviceNodeBench<test::WiredOnBench> bench(config, spec);
  bench.node.acknowledge();
  test::HostileCommands commands(seed, 3.3);
  Outcome outcome;
  bench.on_state = [&](const DeviceState& state) {
    const device::TrueState truth = bench.device.true_state();
    outcome.most_unbooked_joule =
        std::max(outcome.most_unbooked_joule, bench.node.monitor_joule() - truth.energy_joule);
    outcome.top_speed_m_per_s =
        std::max(outcome.top_speed_m_per_s, truth.hand_velocity_m_per_s.norm());
    bench.send_answer(state.header.session_id, state.header.sequence,
                      commands.next(state.hand_position_m));
  };
  int fault_ticks = 0;
  int ticks = 0;
  const TimePoint end(
      from_seconds(is_at_start ? kEnabled_s : vice.from_s + vice.length_s + kAfterwards_s));
  for (; bench.clock.now() < end; ++ticks) {
    if (is_at_start && bench.node.phase() != DevicePhase::kChecking) break;
    if (vice.stall > 0ms && ticks % 50 == 49) bench.clock.advance(vice.stall);
    if (vice.sleep > 0ms && ticks == kSleepTick) {
      bench.device.sleep(vice.sleep);
      bench.node.suspended(vice.sleep);
    }
    // each release of a silent device takes a second of real time
    if (bench.node.has_fault() && ++fault_ticks > 10) bench.clock.advance(100ms);
    if (vice.is_acknowledged_again && fault_ticks > 15 &&
        bench.node.phase() != DevicePhase::kEnabled) {
      fault_ticks = 0;
      for (int signals = 0; signals < 3; ++signals) bench.node.acknowledge();
    }
    bench.tick();
    const double newton = bench.ticks.back().force_on_hand_newton.norm();
    outcome.mean_newton += newton;
    if (newton > 1.01 * config.profile.coulomb_newton) ++outcome.ticks_beyond_friction;
    bench.states.clear();
    bench.ticks.clear();
  }
  outcome.mean_newton /= std::max(ticks, 1);
  for (const device::FaultOutcome& fault : bench.device.outcomes()) {
    if (!is_of_motors(fault.fault.kind) || vice.kinds.size() == 1) {
      outcome.pushed = std::max(outcome.pushed, fault.pushed_for);
    }
  }
  outcome.least_joule = bench.device.true_state().minimum_energy_joule;
  outcome.counters = bench.node.counters();
  outcome.phase = bench.node.phase();
  return outcome;
}

std::string decimals(int after_the_point, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), "%.*f", after_the_point, value);
  return text;
}

/// What the user is told.
std::string told(const Outcome& outcome, const Vice& vice) {
  const DeviceCounters& counters = outcome.counters;
  if (counters.device_faults > 0) {
    return std::string(name(counters.last_fault)) +
           (counters.is_release_unconfirmed ? ", release unconfirmed" : "");
  }
  if (vice.hold != Vice::kHostile) {
    return std::string(name(outcome.phase)) + ", gain ≥ " +
           decimals(2, counters.checked_motor_gain);
  }
  if (counters.frozen_ticks > 0) return "position stands still";
  if (vice.has_dead_man_button) return "dead-man button released";
  return "–";
}

/// The worst of kHands hands, and what each was told.
void print_row(const Wired& wired, const Vice& vice) {
  double least_joule = 0.0;
  double unbooked_joule = 0.0;
  Duration pushed{};
  bool is_ended = vice.has_dead_man_button;
  std::string all_told;
  // a hand that is still does not depend on the seed
  const std::uint64_t hands = vice.hold == Vice::kHostile ? kHands : 1;
  for (std::uint64_t seed = 1; seed <= hands; ++seed) {
    const Outcome outcome = run(wired, vice, seed);
    least_joule = std::min(least_joule, outcome.least_joule);
    unbooked_joule = std::max(unbooked_joule, outcome.most_unbooked_joule);
    if (outcome.counters.device_faults + outcome.counters.frozen_ticks > 0) {
      is_ended = true;
      pushed = std::max(pushed, outcome.pushed);
    }
    if (vice.has_dead_man_button) pushed = std::max(pushed, outcome.pushed);
    const std::string its = told(outcome, vice);
    if (all_told.find(its) == std::string::npos) all_told += (all_told.empty() ? "" : "; ") + its;
  }
  const bool has_end = is_ended && vice.hold == Vice::kHostile && vice.sleep == 0ms;
  std::printf("| %s | %s | %.0f | %.0f | %s | %s |\n", wired.name, vice.name,
              std::round(1e6 * least_joule) + 0.0, 1e6 * unbooked_joule,
              has_end ? (decimals(1, 1e3 * to_seconds(pushed)) + " ms").c_str() : "–",
              all_told.c_str());
  std::fflush(stdout);
}

/// Two vices at once, of those that the promise covers or that end the force.
Vice random_pair(const Wired& wired, std::uint64_t seed) {
  static const std::vector<WireFault> kinds{
      WireFault::kWatchdog20,   WireFault::kWatchdog100, WireFault::kWatchdog500,
      WireFault::kNoWatchdog,   WireFault::kLate,        WireFault::kTurning,
      WireFault::kWeight,       WireFault::kDropped,     WireFault::kPartial,
      WireFault::kMerged,       WireFault::kDoubled,     WireFault::kUnlisted,
      WireFault::kWrongId,      WireFault::kGarbage,     WireFault::kShort,
      WireFault::kUncalibrated, WireFault::kPowerCycle,  WireFault::kEncoderZero};
  Random random(seed);
  Vice vice{.name = "two at random",
            .kinds = {},
            .is_acknowledged_again = true,
            .from_s = 2.0,
            .length_s = 1.0};
  while (vice.kinds.size() < 2) {
    const WireFault kind = kinds[random.below(kinds.size())];
    if (!has(wired.driver, kind)) continue;
    vice.kinds.push_back(kind);
    if (kind == WireFault::kLate) vice.latency = kLate;
  }
  return vice;
}

/// @return  whether no run gave energy and nothing was booked that was not there
bool print_pairs(std::uint64_t runs) {
  std::printf(
      "| driver | runs with two vices | least true energy, µJ | books above it, µJ | faults | "
      "ticks "
      "above f_co | mean force |\n|---|---|---|---|---|---|---|\n");
  bool is_good = true;
  for (const Wired& wired : kWired) {
    Outcome all;
    std::uint64_t faults = 0;
    for (std::uint64_t seed = 1; seed <= runs; ++seed) {
      const Outcome outcome = run(wired, random_pair(wired, seed), seed);
      if (outcome.least_joule < -kRoundingJoule || outcome.most_unbooked_joule > kRoundingJoule) {
        const Vice vice = random_pair(wired, seed);
        std::fprintf(stderr, "%s seed %llu, vices %d and %d: %.3g µJ, books %.3g µJ\n", wired.name,
                     static_cast<unsigned long long>(seed), static_cast<int>(vice.kinds[0]),
                     static_cast<int>(vice.kinds[1]), 1e6 * outcome.least_joule,
                     1e6 * outcome.most_unbooked_joule);
      }
      all.least_joule = std::min(all.least_joule, outcome.least_joule);
      all.most_unbooked_joule = std::max(all.most_unbooked_joule, outcome.most_unbooked_joule);
      all.ticks_beyond_friction += outcome.ticks_beyond_friction;
      all.mean_newton += outcome.mean_newton / static_cast<double>(runs);
      faults += outcome.counters.device_faults;
    }
    is_good =
        is_good && all.least_joule >= -kRoundingJoule && all.most_unbooked_joule <= kRoundingJoule;
    std::printf("| %s | %llu | %.1f | %.1f | %llu | %llu | %.2f N |\n", wired.name,
                static_cast<unsigned long long>(runs), 1e6 * all.least_joule + 0.0,
                1e6 * all.most_unbooked_joule + 0.0, static_cast<unsigned long long>(faults),
                static_cast<unsigned long long>(all.ticks_beyond_friction), all.mean_newton);
    std::fflush(stdout);
  }
  return is_good;
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
  using namespace palpate::bench;
  if (argc < 2) {
    print_table();
    return 0;
  }
  const bool is_of_pairs = std::string_view(argv[1]) == "--pairs";
  const char* const number = argv[is_of_pairs ? 2 : 1];
  char* end = nullptr;
  const std::uint64_t runs = number != nullptr ? std::strtoull(number, &end, 10) : 0;
  if (argc != (is_of_pairs ? 3 : 2) || *end != '\0' || runs == 0) {
    std::fprintf(stderr,
                 "vices_bench [[--pairs] RUNS]: give a number of runs above 0, or nothing\n");
    return 2;
  }
  if (is_of_pairs) return print_pairs(runs) ? 0 : 1;
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
