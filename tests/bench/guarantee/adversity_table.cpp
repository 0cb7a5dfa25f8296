// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <chrono>
#include <initializer_list>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tests/bench/guarantee/adverse_rows.h"
#include "tests/bench/guarantee/guarantee_tables.h"
#include "tests/support/wired/wired_device.h"

namespace palpate::bench {
namespace {

using test::AdverseRun;

/// The adversity has an effect if the run without a controller falls below this true energy.
constexpr double kBiteJoule = -1e-3;

struct Adversity {
  std::string label;
  AdverseRun run;
  ProfileError profile = {};
  bool needs_watchdog = false;  ///< the process may not run while a lease ends
  bool is_outside = false;      ///< breaks an assumption
  bool sets_encoder = false;    ///< of the simulated device
};

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
  all.back().needs_watchdog = true;
  add("ticks skipped for 6 ms, 20/s", {"faults.device.skip={until_s: 0.006 every_s: 0.05}"},
      "push_along");
  all.back().needs_watchdog = true;
  add("2 % of switches 0…2 ms late",
      {"faults.device.late_switch_ratio=0.02", "faults.device.late_switch_us=2000"}, "push_along");
  all.back().needs_watchdog = true;

  // encoder
  for (const char* q_m : {"0", "55e-6", "5e-4"}) {
    add(fmt::format("encoder {:g} mm", 1e3 * std::stod(q_m)),
        {fmt::format("device.simulated.position_resolution_m={}", q_m),
         fmt::format("device.profile.position_resolution_m={}", q_m)},
        "push_along");
    all.back().sets_encoder = true;
  }

  // outside the assumptions, but for a profile that is right
  const std::size_t inside = all.size();
  for (const int factor : {1, 2, 5}) {
    add(fmt::format("profile friction {}× the true", factor), {}, "everything");
    all.back().profile.ratio = factor;
  }
  add("profile with the other kind of friction", {}, "everything");
  all.back().profile.is_other_kind = true;
  add("hand of 1 m/s, v_max 0.5",
      {"hand.hostile.v_max_m_per_s=1", "device.profile.position_resolution_m=0",
       "device.simulated.position_resolution_m=0", "mofc.guard_settings.credit_cap_joule=10"},
      "everything");
  add("hand of 2 m/s, v_max 0.25",
      {"hand.hostile.v_max_m_per_s=2", "mofc.guard_settings.v_max_m_per_s=0.25",
       "device.profile.position_resolution_m=0", "device.simulated.position_resolution_m=0",
       "mofc.guard_settings.credit_cap_joule=10"},
      "everything");
  for (std::size_t i = inside + 1; i < all.size(); ++i) all[i].is_outside = true;
  return all;
}

}  // namespace

Table adversity_table(int seeds, const std::vector<std::string>& more_overrides,
                      const Shard& shard) {
  std::vector<AdverseRow> rows;
  for (const Adversity& adversity : adversities()) {
    for (const Friction& friction : kFrictions) {
      for (const char* physics_hz : {"1000", "50"}) {
        for (const Mode* mode : friction.modes) {
          // pools for isotropic friction need a profile with isotropic friction
          if (adversity.profile.is_other_kind && mode == &kPaperIsotropic) continue;
          AdverseRun run = adversity.run;
          append(run.overrides, overrides_of(friction, adversity.profile));
          append(run.overrides, {fmt::format("physics.rate_hz={}", physics_hz)});
          append(run.overrides, mode->overrides);
          append(run.overrides, more_overrides);
          rows.push_back({adversity.label, &friction, {physics_hz, mode->label}, std::move(run)});
        }
      }
    }
  }
  run_rows(rows, seeds, shard);
  return table_of(rows, "adversity", {{"physics_hz", "physics Hz", ""}, {"mode", "mode", ""}},
                  {{"largest_jump_n", "jump N", "{:.2f}"},
                   {"longest_fallback_ms", "fallback ms", "{:.1f}"},
                   {"transparency_percent", "transp. %", "{:.1f}"},
                   {"clamped_percent", "clamped %", "{:.1f}"},
                   {"top_speed_m_per_s", "hand m/s", "{:.2f}"},
                   {"too_fast_ticks", "too fast", "{:.0f}"},
                   {"bites", "effect", ""}},
                  [](const AdverseRow& row) -> std::vector<Table::Cell> {
                    const Summary& s = row.summary;
                    const bool is_twin = row.variant.back() == kNone.label;
                    const char* effect = !is_twin ? "" : s.least_joule < kBiteJoule ? "yes" : "no";
                    return {s.largest_jump_newton,    1e3 * s.longest_fallback_s,
                            s.transparency_percent(), s.clamped_percent(),
                            s.top_speed_m_per_s,      static_cast<double>(s.too_fast_ticks),
                            std::string(effect)};
                  });
}

namespace {

/// A driver and the specification of its device.
struct Wired {
  const char* label;
  std::optional<test::WiredDriver> driver;  ///< none: the plain simulated device
  std::vector<std::string> overrides;
};

std::vector<Wired> wired_devices() {
  using test::WiredDriver;
  const std::string exact = "device.simulated.position_resolution_m=0";
  // the encoders count angles: up to 0.1 mm at the handle, and a little more
  const std::string fine = "position_resolution_m=1e-4";
  const std::string coarse = "position_resolution_m=1.1e-4";
  return {{"simulated", {}, {}},
          {"haply_inverse", WiredDriver::kHaply, {}},
          {"simulated", {}, {"device.simulated." + fine, "device.profile." + fine}},
          {"hapi", WiredDriver::kHapi, {exact, "device.profile." + fine}},
          {"simulated", {}, {"device.simulated." + coarse, "device.profile." + coarse}},
          {"falcon", WiredDriver::kFalcon, {exact, "device.profile." + coarse}},
          {"wooden", WiredDriver::kWooden, {exact, "device.profile." + coarse}}};
}

constexpr Duration kEmulatedWatchdog = std::chrono::milliseconds(20);

}  // namespace

Table device_table(int seeds, const std::vector<std::string>& more_overrides, const Shard& shard,
                   double& least_joule) {
  // in the plane of the pantograph, and reaching nowhere out of its links
  std::vector<Adversity> all = adversities();
  all.insert(
      all.begin(),
      {.label = "a hand that palpates",
       .run = {.overrides = {"adversary.physics=honest",
                             "scene.tissue[0].kelvin_voigt={ stiffness_newton_per_m: 250 }",
                             "hand={ sinusoid { center_m { z: -0.002 } amplitude_m { x: 0.01 "
                             "z: 0.012 } frequency_hz { x: 0.05 z: 0.7 } } }"},
               .seconds = 4.0}});
  std::vector<AdverseRow> rows;
  for (const Adversity& adversity : all) {
    if (adversity.is_outside) continue;
    for (const Wired& wired : wired_devices()) {
      if (adversity.sets_encoder && !wired.overrides.empty()) continue;  // has one of its own
      AdverseRun run = adversity.run;
      append(run.overrides, overrides_of(kFrictions[0], adversity.profile));
      append(run.overrides, {"physics.rate_hz=1000"});
      append(run.overrides, kGuard.overrides);
      append(run.overrides, wired.overrides);
      append(run.overrides, more_overrides);
      if (wired.driver) {
        run.overrides.emplace_back("device.accept=NO_MOTOR_WATCHDOG");
        run.make_device = [driver = *wired.driver](const Side& side, const Clock& clock,
                                                   std::uint64_t seed) {
          return test::open_wired(driver, side, clock, seed, kEmulatedWatchdog);
        };
      }
      rows.push_back({adversity.label + (adversity.needs_watchdog ? " *" : ""),
                      &kFrictions[0],
                      {wired.label},
                      std::move(run)});
    }
  }
  run_rows(rows, seeds, shard);
  least_joule = 0.0;
  for (const AdverseRow& row : rows) {
    if (row.run.make_device && !row.label.ends_with('*')) {
      least_joule = std::min(least_joule, row.summary.least_joule);
    }
  }
  return table_of(rows, "adversity", {{"device", "device", ""}},
                  {{"transparency_percent", "transp. %", "{:.1f}"},
                   {"clamped_percent", "clamped %", "{:.1f}"},
                   {"monitor_reductions", "reduced", "{:.0f}"}},
                  [](const AdverseRow& row) -> std::vector<Table::Cell> {
                    return {row.summary.transparency_percent(), row.summary.clamped_percent(),
                            static_cast<double>(row.summary.monitor_reductions)};
                  });
}

}  // namespace palpate::bench
