// SPDX-License-Identifier: Apache-2.0
// A second physics takes over (docs/theory.md §5.1): all sides together, no clock shared, whatever
// part of the network is cut. In lockstep.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "common/core/random.h"
#include "common/session/session_file.h"
#include "common/telemetry/summary.h"
#include "deploy/lockstep/lockstep.h"
#include "tests/property/seeds.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;

constexpr double kNothingFelt = 0.9;  // transparency over a fault
constexpr double kRoundingJoule = 1e-6;

/// Each hand presses up and down in tissue that relaxes and breathes.
constexpr const char* kSides = R"(
name: "failover"
hand { sinusoid { center_m { z: -0.003 } amplitude_m { x: 0.004 z: 0.001 } frequency_hz { x: 0.5 z: 0.4 } } }
physics { standby {} }
scene {
  tissue {
    half_space {}
    kelvin_voigt {
      stiffness_newton_per_m: 300 damping_newton_s_per_m: 1
      relaxing_stiffness_newton_per_m: 100 relaxation_time_ms: 500
    }
    motion { amplitude_m { z: 0.002 } frequency_hz: 0.3 }
  }
}
)";
constexpr const char* kTwo = R"(side { name: "left" } side { name: "right" })";

Session failover_session(const std::string& sides, const std::vector<std::string>& overrides = {}) {
  return parse_session(std::string(kSides) + sides, "failover.txtpb", overrides, {});
}

struct Station {
  RunStatistics fault;  // the rows since the fault began
  std::vector<TickRow> rows;
  MofcCounters mofc;
  DeviceCounters device;

  [[nodiscard]] bool is_from_standby(TimePoint at) const {
    const auto row = std::find_if(rows.begin(), rows.end(),
                                  [&](const TickRow& one) { return one.device.sampled_at >= at; });
    return row != rows.end() && row->mofc && row->mofc->is_from_standby;
  }
  /// Largest change of the force that the tissue requests, per tick, from then on.
  [[nodiscard]] double largest_change_newton(TimePoint from) const {
    double largest = 0.0;
    for (std::size_t i = 1; i < rows.size(); ++i) {
      if (rows[i].device.sampled_at < from || !rows[i].mofc || !rows[i - 1].mofc) continue;
      largest = std::max(largest, (rows[i].mofc->requested_force_on_hand_newton -
                                   rows[i - 1].mofc->requested_force_on_hand_newton)
                                      .norm());
    }
    return largest;
  }
};

constexpr TimePoint kFaultAt{1500ms};

std::vector<Station> run_stations(const Session& session, Duration length,
                                  LockstepOptions options = {}, bool has_ideal = true) {
  std::vector<Station> stations(session.sides.size());
  options.has_ideal = has_ideal;
  options.on_side_row = [&](std::size_t side, const TickRow& row, const IdealState& ideal) {
    Station& station = stations[side];
    station.rows.push_back(row);
    if (row.device.sampled_at >= kFaultAt) station.fault.add(row, ideal);
  };
  Lockstep lockstep(session, options, {});
  lockstep.run_until(length);
  for (std::size_t i = 0; i < stations.size(); ++i) {
    stations[i].mofc = lockstep.mofc_counters(i);
    stations[i].device = lockstep.device_counters(i);
  }
  return stations;
}

void expect_nothing_felt(const std::vector<Station>& stations, const char* fault) {
  for (const Station& station : stations) {
    const double transparency = station.fault.ideal_transparency();
    std::printf("%s: T %.4f, least true energy %.2f µJ, %llu switches\n", fault, transparency,
                1e6 * station.fault.minimum_true_energy_joule(),
                static_cast<unsigned long long>(station.mofc.physics_switches));
    EXPECT_GE(transparency, kNothingFelt) << fault;
    EXPECT_EQ(station.mofc.stale_ticks, 0u) << fault;
    EXPECT_GE(station.fault.minimum_true_energy_joule(), -kRoundingJoule) << fault;
    // the tissue itself changes by less than 0.02 N per tick; 100 N/s of hand-over adds 0.1 N
    EXPECT_LE(station.largest_change_newton(kFaultAt), 0.12) << fault;
  }
}

bool is_first(PhysicsRole role) { return role == PhysicsRole::kFirst; }

TEST(Failover, WhileBothAreAliveTheFirstSpeaks) {
  const auto stations = run_stations(failover_session(kTwo), 3500ms);
  expect_nothing_felt(stations, "no fault");
  for (const Station& station : stations) {
    EXPECT_EQ(station.mofc.physics_term, 0u);
    EXPECT_EQ(station.mofc.standby_ticks, 0u);
    EXPECT_GT(station.mofc.standby_interaction.accepted, 1900u);
  }
}

TEST(Failover, ThePresenceOfAStandbyChangesNoForce) {
  Session alone = failover_session(kTwo);
  alone.physics.standby.reset();
  for (Side& side : alone.sides) side.mofc.standby_after.reset();
  const auto with = run_stations(failover_session(kTwo), 1s);
  const auto without = run_stations(alone, 1s);
  for (std::size_t i = 0; i < with.size(); ++i) {
    ASSERT_EQ(with[i].rows.size(), without[i].rows.size());
    for (std::size_t k = 0; k < with[i].rows.size(); ++k) {
      ASSERT_EQ(with[i].rows[k].device.force_on_hand_newton,
                without[i].rows[k].device.force_on_hand_newton);
    }
  }
}

TEST(Failover, AStoppedPhysicsIsReplacedForAllSidesTogetherAndBecomesTheStandby) {
  LockstepOptions options;
  options.is_stopped = [](PhysicsRole role, TimePoint now) {
    return is_first(role) && now >= kFaultAt && now < kFaultAt + 700ms;
  };
  const auto stations = run_stations(failover_session(kTwo), 3500ms, options);
  expect_nothing_felt(stations, "stopped");
  for (const Station& station : stations) {
    EXPECT_FALSE(station.is_from_standby(kFaultAt + 50ms));
    EXPECT_TRUE(station.is_from_standby(kFaultAt + 90ms));
    EXPECT_EQ(station.mofc.physics_term, 1u) << "the first one does not take back";
    EXPECT_EQ(station.mofc.physics_switches, 1u);
  }
}

// Without a standby the same fault is felt: the bound can fail.
TEST(Failover, WithoutAStandbyTheForceFades) {
  LockstepOptions options;
  options.is_stopped = [](PhysicsRole role, TimePoint now) {
    return is_first(role) && now >= kFaultAt && now < kFaultAt + 700ms;
  };
  Session alone = failover_session(kTwo);
  alone.physics.standby.reset();
  for (Side& side : alone.sides) {
    side.mofc.standby_after.reset();
    side.mofc.still_after = Duration::zero();  // else tissue follows its law for so long
  }
  for (const Station& station : run_stations(alone, 2500ms, options)) {
    EXPECT_LT(station.fault.ideal_transparency(), kNothingFelt);
    EXPECT_GT(station.mofc.stale_ticks, 100u);
  }
}

TEST(Failover, ASlowPhysicsIsReplaced) {
  LockstepOptions options;  // one step in 200 ms
  options.is_stopped = [](PhysicsRole role, TimePoint now) {
    return is_first(role) && now >= kFaultAt && (now - kFaultAt) % 200ms > 1ms;
  };
  const auto stations = run_stations(failover_session(kTwo), 3500ms, options);
  expect_nothing_felt(stations, "slow");
  for (const Station& station : stations) EXPECT_EQ(station.mofc.physics_term, 1u);
}

TEST(Failover, ASideThatIsCutOffTakesTheOthersAlong) {
  LockstepOptions options;
  options.is_cut = [](std::size_t side, PhysicsRole role, TimePoint now) {
    return side == 0 && is_first(role) && now >= kFaultAt;
  };
  const auto stations = run_stations(failover_session(kTwo), 3500ms, options);
  expect_nothing_felt(stations, "one side cut off");
  for (const Station& station : stations) {
    EXPECT_TRUE(station.is_from_standby(kFaultAt + 90ms)) << "two hands in one tissue";
    EXPECT_EQ(station.mofc.physics_term, 1u);
  }
}

// The left hears the standby only, the right the first only: there is no physics that both hear.
// Each stays with what it hears, without a flutter, and both meet when the network heals.
TEST(Failover, APartitionThatLeavesNoCommonPhysicsIsNotFeltAndHeals) {
  LockstepOptions options;
  options.is_cut = [](std::size_t side, PhysicsRole role, TimePoint now) {
    if (now < kFaultAt || now >= kFaultAt + 1s) return false;
    return (side == 0) == is_first(role);
  };
  const auto stations = run_stations(failover_session(kTwo), 3500ms, options);
  expect_nothing_felt(stations, "no common physics");
  EXPECT_TRUE(stations[0].is_from_standby(kFaultAt + 900ms));
  EXPECT_FALSE(stations[1].is_from_standby(kFaultAt + 900ms));
  EXPECT_EQ(stations[0].rows.back().mofc->is_from_standby,
            stations[1].rows.back().mofc->is_from_standby);
  EXPECT_EQ(stations[0].mofc.physics_term, stations[1].mofc.physics_term);
  for (const Station& station : stations) EXPECT_LE(station.mofc.physics_switches, 2u);
}

TEST(Failover, ThoseWhoFailInTurnReplaceEachOther) {
  LockstepOptions options;  // 400 ms of silence each, 600 ms of both
  options.is_stopped = [](PhysicsRole role, TimePoint now) {
    if (now < kFaultAt) return false;
    const Duration phase = (now - kFaultAt) % 2s;
    return is_first(role) ? phase < 400ms : phase >= 1s && phase < 1400ms;
  };
  const auto stations = run_stations(failover_session(kTwo), 5500ms, options);
  expect_nothing_felt(stations, "in turn");
  for (const Station& station : stations) {
    EXPECT_EQ(station.mofc.physics_term, 4u);
    EXPECT_EQ(station.mofc.physics_switches, 4u);
  }
}

TEST(Failover, APauseThatBothShareSwitchesNothing) {
  LockstepOptions options;
  options.is_cut = [](std::size_t, PhysicsRole, TimePoint now) {
    return now >= kFaultAt && (now - kFaultAt) % 500ms < 100ms;
  };
  const auto stations = run_stations(failover_session(kTwo), 3500ms, options);
  expect_nothing_felt(stations, "shared pauses");
  for (const Station& station : stations) EXPECT_EQ(station.mofc.physics_switches, 0u);
}

TEST(Failover, MovingTissueDoesNotJumpHoweverFarTheClocksAreApart) {
  for (const Duration ahead : {Duration(1700ms), Duration(1234567s)}) {
    LockstepOptions options;
    options.standby_clock_ahead = ahead;
    options.is_stopped = [](PhysicsRole role, TimePoint now) {
      return is_first(role) && now >= kFaultAt;
    };
    const auto stations = run_stations(failover_session(kTwo), 3500ms, options);
    expect_nothing_felt(stations, "clocks apart");
    for (const Station& station : stations) EXPECT_EQ(station.mofc.physics_term, 1u);
  }
}

// A second failure after the first: the physics that is back has to follow the clock of the other.
TEST(Failover, ThePhysicsThatIsBackFollowsTheTimeOfTheOther) {
  LockstepOptions options;
  options.standby_clock_ahead = 1700ms;
  options.is_stopped = [](PhysicsRole role, TimePoint now) {
    return is_first(role) ? now >= kFaultAt && now < kFaultAt + 500ms : now >= kFaultAt + 1200ms;
  };
  const auto stations = run_stations(failover_session(kTwo), 3500ms, options);
  expect_nothing_felt(stations, "there and back");
  for (const Station& station : stations) EXPECT_EQ(station.mofc.physics_term, 2u);
}

// Faults of the session's own: hops 2 and 3 of both physics, with delay and loss.
TEST(Failover, OverALateAndLossyNetwork) {
  const std::string late = "{delay_ms: 10 jitter_ms: 5 loss_ratio: 0.05}";
  const auto stations = run_stations(
      failover_session(kTwo, {"faults.tool_motion=" + late, "faults.standby_tool_motion=" + late,
                              "faults.standby_interaction=" + late,
                              "faults.interaction={delay_ms: 10 jitter_ms: 5 loss_ratio: 0.05 "
                              "outage { from_s: 1.5 until_s: 2.5 }}"}),
      3500ms);
  expect_nothing_felt(stations, "late and lossy");
  for (const Station& station : stations) EXPECT_EQ(station.mofc.physics_term, 1u);
}

// The messages through the codecs and sockets give the same bits as memory.
TEST(Failover, TheWireCarriesTheTerm) {
  LockstepOptions options;
  options.is_stopped = [](PhysicsRole role, TimePoint now) {
    return is_first(role) && now >= kFaultAt;
  };
  const Session session = failover_session(kTwo);
  const auto memory = run_stations(session, 2s, options);
  options.links = LockstepLinks::kInproc;
  const auto inproc = run_stations(session, 2s, options);
  for (std::size_t i = 0; i < memory.size(); ++i) {
    EXPECT_EQ(inproc[i].mofc.physics_term, 1u);
    for (std::size_t k = 0; k < memory[i].rows.size(); ++k) {
      ASSERT_EQ(memory[i].rows[k].device.force_on_hand_newton,
                inproc[i].rows[k].device.force_on_hand_newton);
    }
  }
}

// Nothing of the guarantee leans on who speaks: two physics that lie and fall silent at random.
TEST(Failover, TwoLyingPhysicsGiveTheHandNoEnergy) {
  double least_joule = 0.0;
  std::uint64_t switches = 0;
  const std::uint64_t runs = test::seed_count(5);
  for (std::uint64_t seed = 1; seed <= runs; ++seed) {
    const Session session =
        failover_session(kTwo, {"adversary.physics=everything", "seed=" + std::to_string(seed)});
    Random random(seed);
    std::vector<double> silent_from_s(2);
    LockstepOptions options;
    options.is_stopped = [&](PhysicsRole role, TimePoint now) {
      double& from_s = silent_from_s[index_of(role)];
      const double now_s = to_seconds(now.time_since_epoch());
      if (now_s > from_s + 0.3) from_s = now_s + random.uniform(0.05, 0.6);
      return now_s >= from_s;
    };
    options.tamper_with_interaction = [&](Interaction& interaction) {
      if (random.uniform(0.0, 1.0) < 0.01) interaction.physics_term += 1;
    };
    for (const Station& station : run_stations(session, 2s, options, false)) {
      for (const TickRow& row : station.rows) {
        least_joule = std::min(least_joule, row.device.minimum_true_energy_joule);
      }
      switches += station.mofc.physics_switches;
    }
  }
  std::printf(
      "%llu runs of two sides with two lying physics: least true energy %.3g µJ, %llu "
      "switches\n",
      static_cast<unsigned long long>(runs), 1e6 * least_joule,
      static_cast<unsigned long long>(switches));
  EXPECT_GE(least_joule, -kRoundingJoule);
  EXPECT_GT(switches, 20 * runs);
}

TEST(ManyStations, SixteenSidesRunTogether) {
  std::string sides;
  for (int i = 0; i < 16; ++i) {
    sides += "side { name: \"hand" + std::to_string(i) + "\" }\n";
  }
  const Session session = failover_session(sides);
  const auto stations = run_stations(session, 300ms, {}, false);
  ASSERT_EQ(stations.size(), 16u);
  for (std::size_t i = 0; i < stations.size(); ++i) {
    EXPECT_EQ(stations[i].device.answered_ticks, 300u);
    // each tool deforms tissue for itself: the others change nothing
    const auto alone =
        run_stations(with_only_side(session, session.sides[i].name), 300ms, {}, false);
    ASSERT_EQ(alone.front().rows.size(), stations[i].rows.size());
    EXPECT_GT(stations[i].rows.back().device.force_on_hand_newton.norm(), 0.1);
    EXPECT_EQ(stations[i].rows.back().device.force_on_hand_newton,
              alone.front().rows.back().device.force_on_hand_newton);
  }
}

}  // namespace
}  // namespace palpate
