// SPDX-License-Identifier: Apache-2.0
// What led to a fault is in one file, and the fault is computed again from it.
#include "device_node/post_mortem.h"
#include "common/telemetry/flight_recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/device_node_bench.h"
#include "tests/support/scripted_device.h"
#include "tests/support/temp_folder.h"
#include "tests/support/wired/hostile_commands.h"
#include "tests/support/wired/wired_on_bench.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;
using device::FaultFile;
using device::Journal;
using device::PostMortem;
using device::WireFault;
using testing::HasSubstr;
using testing::StartsWith;

DeviceConfig monitored_config() {
  DeviceConfig config = device_config();
  config.longest_lease = 10ms;
  config.profile.position_resolution_m = 1e-4;
  config.monitor = {.is_on = true, .v_max_m_per_s = 0.5};
  config.accepts_no_motor_watchdog = true;
  return config;
}

/// As the flight recorder writes it.
std::string file_of(const TempFolder& folder, const PostMortem& post_mortem,
                    const std::vector<DeviceTick>& ticks = {}) {
  std::string path = (folder.path() / "flight-device-test.csv").string();
  std::ofstream out(path);
  write_flight_header(out, DeviceTick{});
  for (const DeviceTick& tick : ticks) write_flight_row(out, tick);
  post_mortem.write(out, "a device, phase faulted");
  return path;
}

std::vector<std::string> lines_of(const std::string& path) {
  std::ifstream in(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// A hand that moves, commands that nobody has clamped: the monitor has to reduce many.
struct Wired {
  explicit Wired(WiredDriver driver, std::vector<device::PlannedFault> faults) {
    WiredSpec spec{.side = {}, .driver = driver, .faults = std::move(faults)};
    spec.side.device = monitored_config();
    spec.side.hand = {.mass_kg = 0.1,
                      .stiffness_newton_per_m = 2000.0,
                      .damping_newton_s_per_m = 40.0,
                      .path = HostilePath{.radius_m = 0.012, .v_max_m_per_s = 0.25}};
    bench.emplace(spec.side.device, spec, &journal);
    bench->node.acknowledge();
    bench->on_state = [this](const DeviceState& state) {
      bench->send_answer(state.header.session_id, state.header.sequence,
                         commands.next(state.hand_position_m));
    };
  }
  void run(int ticks) {
    for (int i = 0; i < ticks && !bench->node.has_fault(); ++i) {
      bench->tick();
      if (i % 20 == 19) post_mortem.take(journal);
    }
    post_mortem.take(journal);
  }

  Journal journal;
  PostMortem post_mortem;
  HostileCommands commands{2, 3.3};
  std::optional<DeviceNodeBench<WiredOnBench>> bench;
};

TEST(PostMortem, AWireThatFailsIsInTheFileWithItsBytesAndTheMonitorDecidesTheSameAgain) {
  for (const WiredDriver driver :
       {WiredDriver::kHaply, WiredDriver::kHapi, WiredDriver::kFalcon, WiredDriver::kWooden}) {
    SCOPED_TRACE(static_cast<int>(driver));
    Wired wired(driver, {{.kind = WireFault::kGarbage, .from_s = 3.0, .length_s = 1.0}});
    wired.run(3'500);
    ASSERT_TRUE(wired.bench->node.has_fault());

    const TempFolder folder;
    const FaultFile file =
        device::read_fault_file(file_of(folder, wired.post_mortem, wired.bench->ticks));
    const device::Recomputed recomputed = device::recompute_fault(file);

    EXPECT_EQ(recomputed.fault, wired.bench->node.counters().last_fault);
    EXPECT_EQ(recomputed.different, 0U);
    EXPECT_FALSE(recomputed.has_gap);
    EXPECT_GT(recomputed.entries, 8'000U) << "two seconds of readings, switches and decisions";
    EXPECT_GT(recomputed.reductions, 0U) << "there was something to decide";
    EXPECT_FALSE(recomputed.is_computed) << "the wire failed, not a check of the readings";
    EXPECT_TRUE(recomputed.is_same());
    // both directions, from before the window's end to the fault
    EXPECT_GT(file.transfers.size(), 7'000U);
    const auto is_sent = [](const FaultFile::Transfer& transfer) { return transfer.is_sent; };
    EXPECT_TRUE(std::any_of(file.transfers.begin(), file.transfers.end(), is_sent));
    EXPECT_FALSE(std::all_of(file.transfers.begin(), file.transfers.end(), is_sent));
    EXPECT_THAT(device::fault_text(file, recomputed), HasSubstr("last transfers"));
  }
}

TEST(PostMortem, AJumpOfTheEncoderFollowsFromTheReadings) {
  Journal journal;
  PostMortem post_mortem;
  DeviceNodeBench<ScriptedDevice> bench(monitored_config(), true, &journal);
  bench.answer_with({1.0, 0.0, 0.0}, 2ms);
  for (int i = 0; i < 2'700; ++i) {
    bench.device.position_m = Vector3(1e-4 * (i % 100), 0.0, 0.0);
    if (i % 100 > 50) bench.device.position_m = Vector3(1e-4 * (100 - i % 100), 0.0, 0.0);
    bench.tick();
    post_mortem.take(journal);
  }
  ASSERT_FALSE(bench.node.has_fault());
  bench.device.position_m = Vector3(0.2, 0.0, 0.0);
  bench.tick();
  post_mortem.take(journal);
  ASSERT_EQ(bench.node.counters().last_fault, FaultReason::kPositionJumped);

  const TempFolder folder;
  FaultFile file = device::read_fault_file(file_of(folder, post_mortem, bench.ticks));
  const device::Recomputed recomputed = device::recompute_fault(file);

  EXPECT_TRUE(recomputed.is_computed);
  EXPECT_TRUE(recomputed.is_reproduced);
  EXPECT_EQ(recomputed.different, 0U);
  EXPECT_THAT(device::fault_text(file, recomputed), HasSubstr("reproduced"));
  EXPECT_EQ(file.ticks.size(), bench.ticks.size());

  // the twin: a reading that was none of a jump does not reproduce the fault
  const auto last = std::find_if(
      file.entries.rbegin(), file.entries.rend(),
      [](const device::JournalEntry& entry) { return entry.kind == device::JournalKind::kJudge; });
  last->position_m.setZero();
  const device::Recomputed changed = device::recompute_fault(file);
  EXPECT_FALSE(changed.is_reproduced);
  EXPECT_GT(changed.different, 0U);
}

TEST(PostMortem, TheLedgersOfAClampAreInTheFileAndJudgedAgain) {
  Journal journal;
  PostMortem post_mortem;
  DeviceNodeBench<ScriptedDevice> bench(monitored_config(), true, &journal);
  bench.answer_with({1.0, 0.0, 0.0}, 2ms);
  for (int i = 0; i < 1'000; ++i) {
    bench.ledger_joule = i < 900 ? 1e-9 * i : 5.0;  // no hand has put in 5 J
    bench.tick();
    if (i % 20 == 19) post_mortem.take(journal);
  }
  bench.device.fails_to_read = true;
  bench.tick();
  post_mortem.take(journal);
  const TempFolder folder;
  const FaultFile file = device::read_fault_file(file_of(folder, post_mortem, bench.ticks));
  const device::Recomputed recomputed = device::recompute_fault(file);

  EXPECT_GT(recomputed.ledgers, 800U);
  EXPECT_EQ(recomputed.ledger_excesses, bench.node.counters().ledger_excesses);
  EXPECT_NEAR(static_cast<double>(recomputed.ledger_excesses), 100.0, 2.0);
  EXPECT_EQ(recomputed.different, 0U);
  const std::string text = device::fault_text(file, recomputed);
  EXPECT_THAT(text, HasSubstr("ledgers above what the hand can have put in"));
  EXPECT_THAT(text, HasSubstr(" 5000000.0\n"));
}

TEST(PostMortem, AnotherStateOrALostEntryIsNoticed) {
  Wired wired(WiredDriver::kHapi, {{.kind = WireFault::kGarbage, .from_s = 3.0, .length_s = 1.0}});
  wired.run(3'500);
  const TempFolder folder;
  const FaultFile file = device::read_fault_file(file_of(folder, wired.post_mortem));

  FaultFile anew = file;
  anew.state->monitor = device::ForceMonitor(monitored_config());
  EXPECT_GT(device::recompute_fault(anew).different, 100U);

  EXPECT_FALSE(device::recompute_fault(anew).is_same());
}

// What was not compared is not the same, and the fault is what its entry says.
TEST(PostMortem, AFileWithAGapNamesItsFaultAndIsNotTheSame) {
  Wired wired(WiredDriver::kHapi, {{.kind = WireFault::kGarbage, .from_s = 3.0, .length_s = 1.0}});
  wired.run(3'500);
  const FaultReason fault = wired.bench->node.counters().last_fault;
  ASSERT_NE(fault, FaultReason::kNone);
  const TempFolder folder;
  const FaultFile file = device::read_fault_file(file_of(folder, wired.post_mortem));
  EXPECT_TRUE(device::recompute_fault(file).is_same());

  const auto expect_incomplete = [&](const FaultFile& damaged, const char* words) {
    const device::Recomputed recomputed = device::recompute_fault(damaged);
    EXPECT_FALSE(recomputed.is_same());
    EXPECT_EQ(recomputed.fault, fault);
    EXPECT_EQ(recomputed.different, 0U);
    const std::string text = device::fault_text(damaged, recomputed);
    EXPECT_THAT(text, HasSubstr(std::string("fault       ") + name(fault)));
    EXPECT_THAT(text, HasSubstr(words));
  };
  FaultFile gap = file;
  gap.entries.erase(gap.entries.begin() + 100);
  EXPECT_TRUE(device::recompute_fault(gap).has_gap);
  expect_incomplete(gap, "100 entries: monitor and checks decide the same, to the bit; 0");
  FaultFile without_first = file;
  without_first.entries.erase(without_first.entries.begin());
  expect_incomplete(without_first, "the first entry after the state");
  FaultFile without_state = file;
  without_state.state.reset();
  expect_incomplete(without_state, "not possible");
}

// 50,000 calls a second.
TEST(PostMortem, AFaultAtEightKilohertzIsComputedAgain) {
  DeviceConfig config = monitored_config();
  config.rate_hz = 8000.0;
  config.reply = 60us;
  config.lease = 250us;
  Journal journal(config.rate_hz);
  PostMortem post_mortem;
  DeviceNodeBench<ScriptedDevice> bench(config, false, &journal);
  bench.node.acknowledge();
  bench.answer_with({0.05, 0.0, 0.0}, 250us);
  std::uint64_t index = 0;
  const auto tick = [&](const Vector3& position_m) {
    bench.device.position_m = position_m;
    const TimePoint at(index * 125us);
    bench.clock.sleep_until(at);
    bench.step({.index = index, .scheduled_at = at, .now = bench.clock.now()});
    bench.states.clear();
    if (++index % 160 == 0) post_mortem.take(journal);
  };
  for (int i = 0; i < 26'000; ++i) tick(Vector3(1e-5 * std::abs(i % 1000 - 500), 0, 0));
  ASSERT_FALSE(bench.node.has_fault());
  tick(Vector3(0.2, 0, 0));
  post_mortem.take(journal);
  ASSERT_EQ(bench.node.counters().last_fault, FaultReason::kPositionJumped);

  const TempFolder folder;
  const FaultFile file = device::read_fault_file(file_of(folder, post_mortem));
  const device::Recomputed recomputed = device::recompute_fault(file);
  EXPECT_TRUE(recomputed.is_same());
  EXPECT_TRUE(recomputed.is_reproduced);
  EXPECT_GT(recomputed.entries, 65'536U);
  ASSERT_TRUE(file.state.has_value());
  EXPECT_GE(file.entries.back().at - file.state->at, PostMortem::kWindow);
  EXPECT_GE(PostMortem::ticks_of_window(config.rate_hz), 20'000U);
  EXPECT_LE(PostMortem::ticks_of_window(50.0), 200U);
}

// The state that a file begins with is one whose next entry is there.
TEST(PostMortem, WhereThereIsMoreThanFitsTheWindowIsShorter) {
  constexpr std::uint64_t kEachTime = 8'000;
  Journal journal;
  PostMortem post_mortem;
  const DeviceConfig config = monitored_config();
  for (int i = 0; i < 60; ++i) {
    const TimePoint at(i * 10ms);
    journal.keep(device::JournalState{.index = journal.next_index(),
                                      .at = at,
                                      .monitor = device::ForceMonitor(config),
                                      .frozen = device::FrozenWatch(config),
                                      .judge = device::ReadingJudge(0.0, 0.0)});
    device::JournalEntry entry;
    entry.kind = device::JournalKind::kFault;
    entry.at = at;
    entry.details.acting_newton = Vector3(Vector3::Zero());
    for (std::uint64_t k = 0; k < kEachTime; ++k) journal.keep(entry);
    post_mortem.take(journal);
  }
  const TempFolder folder;
  const FaultFile file = device::read_fault_file(file_of(folder, post_mortem));
  ASSERT_TRUE(file.state.has_value());
  ASSERT_FALSE(file.entries.empty());
  EXPECT_EQ(file.entries.front().index, file.state->index);
  EXPECT_GT(file.entries.size(), 20 * kEachTime);
  EXPECT_FALSE(device::recompute_fault(file).has_gap);
}

TEST(PostMortem, ItsWindowIsTwoSecondsAndItsMemoryBounded) {
  Wired wired(WiredDriver::kFalcon, {});
  wired.run(9'000);
  const TempFolder folder;
  const FaultFile file = device::read_fault_file(file_of(folder, wired.post_mortem));

  ASSERT_TRUE(file.state.has_value());
  const Duration window = file.entries.back().at - file.state->at;
  EXPECT_GE(window, PostMortem::kWindow);
  EXPECT_LE(window, PostMortem::kWindow + Journal::kStateEvery + 2ms);
  EXPECT_EQ(device::recompute_fault(file).different, 0U);
}

TEST(PostMortem, TheTickDoesNotAllocateForIt) {
  Journal journal;
  DeviceNodeBench<ScriptedDevice> bench(monitored_config(), true, &journal);
  bench.answer_with({1.0, 0.0, 0.0});
  EXPECT_EQ(bench.allocations_of_ticks(), 0U);
  std::optional<device::JournalState> state;
  EXPECT_TRUE(journal.take(state));
}

// Wherever the disk was full, or the copy ended.
TEST(PostMortem, AFileThatEndsTooEarlyIsNotTheSame) {
  Wired wired(WiredDriver::kHapi, {{.kind = WireFault::kGarbage, .from_s = 3.0, .length_s = 1.0}});
  wired.run(3'500);
  const TempFolder folder;
  const std::string path = file_of(folder, wired.post_mortem);
  const std::vector<std::string> lines = lines_of(path);
  EXPECT_TRUE(device::recompute_fault(device::read_fault_file(path)).is_same());
  for (const std::size_t kept : {lines.size() - 1, lines.size() - 20, lines.size() / 2}) {
    std::ofstream out(path);
    for (std::size_t i = 0; i < kept; ++i) out << lines[i] << '\n';
    out.close();
    const FaultFile file = device::read_fault_file(path);
    const device::Recomputed recomputed = device::recompute_fault(file);
    EXPECT_FALSE(recomputed.is_same());
    EXPECT_THAT(device::fault_text(file, recomputed), HasSubstr("ends too early"));
  }
}

// By its name: without its columns it was taken for a recording.
TEST(PostMortem, AFileWithoutItsColumnsIsRefusedAsAFlightRecording) {
  const TempFolder folder;
  const std::string path = (folder.path() / "flight-device-x.csv").string();
  std::ofstream(path) << "#version 1\n";
  EXPECT_TRUE(device::is_fault_file(path));
  EXPECT_THAT([&] { static_cast<void>(device::read_fault_file(path)); },
              testing::ThrowsMessage<SetupError>(HasSubstr("flight-device-x.csv:1: not the columns "
                                                           "of a flight recording")));
  EXPECT_FALSE(device::is_fault_file((folder.path() / "run.mcap").string()));
}

TEST(PostMortem, ADamagedFileIsRefusedWithItsLine) {
  Wired wired(WiredDriver::kHapi, {});
  wired.run(600);
  const TempFolder folder;
  const std::string path = file_of(folder, wired.post_mortem);
  const std::vector<std::string> lines = lines_of(path);
  const auto refusal = [&](std::size_t line, const std::string& text) {
    const std::string damaged = (folder.path() / "damaged.csv").string();
    std::ofstream out(damaged);
    for (std::size_t i = 0; i < lines.size(); ++i) out << (i == line ? text : lines[i]) << '\n';
    out.close();
    try {
      static_cast<void>(device::read_fault_file(damaged));
    } catch (const SetupError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };

  ASSERT_THAT(lines[3], HasSubstr("#state"));
  ASSERT_THAT(lines.back(), StartsWith("#end "));
  EXPECT_THAT(refusal(2, "#device another, phase faulted"), HasSubstr("checksum"));
  ASSERT_THAT(lines[lines.size() - 2], StartsWith("#wire "));
  std::string other = lines[lines.size() - 2];
  other.back() = other.back() == '0' ? '1' : '0';
  EXPECT_THAT(refusal(lines.size() - 2, other), HasSubstr("checksum"));
  EXPECT_THAT(refusal(lines.size() - 1, lines.back() + "\n#wire 5 > 1 00"),
              HasSubstr("nothing follows the end"));
  EXPECT_THAT(refusal(3, lines[3].substr(0, lines[3].size() / 2)), HasSubstr("damaged.csv:4: "));
  EXPECT_THAT(refusal(3, "#state 1 2 three"), HasSubstr("the state is not complete"));
  EXPECT_THAT(refusal(4, "#entry 0 200"), HasSubstr("damaged.csv:5: the entry is not complete"));
  EXPECT_THAT(refusal(4, "#wire 5 ? 3 00"), HasSubstr("> or <"));
  EXPECT_THAT(refusal(4, "#wire 5 > 3 0g"), HasSubstr("not hexadecimal"));
  EXPECT_THAT(refusal(4, "1,2,3"), HasSubstr("3 values"));
  EXPECT_THAT(refusal(4, "#other"), HasSubstr("none of version"));
  EXPECT_THAT(refusal(0, "a,b"), HasSubstr("not the columns"));
  // a path of the account beyond its axes would be read out of bounds
  std::istringstream words(lines[3].substr(std::string("#state ").size()));
  std::vector<std::string> all;
  for (std::string word; words >> word;) all.push_back(word);
  all[6] = "7";
  std::string far = "#state";
  for (const std::string& word : all) far += ' ' + word;
  EXPECT_THAT(refusal(3, far), HasSubstr("the state is not complete"));
}

}  // namespace
}  // namespace palpate::test
