// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/summary.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>
#include <set>
#include <string>
#include <utility>

namespace palpate {
namespace {

using testing::HasSubstr;

/// A run whose ticks are 1 ms apart unless said otherwise.
class Ticks {
 public:
  RunStatistics statistics;

  void add(TickRow row, const IdealState& ideal = {}, int after_ms = 1) {
    now_ += after_ms * std::chrono::milliseconds(1);
    row.device.sequence = sequence_++;
    row.device.sampled_at = row.device.switched_at = now_;
    statistics.add(row, ideal);
  }
  /// The last force acts until here.
  void end() { add({}); }

 private:
  std::uint64_t sequence_ = 0;
  TimePoint now_{};
};

/// A tick in which `asked` was asked and `acting` acted.
TickRow row(const Vector3& asked, const Vector3& acting) {
  TickRow row;
  row.device.force_on_hand_newton = acting;
  row.mofc.emplace();
  row.mofc->requested_force_on_hand_newton = asked;
  return row;
}

/// A tick at `tool_x_m`, while the ideal run is at `ideal_x_m`; NaN: not known.
void add_position(Ticks& run, double tool_x_m, double ideal_x_m) {
  TickRow row;
  row.device.true_tool_position_world_m = Vector3(tool_x_m, 0, 0);
  IdealState ideal;
  if (!std::isnan(ideal_x_m)) ideal.tool_position_world_m = Vector3(ideal_x_m, 0, 0);
  run.add(row, ideal);
}

// x: 0.5/1 for 1 ms and 1/1 for 3 ms; y: −1/−2 for 1 ms; z never asked for more than 0.05 N.
// Vector: (1, −2, 0)·(0.5, −1, 0)/5 = 0.5 and 1·1/(1² + 0.04²) = 1/1.0016.
TEST(RunStatistics, TransparencyIsWhatActedOverWhatWasAskedForAsLongAsItActed) {
  Ticks run;
  run.add(row({1, -2, 0}, {0.5, -1, 0}));
  run.add(row({1, 0, 0.04}, {1, 0, 0.0}));
  run.add({}, {}, 3);

  const RunStatistics& s = run.statistics;
  EXPECT_DOUBLE_EQ(s.transparency().x(), (0.5 + 3.0) / 4.0);
  EXPECT_DOUBLE_EQ(s.transparency().y(), 0.5);
  EXPECT_TRUE(std::isnan(s.transparency().z()));
  EXPECT_DOUBLE_EQ(s.vector_transparency(), (0.5 + 3.0 / 1.0016) / 4);
}

/// Adds to a tick what acted before it: (force along z, until).
TickRow after(TickRow row, std::initializer_list<std::pair<double, int>> acted, int from_ms) {
  TimePoint from{from_ms * std::chrono::milliseconds(1)};
  for (const auto& [newton, until_ms] : acted) {
    const TimePoint until{until_ms * std::chrono::milliseconds(1)};
    row.device.acted[row.device.acted_count++] = {
        .force_on_hand_newton = {0, 0, newton}, .from = from, .until = until};
    from = until;
  }
  return row;
}

// 2 N asked and applied at 1 ms, with a lease of 3 ms; the next tick comes after a hole of 10 ms,
// in which nothing acts for 7 ms; then 2 N again for 2 ms. Every tick asks for 2 N and gets 2 N,
// but it acts for 5 of 12 ms. Against the ideal of 2 N the same.
TEST(RunStatistics, AHoleIsChargedForAsLongAsItLasts) {
  Ticks run;
  const auto pressed = [](TickRow row) {
    row.ideal_force_on_hand_newton = {0, 0, 2};
    return row;
  };
  run.add(pressed(row({0, 0, 2}, {0, 0, 2})));
  run.add(pressed(after(row({0, 0, 2}, {0, 0, 2}), {{2.0, 4}, {0.0, 11}}, 1)), {}, 10);
  run.add(pressed(after({}, {{2.0, 13}}, 11)), {}, 2);

  const RunStatistics& s = run.statistics;
  EXPECT_NEAR(s.vector_transparency(), 5.0 / 12.0, 1e-12);
  EXPECT_NEAR(s.transparency().z(), 5.0 / 12.0, 1e-12);
  EXPECT_NEAR(s.ideal_transparency(), 5.0 / 12.0, 1e-12);
  EXPECT_NEAR(s.gain(), 5.0 / 12.0, 1e-12);
  EXPECT_NEAR(s.force_error_rms_ratio(), std::sqrt(7.0 / 12.0), 1e-12);
  EXPECT_NEAR(s.beyond_jnd_ratio(), 7.0 / 12.0, 1e-12);
}

// Answered 0.5 ms after the reading: the earlier 1 N acts on until then and answers its own
// request.
TEST(RunStatistics, ARequestStandsFromTheSwitchOfItsTick) {
  RunStatistics s;
  const auto add = [&](int k, TickRow tick) {
    tick.device.sequence = static_cast<std::uint64_t>(k);
    tick.device.sampled_at = TimePoint(k * std::chrono::milliseconds(2));
    tick.device.switched_at = tick.device.sampled_at + std::chrono::milliseconds(1);
    s.add(tick, {});
  };
  add(0, row({0, 0, 1}, {0, 0, 1}));
  add(1, after(row({0, 0, 3}, {0, 0, 3}), {{0.0, 1}, {1.0, 2}}, 0));
  add(2, after(row({0, 0, 3}, {0, 0, 3}), {{1.0, 3}, {3.0, 4}}, 2));

  EXPECT_DOUBLE_EQ(s.vector_transparency(), 1.0);
}

// Tick 1 is missing, so what was requested in it is unknown; what acted before tick 3 is judged.
TEST(RunStatistics, TheTimeAfterAMissingTickDoesNotCount) {
  RunStatistics s;
  for (const int k : {0, 2, 3}) {
    TickRow tick = row({0, 0, 1}, {0, 0, k == 0 ? 0.0 : 1.0});
    tick.device.sequence = static_cast<std::uint64_t>(k);
    tick.device.sampled_at = tick.device.switched_at = TimePoint(k * std::chrono::milliseconds(1));
    tick.ideal_force_on_hand_newton = {0, 0, 1};
    s.add(tick, {});
  }
  EXPECT_DOUBLE_EQ(s.vector_transparency(), 1.0);
  EXPECT_DOUBLE_EQ(s.ideal_transparency(), 1.0);
}

// against the tissue's own force: fs·fi/|fi|² = 2/4 and 4/4, mean 0.75;
// error √((1 + 0)/(4 + 4)) = √(1/8). What acts after the third row has no ideal and does not count.
TEST(RunStatistics, TheIdealForceIsJudgedOnlyWhereItIsKnown) {
  Ticks run;
  for (const double acting : {1.0, 2.0, 2.5}) {
    TickRow known = row(Vector3::Zero(), {0, 0, acting});
    known.ideal_force_on_hand_newton = Vector3(0, 0, 2);
    run.add(known);
  }
  run.add(row(Vector3::Zero(), {0, 0, 3}));
  run.end();

  EXPECT_DOUBLE_EQ(run.statistics.ideal_transparency(), 0.75);
  EXPECT_DOUBLE_EQ(run.statistics.gain(), 0.75);
  EXPECT_DOUBLE_EQ(run.statistics.force_error_rms_ratio(), std::sqrt(1.0 / 8.0));
}

// A row that brings its comparison is taken at its word.
TEST(RunStatistics, TheComparisonOfTheInnerStepsComesFirst) {
  Ticks run;
  TickRow first = row(Vector3::Zero(), {0, 0, 1});
  first.ideal_force_on_hand_newton = {0, 0, 1};
  run.add(first);
  TickRow second = first;
  second.to_ideal.emplace();
  second.to_ideal->add(1e-3, {0, 0, 2}, {0, 0, 1});
  run.add(second);

  EXPECT_DOUBLE_EQ(run.statistics.ideal_transparency(), 0.5);
}

// fi = 2 N at the true position, 3 N in the ideal run; 2.1, 2.3 and 2 N acted: √(0.01 + 0.09 + 0)
// of √12 N, √(0.81 + 0.49 + 1) of √27 N; the second is more than 7 % off.
TEST(RunStatistics, TheForceIsHeldAgainstTheTissueHereAndAgainstTheIdealRun) {
  Ticks run;
  EXPECT_TRUE(std::isnan(run.statistics.beyond_jnd_ratio()));
  for (const double acted : {2.1, 2.3, 2.0, 0.0}) {
    TickRow tick = row({0, 0, acted}, {0, 0, acted});
    tick.ideal_force_on_hand_newton = {0, 0, 2};
    run.add(tick, {.tool_position_world_m = {}, .force_on_hand_newton = {0, 0, 3}});
  }

  const RunStatistics& s = run.statistics;
  EXPECT_NEAR(s.force_error_rms_ratio(), std::sqrt(0.10 / 12.0), 1e-12);
  EXPECT_NEAR(s.ideal_run_force_error_rms_ratio(), std::sqrt(2.30 / 27.0), 1e-12);
  EXPECT_NEAR(s.beyond_jnd_ratio(), 1.0 / 3.0, 1e-12);
}

// 1 N is missing for 10 ms of 60: a mean of 0.5 N over the worst 20 ms.
TEST(RunStatistics, TheLargestErrorIsAMeanOverTwentyMilliseconds) {
  Ticks run;
  for (int ms = 0; ms < 60; ++ms) {
    TickRow tick = row({0, 0, 1}, {0, 0, ms >= 30 && ms < 40 ? 0.0 : 1.0});
    tick.ideal_force_on_hand_newton = {0, 0, 1};
    run.add(tick);
  }
  EXPECT_NEAR(run.statistics.largest_force_error_newton(), 0.5, 1e-9);
}

// Asked in 4 ticks, clamped in 1 of them; a tick without an answer asks for nothing.
TEST(RunStatistics, TheClampRatioIsOfTheTicksWithAForce) {
  RunStatistics s;
  EXPECT_TRUE(std::isnan(s.clamp_ratio()));
  for (int i = 0; i < 4; ++i) {
    TickRow asked = row({0, 0, 1}, {0, 0, 1});
    asked.mofc->is_clamped = i == 2;
    s.add(asked, {});
  }
  s.add(row(Vector3::Zero(), Vector3::Zero()), {});
  s.add(TickRow{}, {});

  EXPECT_DOUBLE_EQ(s.clamp_ratio(), 0.25);
  EXPECT_EQ(s.ticks(), 6u);

  // of a wrist, while no force is asked for
  for (int i = 0; i < 4; ++i) {
    TickRow turned = row(Vector3::Zero(), Vector3::Zero());
    turned.mofc->requested_wrist_torque_newton_m = {0, i < 2 ? 0.01 : 0.0, 0};
    turned.mofc->is_clamped = i == 1;
    s.add(turned, {});
  }
  EXPECT_DOUBLE_EQ(s.clamp_ratio(), 2.0 / 6.0);
}

// True geometry beats what physics last said; what physics said beats nothing.
TEST(RunStatistics, ContactIsTheTrueOneWhereKnown) {
  RunStatistics s;
  TickRow said = row(Vector3::Zero(), Vector3::Zero());
  said.mofc->is_in_contact = true;
  s.add(said, {});
  said.is_truly_in_contact = false;
  s.add(said, {});
  said.mofc->is_in_contact = false;
  said.is_truly_in_contact = true;
  s.add(said, {});
  s.add(TickRow{}, {});
  TickRow unanswered;
  unanswered.is_truly_in_contact = true;
  s.add(unanswered, {});

  EXPECT_EQ(s.contact_ticks(), 3u);
}

TEST(RunStatistics, TheLargestForceIsANormAndTheLeastEnergyTheLastMinimum) {
  RunStatistics s;
  EXPECT_TRUE(std::isnan(s.minimum_true_energy_joule()));
  for (const double minimum : {-1e-6, -3e-6, kNaN}) {
    TickRow tick = row(Vector3::Zero(), {1, 2, minimum < -2e-6 ? -2.0 : 0.0});
    tick.device.minimum_true_energy_joule = minimum;
    s.add(tick, {});
  }

  EXPECT_DOUBLE_EQ(s.maximum_force_newton(), 3.0);  // √(1 + 4 + 4)
  EXPECT_DOUBLE_EQ(s.minimum_true_energy_joule(), -3e-6);
}

// This run turns at 2 mm, at 1 mm and at 3 mm; the ideal run only at 2 mm.
TEST(RunStatistics, ExcessReversalsAreThoseBeyondTheIdealRun) {
  const double tool_mm[] = {0, 2, 1, 3, 0};
  const double ideal_mm[] = {0, 2, 1, 0, -1};
  Ticks run;
  Ticks swapped_run;
  for (std::size_t i = 0; i < 5; ++i) {
    add_position(run, 1e-3 * tool_mm[i], 1e-3 * ideal_mm[i]);
    add_position(swapped_run, 1e-3 * ideal_mm[i], 1e-3 * tool_mm[i]);
  }
  const RunStatistics& s = run.statistics;
  const RunStatistics& swapped = swapped_run.statistics;

  EXPECT_EQ(s.reversals()[0], 3u);
  EXPECT_EQ(s.ideal_reversals()[0], 1u);
  EXPECT_EQ(s.excess_reversals(), 2u);
  EXPECT_EQ(swapped.excess_reversals(), 0u);  // fewer than the ideal run is no excess below 0
}

// From 3 mm to 4 mm on the other side, linear in between: ∫ = (9 − 12 + 16)/3 mm² per time, peak
// 4 mm. The time from the tick without ideal on is no zero.
TEST(RunStatistics, PathDeviationIsTheDistanceToTheIdealRun) {
  Ticks run;
  add_position(run, 0.0, kNaN);
  EXPECT_TRUE(std::isnan(run.statistics.path_deviation_rms_m()));
  EXPECT_TRUE(std::isnan(run.statistics.path_deviation_peak_m()));

  add_position(run, 0.0, 3e-3);
  add_position(run, 1e-3, -3e-3);

  EXPECT_DOUBLE_EQ(run.statistics.path_deviation_rms_m(), std::sqrt(13.0 / 3.0 * 1e-6));
  EXPECT_DOUBLE_EQ(run.statistics.path_deviation_peak_m(), 4e-3);
}

// 8 of 10 begun and 2 skipped ticks: 8/12
TEST(AnsweredRatio, CountsSkippedTicksAsUnanswered) {
  DeviceCounters counters;
  EXPECT_TRUE(std::isnan(answered_ratio(counters)));
  counters.loop.ticks = 10;
  counters.loop.skipped_ticks = 2;
  counters.answered_ticks = 8;

  EXPECT_DOUBLE_EQ(answered_ratio(counters), 8.0 / 12.0);
}

TEST(NumberOrNull, IsNullForWhatJsonCannotSay) {
  EXPECT_EQ(number_or_null(1.5).dump(), "1.5");
  EXPECT_EQ(number_or_null(kNaN).dump(), "null");
  EXPECT_EQ(number_or_null(std::numeric_limits<double>::infinity()).dump(), "null");
}

std::set<std::string> keys_of(const nlohmann::ordered_json& json) {
  std::set<std::string> keys;
  for (const auto& item : json.items()) keys.insert(item.key());
  return keys;
}

TEST(MonitorText, SaysWhetherItIsOnAndWhatItDid) {
  DeviceCounters device;
  EXPECT_EQ(monitor_text(device), "on, 0 commands reduced");
  device.monitor_reductions = 7;
  device.checked_friction_ratio = 1.0;
  EXPECT_EQ(monitor_text(device), "on, 7 commands reduced");
  device.checked_friction_ratio = 0.5;
  EXPECT_EQ(monitor_text(device),
            "on, 7 commands reduced, friction lowered to 50 % of the profile");
  device.is_monitor_off = true;
  EXPECT_EQ(monitor_text(device), "off");
}

// Other programs read these keys.
TEST(SummaryJson, HasTheKeysThatAreDocumented) {
  const nlohmann::ordered_json json = summary_json(Session{}, RunReport{});

  for (const char* key : {"ticks",
                          "in_contact_ticks",
                          "transparency",
                          "gain",
                          "force_error_rms_ratio",
                          "largest_force_error_20ms_n",
                          "min_true_energy_j",
                          "max_force_n",
                          "largest_jump_n",
                          "monitor",
                          "monitor_reductions",
                          "ledger_excesses",
                          "has_motor_watchdog",
                          "accepts_no_motor_watchdog",
                          "velocity_reversals",
                          "clamp_ratio",
                          "fallbacks",
                          "wall_s",
                          "ticks_per_wall_s",
                          "schema_version",
                          "session",
                          "controller",
                          "seed",
                          "simulated_s",
                          "answered_ratio",
                          "path_deviation_rms_m",
                          "path_deviation_peak_m",
                          "motions_suppressed",
                          "interactions_suppressed",
                          "physics_switches",
                          "grips",
                          "grips_torn",
                          "grips_slipped",
                          "punctures",
                          "standby_ticks",
                          "physics_term",
                          "ideal_run_force_error_rms_ratio",
                          "beyond_jnd_ratio"}) {
    EXPECT_TRUE(json.contains(key)) << key;
  }
  EXPECT_EQ(keys_of(json["transparency"]),
            (std::set<std::string>{"x", "y", "z", "vector", "ideal"}));
  EXPECT_EQ(keys_of(json["velocity_reversals"]),
            (std::set<std::string>{"x", "y", "z", "ideal", "excess"}));
}

TEST(SummaryJson, SaysNullForWhatARunWithoutContactOrIdealDoesNotKnow) {
  RunReport report;
  report.statistics.add(TickRow{}, {});
  const nlohmann::ordered_json json = summary_json(Session{}, report);

  for (const char* key :
       {"force_error_rms_ratio", "min_true_energy_j", "clamp_ratio", "answered_ratio",
        "path_deviation_rms_m", "path_deviation_peak_m", "ideal_run_force_error_rms_ratio",
        "beyond_jnd_ratio", "gain", "largest_force_error_20ms_n"}) {
    EXPECT_TRUE(json[key].is_null()) << key;
  }
  for (const char* key : {"x", "y", "z", "vector", "ideal"}) {
    EXPECT_TRUE(json["transparency"][key].is_null()) << key;
  }
  EXPECT_TRUE(json["velocity_reversals"]["ideal"].is_null());
  EXPECT_TRUE(json["velocity_reversals"]["excess"].is_null());
  EXPECT_EQ(json["ticks"], 1);
  // and nothing in it would make a reader of JSON stumble
  EXPECT_EQ(nlohmann::json::parse(json.dump()), nlohmann::json(json));
  EXPECT_THAT(json.dump(), testing::Not(HasSubstr("nan")));
}

// an error that was never measured is not 0
TEST(Summary, OfElasticTissueSaysWhatIsNotKnown) {
  RunReport report;
  EXPECT_TRUE(summary_json(Session{}, report)["elastic"].is_null());
  EXPECT_THAT(summary_text(Session{}, report), testing::Not(HasSubstr("elastic")));

  report.physics.elastic_solves = 50;
  report.physics.elastic_solves_failed = 3;
  report.physics.elastic_solves_repaired = 2;
  report.physics.elastic_tips_appeared = 1;
  report.physics.elastic_contact_steps = report.physics.elastic_unknown_bound_steps = 40;
  nlohmann::ordered_json elastic = summary_json(Session{}, report)["elastic"];
  EXPECT_TRUE(elastic["bound_n"].is_null());
  EXPECT_TRUE(elastic["error_n"].is_null());
  EXPECT_EQ(elastic["failed"], 3);
  EXPECT_EQ(elastic["repaired"], 2);
  EXPECT_EQ(elastic["tips_appeared"], 1);
  EXPECT_EQ(elastic["unknown_bound_steps"], 40);
  EXPECT_THAT(summary_text(Session{}, report), HasSubstr("bound unknown"));

  report.physics.elastic_error_newton = 0.0;
  report.physics.elastic_bound_newton = 0.25;
  report.physics.elastic_bounds_checked = 20;
  report.physics.elastic_bound_violations = 4;
  elastic = summary_json(Session{}, report)["elastic"];
  EXPECT_EQ(elastic["bound_n"], 0.25);
  EXPECT_EQ(elastic["error_n"], 0.0);
  EXPECT_EQ(elastic["bound_violations"], 4);
  EXPECT_THAT(summary_text(Session{}, report), HasSubstr("bound 0.25 N, exceeded 4 of 20 times"));
}

TEST(SummaryJson, CarriesTheFiguresOfTheRun) {
  Session session;
  session.name = "probe";
  session.seed = 7;
  RunReport report;
  Ticks run;
  for (const double x_mm : {0.0, 2.0, 1.0}) add_position(run, 1e-3 * x_mm, 0.0);
  TickRow pushed = row({0, 0, 2}, {0, 0, 1});
  pushed.mofc->is_clamped = true;
  pushed.is_truly_in_contact = true;
  pushed.ideal_force_on_hand_newton = {0, 0, 4};
  run.add(pushed);
  TickRow last;
  last.ideal_force_on_hand_newton = {0, 0, 4};
  run.add(last);
  report.statistics = run.statistics;
  report.device.largest_jump_newton = 0.75;
  report.device.monitor_reductions = 13;
  report.device.fallback_ticks = 3;
  report.device.limp_ticks = 2;
  report.mofc.motions_suppressed = 11;
  report.physics.interactions_suppressed = 12;
  report.simulated_s = 4.0;
  report.wall_s = 0.5;
  const nlohmann::ordered_json json = summary_json(session, report);

  EXPECT_EQ(json["session"], "probe");
  EXPECT_EQ(json["seed"], 7);
  EXPECT_EQ(json["schema_version"], 2);
  EXPECT_EQ(json["ticks"], 5);
  EXPECT_EQ(json["in_contact_ticks"], 1);
  EXPECT_DOUBLE_EQ(json["transparency"]["z"], 0.5);
  EXPECT_DOUBLE_EQ(json["transparency"]["vector"], 0.5);
  EXPECT_DOUBLE_EQ(json["transparency"]["ideal"], 0.25);
  EXPECT_DOUBLE_EQ(json["gain"], 0.25);
  EXPECT_DOUBLE_EQ(json["force_error_rms_ratio"], 0.75);
  EXPECT_DOUBLE_EQ(json["max_force_n"], 1.0);
  EXPECT_DOUBLE_EQ(json["largest_jump_n"], 0.75);
  EXPECT_EQ(json["monitor"], "on");
  EXPECT_EQ(json["monitor_reductions"], 13);
  EXPECT_DOUBLE_EQ(json["clamp_ratio"], 1.0);
  EXPECT_EQ(json["velocity_reversals"]["x"], 1);
  EXPECT_EQ(json["velocity_reversals"]["ideal"]["x"], 0);
  EXPECT_EQ(json["velocity_reversals"]["excess"], 1);
  EXPECT_DOUBLE_EQ(json["path_deviation_peak_m"], 2e-3);
  EXPECT_EQ(json["fallbacks"], 5);
  EXPECT_EQ(json["motions_suppressed"], 11);
  EXPECT_EQ(json["interactions_suppressed"], 12);
  EXPECT_DOUBLE_EQ(json["simulated_s"], 4.0);
  EXPECT_DOUBLE_EQ(json["ticks_per_wall_s"], 10.0);  // 5 ticks in 0.5 s
}

TEST(ControllerText, NamesControllerAndMode) {
  MofcConfig config;
  config.controller = ControllerKind::kMofc;
  config.mode = MofcMode::kVector;
  EXPECT_EQ(controller_text(config), "mofc vector");
  config.mode = MofcMode::kPaper;
  EXPECT_EQ(controller_text(config), "mofc paper");
  config.controller = ControllerKind::kNone;
  EXPECT_EQ(controller_text(config), "none");
}

TEST(EnergyText, HasAUnitInWhichItIsReadable) {
  EXPECT_EQ(energy_text(0.0), "0 µJ");
  EXPECT_EQ(energy_text(-3.21e-6), "-3.21 µJ");
  EXPECT_EQ(energy_text(9.994e-4), "999 µJ");
  EXPECT_EQ(energy_text(9.996e-4), "1 mJ");
  EXPECT_EQ(energy_text(0.171), "171 mJ");
  EXPECT_EQ(energy_text(0.9996), "1 J");
  EXPECT_EQ(energy_text(1.34), "1.34 J");
  EXPECT_EQ(energy_text(1340.0), "1340 J");
}

TEST(SummaryText, SaysHowSlowASlowRunWas) {
  Session session;
  session.name = "slow";
  RunReport report;
  report.statistics.add(TickRow{}, {});
  report.simulated_s = 1.0;
  report.wall_s = 40.0;
  EXPECT_THAT(summary_text(session, report), HasSubstr("0.025 times real time"));
  report.wall_s = 0.01;
  EXPECT_THAT(summary_text(session, report), HasSubstr("100 times real time"));
}

TEST(SummaryText, ShowsADashForWhatIsNotKnownAndNeverNan) {
  Session session;
  session.name = "probe";
  RunReport report;
  report.statistics.add(TickRow{}, {});
  const std::string text = summary_text(session, report);

  EXPECT_THAT(text, HasSubstr("probe: "));
  EXPECT_THAT(text, HasSubstr("–"));
  EXPECT_THAT(text, testing::Not(HasSubstr("nan")));
  EXPECT_THAT(text, testing::Not(HasSubstr("inf")));
}

}  // namespace
}  // namespace palpate
