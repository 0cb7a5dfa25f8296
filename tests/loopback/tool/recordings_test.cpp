// SPDX-License-Identifier: Apache-2.0
// Recordings made of recordings, and what a damaged one is said to be.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "palpate/v1/plot.pb.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/temp_folder.h"
#include "viewer_node/recording/mcap_format.h"
#include "viewer_node/recording/mcap_reader.h"

namespace palpate {
namespace {

using nlohmann::json;
using test::Outcome;
using test::run_program;
using test::text_of;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// Tissue that moves, so that there are meshes all the time.
constexpr const char* kMoving = R"(
name: "moving"
device { monitor: off }
hand { hold { position_m { z: -0.005 } } }
mofc { controller: none }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 200 }
                 motion { amplitude_m { z: 0.001 } frequency_hz: 1 } } }
viewer { web { disabled: true } }
)";

class RecordingTools : public testing::Test {
 protected:
  RecordingTools() {
    session_ = files_.write("moving.txtpb", kMoving);
    EXPECT_EQ(palpate({"loopback", session_, "--seconds", "3", "--no-ideal", "--record",
                       path("run.mcap"), "--csv", path("run.csv"), "--json", path("run.json")})
                  .status,
              0);
  }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (files_.path() / name).string();
  }
  static Outcome palpate(const std::vector<std::string>& arguments) {
    return run_program("palpate", arguments);
  }
  [[nodiscard]] json info(const std::string& name) const {
    return json::parse(palpate({"info", path(name), "--json"}).out);
  }
  [[nodiscard]] std::string table(const std::string& name) const {
    const Outcome outcome = palpate({"export", path(name), "--csv", "-"});
    EXPECT_EQ(outcome.status, 0) << outcome.err;
    return outcome.out;
  }
  /// The recording with one byte changed in the middle of a chunk.
  void damage(const std::string& name) const {
    std::string bytes = text_of(path("run.mcap"));
    bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
    std::ofstream(path(name), std::ios::binary) << bytes;
  }

  test::TempFolder files_;
  std::string session_;
};

TEST_F(RecordingTools, APartBeginsWithTheSceneAsItWas) {
  ASSERT_EQ(
      palpate({"cut", path("run.mcap"), path("part.mcap"), "--from", "1", "--to", "2"}).status, 0);
  const json part = info("part.mcap");
  EXPECT_TRUE(part["is_whole"]);
  EXPECT_NEAR(part["length_s"], 1.0, 0.05);
  EXPECT_EQ(part["messages"]["/scene_state"], 1);
  EXPECT_NEAR(part["ticks"]["device"], 1000, 25);
  EXPECT_EQ(part["copy"]["command"], "cut");
  // counts are those of the part, which are judged alone
  EXPECT_EQ(part["figures"]["ticks"], part["ticks"]["device"]);
  EXPECT_EQ(part["figures"]["received"]["ticks"], part["ticks"]["device"]);
  EXPECT_LE(part["figures"]["in_contact_ticks"], part["figures"]["ticks"]);
  EXPECT_LE(part["figures"]["answered_ratio"], 1.0);
  EXPECT_EQ(part["begin_ns"], 1'000'000'000);
  // its rows are rows of the whole
  const std::string rows = table("part.mcap");
  const std::size_t first = rows.find('\n') + 1;
  EXPECT_THAT(text_of(path("run.csv")), HasSubstr(rows.substr(first)));
}

TEST_F(RecordingTools, OnlyTheChosenTopicsAreCopied) {
  ASSERT_EQ(palpate({"cut", path("run.mcap"), path("few.mcap"), "--topics", "/device,mofc"}).status,
            0);
  const json few = info("few.mcap");
  EXPECT_EQ(few["messages"].size(), 2u);
  EXPECT_EQ(table("few.mcap"), text_of(path("run.csv")));

  const Outcome none = palpate({"cut", path("run.mcap"), path("x.mcap"), "--topics", "/devices"});
  EXPECT_EQ(none.status, 2);
  EXPECT_THAT(none.err, HasSubstr("has none of them; it has /device, /mofc"));
  const Outcome empty =
      palpate({"cut", path("run.mcap"), path("x.mcap"), "--from", "2", "--to", "1"});
  EXPECT_EQ(empty.status, 2);
  EXPECT_THAT(empty.err, HasSubstr("--to 1: is not after --from 2"));
  EXPECT_EQ(palpate({"cut", path("run.mcap"), path("x.mcap"), "--from", "4"}).status, 2);
  EXPECT_FALSE(std::filesystem::exists(path("x.mcap")));
}

// what cannot be known is not judged
TEST_F(RecordingTools, APartWithSomeTopicsIsJudgedByThem) {
  for (const char* topics : {"/device", "/mofc", "/physics", "/device,/physics"}) {
    ASSERT_EQ(
        palpate({"cut", path("run.mcap"), path("few.mcap"), "--overwrite", "--topics", topics})
            .status,
        0);
    const json verdict = info("few.mcap")["figures"]["verdict"];
    EXPECT_EQ(verdict["findings"][0]["what"], "left_out") << topics;
    for (const json& finding : verdict["findings"]) {  // it has no controller, which is known
      EXPECT_TRUE(finding["grade"] != "bad" || finding["what"] == "energy_extracted")
          << topics << verdict.dump(1);
    }
  }
}

TEST_F(RecordingTools, TwoPartsTogetherAreTheWhole) {
  ASSERT_EQ(palpate({"cut", path("run.mcap"), path("a.mcap"), "--to", "1.5"}).status, 0);
  ASSERT_EQ(palpate({"cut", path("run.mcap"), path("b.mcap"), "--from", "1.2"}).status, 0);
  const Outcome merged = palpate({"merge", path("b.mcap"), path("a.mcap"), path("all.mcap")});
  EXPECT_EQ(merged.status, 0) << merged.err;
  EXPECT_THAT(merged.err, HasSubstr("messages were in two recordings, and are written once"));
  EXPECT_EQ(table("all.mcap"), text_of(path("run.csv")));

  ASSERT_EQ(palpate({"merge", path("a.mcap"), path("b.mcap"), path("row.mcap"), "--append"}).status,
            0);
  EXPECT_NEAR(info("row.mcap")["length_s"], 1.5 + 1.8, 0.05);
}

TEST_F(RecordingTools, TwoRunsInARowAreARestart) {
  ASSERT_EQ(palpate({"loopback", session_, "--seconds", "1", "--record", path("again.mcap"),
                     "--csv", path("again.csv")})
                .status,
            0);
  ASSERT_EQ(
      palpate({"merge", path("run.mcap"), path("again.mcap"), path("row.mcap"), "--append"}).status,
      0);
  const std::string again = text_of(path("again.csv"));
  EXPECT_EQ(table("row.mcap"), text_of(path("run.csv")) + again.substr(again.find('\n') + 1));
  const json row = info("row.mcap");
  EXPECT_EQ(row["figures"]["ticks"], 4000);
  EXPECT_EQ(row["figures"]["received"]["ticks"], 4000);
  EXPECT_THAT(row["figures"]["verdict"]["cause"], testing::Not("device_restarted"));
  // the times of the second run follow those of the first
  ASSERT_EQ(palpate({"export", path("row.mcap"), "--ros", path("row_ros.mcap")}).status, 0);
  viewer::McapReader ros(path("row_ros.mcap"));
  EXPECT_NEAR(static_cast<double>(ros.end_ns()) * 1e-9, 4.0, 0.05);
}

TEST_F(RecordingTools, TheIdealForceIsRecordedByLoopback) {
  ASSERT_EQ(palpate({"loopback", session_, "--seconds", "1", "--record", path("ideal.mcap"),
                     "--csv", path("ideal.csv"), "--json", path("ideal.json")})
                .status,
            0);
  EXPECT_EQ(table("ideal.mcap"), text_of(path("ideal.csv")));
  ASSERT_EQ(palpate({"report", path("ideal.mcap"), "-o", path("ideal.html")}).status, 0);
  const json run = json::parse(text_of(path("ideal.json")));
  char figure[32];
  std::snprintf(figure, sizeof(figure), "%.3f", run["transparency"]["ideal"].get<double>());
  EXPECT_THAT(text_of(path("ideal.html")),
              AllOf(HasSubstr("<th>ideal force</th><td>" + std::string(figure)),
                    HasSubstr(R"("name":"ideal")")));
  // without: neither a column nor a claim
  ASSERT_EQ(palpate({"report", path("run.mcap"), "-o", path("none.html")}).status, 0);
  EXPECT_THAT(text_of(path("none.html")), AllOf(HasSubstr("<th>ideal force</th><td>not recorded"),
                                                Not(HasSubstr(R"("name":"ideal")"))));
}

TEST_F(RecordingTools, TheTorqueOfAWristIsReportedAndExported) {
  ASSERT_EQ(
      palpate({"loopback", test::source_dir() + "/deploy/sessions/tools/lever.txtpb", "--seconds",
               "1", "--record", path("lever.mcap"), "--json", path("lever.json")})
          .status,
      0);
  const double largest_newton_m =
      json::parse(text_of(path("lever.json")))["max_torque_newton_m"].get<double>();
  ASSERT_GT(largest_newton_m, 0.01);
  ASSERT_EQ(palpate({"report", path("lever.mcap"), "-o", path("lever.html")}).status, 0);
  char figure[32];
  std::snprintf(figure, sizeof(figure), "%.4f", largest_newton_m);
  const std::string heading = "<h2>Torque on the joints of the wrist";
  EXPECT_THAT(
      text_of(path("lever.html")),
      AllOf(HasSubstr(heading), HasSubstr("<th>torque</th><td>largest " + std::string(figure))));
  ASSERT_EQ(palpate({"report", path("run.mcap"), "-o", path("none.html")}).status, 0);
  EXPECT_THAT(text_of(path("none.html")),
              AllOf(Not(HasSubstr(heading)), Not(HasSubstr("<th>torque"))));

  const auto largest_exported_newton_m = [&](const std::string& recording) {
    EXPECT_EQ(
        palpate({"export", path(recording), "--foxglove", path("foxglove_" + recording)}).status,
        0);
    viewer::McapReader exported(path("foxglove_" + recording));
    double largest = -1.0;
    while (const auto message = exported.next()) {
      const auto& topics = exported.topics();
      const auto topic = std::find_if(topics.begin(), topics.end(), [&](const auto& one) {
        return one.id == message->channel_id;
      });
      if (topic == topics.end() || topic->topic != "/telemetry") continue;
      v1::Telemetry tick;
      EXPECT_TRUE(tick.ParseFromString(std::string(message->payload)));
      if (!tick.has_wrist_torque_newton_m()) continue;
      const auto& t = tick.wrist_torque_newton_m();
      largest = std::max({largest, std::abs(t.x()), std::abs(t.y()), std::abs(t.z())});
      EXPECT_GE(tick.applied_newton_m(), std::abs(t.y()));
    }
    return largest;
  };
  EXPECT_NEAR(largest_exported_newton_m("lever.mcap"), largest_newton_m, 1e-12);
  EXPECT_EQ(largest_exported_newton_m("run.mcap"), -1.0) << "no wrist, no torque";
}

// Holes of 9 ms, so leases end by themselves; answers that come 0.3 ms after the reading.
TEST_F(RecordingTools, EnergyAndFiguresOfARecordingAreComputedAgain) {
  ASSERT_EQ(palpate({"loopback", session_, "--seconds", "1", "--record", path("holes.mcap"),
                     "--json", path("holes.json"), "--set", "mofc.controller=mofc", "--set",
                     "faults.force_command.delay_ms=0.3", "--set",
                     "faults.device.skip={from_s: 0.0201 until_s: 0.029 every_s: 0.05}"})
                .status,
            0);
  const Outcome again = palpate({"report", path("holes.mcap"), "--recompute"});
  EXPECT_EQ(again.status, 0) << again.err;
  const json run = json::parse(text_of(path("holes.json")));
  char transparency[64];
  const double ideal = run["transparency"]["ideal"].get<double>();
  std::snprintf(transparency, sizeof(transparency), "%.6f, recorded %.6f", ideal, ideal);
  char gain[64];
  std::snprintf(gain, sizeof(gain), "%.6f, recorded %.6f", run["gain"].get<double>(),
                run["gain"].get<double>());
  EXPECT_THAT(again.out, AllOf(HasSubstr("true tool position      the same in every tick"),
                               HasSubstr("true energy             the same in every tick"),
                               HasSubstr(transparency), HasSubstr(gain),
                               HasSubstr("recorded nowhere above what acted allows"),
                               HasSubstr("the same as recorded"), Not(HasSubstr("NOT"))));

  // a part of it does not begin with the hand
  ASSERT_EQ(palpate({"cut", path("holes.mcap"), path("end.mcap"), "--from", "0.5"}).status, 0);
  const Outcome part = palpate({"report", path("end.mcap"), "--recompute"});
  EXPECT_THAT(part.out, AllOf(HasSubstr("not moved again: from tick 0 on: ticks are missing"),
                              HasSubstr("what was compared agrees")));
  // and one of the two outputs is needed
  EXPECT_THAT(palpate({"report", path("holes.mcap")}).err, HasSubstr("--recompute"));
}

TEST_F(RecordingTools, WhatCannotBeCopiedIsSaid) {
  std::ofstream(path("begin.mcap"), std::ios::binary) << text_of(path("run.mcap")).substr(0, 100);
  const Outcome recovered = palpate({"recover", path("begin.mcap"), path("x.mcap")});
  EXPECT_EQ(recovered.status, 2);
  EXPECT_THAT(recovered.err, HasSubstr("has no topic that can be read"));
  const Outcome merged = palpate({"merge", path("run.mcap"), path("x.mcap")});
  EXPECT_EQ(merged.status, 2);
  EXPECT_THAT(merged.err, HasSubstr("give two recordings or more, and last the file to write"));
  // a recording is no session
  EXPECT_THAT(palpate({"loopback", path("run.mcap")}).err, HasSubstr("it is not UTF-8 text"));
}

TEST_F(RecordingTools, RecordingsOfDifferentSessionsAreNotMerged) {
  ASSERT_EQ(palpate({"loopback", session_, "--seconds", "1", "--no-ideal", "--set", "seed=2",
                     "--record", path("other.mcap")})
                .status,
            0);
  const Outcome outcome =
      palpate({"merge", path("run.mcap"), path("other.mcap"), path("all.mcap")});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("of different sessions"));
}

TEST_F(RecordingTools, ADamagedRecordingIsSaidToBeDamaged) {
  damage("damaged.mcap");
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"export", path("damaged.mcap"), "--csv", path("damaged.csv")},
        {"export", path("damaged.mcap"), "--foxglove", path("damaged_foxglove.mcap")},
        {"report", path("damaged.mcap"), "-o", path("damaged.html")},
        {"info", path("damaged.mcap")}}) {
    const Outcome outcome = palpate(command);
    EXPECT_EQ(outcome.status, 1) << command.front();
    EXPECT_THAT(outcome.err, HasSubstr("is damaged; missing: 1 damaged chunks; `palpate recover`"));
  }
  EXPECT_THAT(text_of(path("damaged.html")), HasSubstr("is damaged; missing: 1 damaged chunks"));
  ASSERT_EQ(palpate({"report", path("run.mcap"), "-o", path("run.html")}).status, 0);
  EXPECT_THAT(text_of(path("run.html")), Not(HasSubstr("is damaged")));

  const Outcome recovered = palpate({"recover", path("damaged.mcap"), path("recovered.mcap")});
  EXPECT_EQ(recovered.status, 0) << recovered.err;
  EXPECT_THAT(recovered.err, HasSubstr("damaged.mcap: 1 damaged chunks left out"));
  const json whole = info("recovered.mcap");
  EXPECT_TRUE(whole["is_whole"]);
  EXPECT_EQ(whole["damaged_chunks"], 0);
  EXPECT_EQ(whole["copy"]["damaged_chunks"], "1");
  EXPECT_EQ(table("recovered.mcap"), text_of(path("damaged.csv")));
}

// Outside chunks there is no check sum.
TEST_F(RecordingTools, RecoverLeavesOutMessagesThatCannotBeDecoded) {
  const std::string whole = text_of(path("run.mcap"));
  viewer::McapReader run(path("run.mcap"));
  std::uint16_t device = 0;
  for (const auto& topic : run.topics()) device = topic.topic == "/device" ? topic.id : device;
  const auto message = [&](std::string_view payload) {
    std::string bytes;
    viewer::mcap::Bytes(bytes).head(viewer::mcap::Opcode::kMessage, 22 + payload.size());
    viewer::mcap::Bytes(bytes).number(device).number(std::uint32_t{0});
    viewer::mcap::Bytes(bytes).number(std::uint64_t{9}).number(std::uint64_t{9});
    return bytes.append(payload);
  };
  std::string good;
  while (const auto next = run.next()) {
    if (next->channel_id == device) good = next->payload;
  }
  // up to the first chunk, which the header, definitions and metadata precede
  std::size_t begin = viewer::mcap::kMagic.size();
  while (whole[begin] != static_cast<char>(viewer::mcap::Opcode::kChunk)) {
    viewer::mcap::Fields head(std::string_view(whole).substr(begin + 1));
    begin += viewer::mcap::kRecordHead + head.number<std::uint64_t>();
  }
  std::string damaged = good;
  for (char& c : damaged) c = '\xff';
  std::ofstream(path("bare.mcap"), std::ios::binary)
      << whole.substr(0, begin) << message(good) << message(damaged) << std::string(500, '\x7f')
      << message(good);

  const Outcome recovered = palpate({"recover", path("bare.mcap"), path("x.mcap"), "--quiet"});

  EXPECT_EQ(recovered.status, 0) << recovered.err;
  EXPECT_THAT(recovered.err,
              HasSubstr("bare.mcap: 1 unreadable messages, 500 unreadable bytes left out"));
  EXPECT_EQ(info("x.mcap")["messages"]["/device"], 2);
  EXPECT_EQ(info("x.mcap")["copy"]["unreadable_bytes"], "500");
}

TEST_F(RecordingTools, OneRunHasOneSetOfFigures) {
  const json run = json::parse(text_of(path("run.json")));
  const json recorded = info("run.mcap")["figures"];
  for (const char* key :
       {"controller", "ticks", "min_true_energy_j", "max_force_n", "largest_jump_n", "monitor",
        "monitor_reductions", "ledger_excesses", "answered_ratio", "motions_suppressed",
        "interactions_suppressed", "fallbacks"}) {
    EXPECT_EQ(run[key], recorded[key]) << key;
  }
  // what the loopback counts otherwise has another name
  EXPECT_EQ(run["transparency"]["vector"], recorded["received"]["transparency"]);
  EXPECT_EQ(run["clamp_ratio"], recorded["received"]["clamp_ratio"]);
}

// with the path of the ideal run, which the recording has
TEST_F(RecordingTools, OneRunHasOneVerdict) {
  const std::string session = test::source_dir() + "/deploy/sessions/default.txtpb";
  ASSERT_EQ(palpate({"loopback", session, "--seconds", "3", "--record", path("ideal.mcap"),
                     "--json", path("ideal.json")})
                .status,
            0);
  const json run = json::parse(text_of(path("ideal.json")));
  const json recorded = info("ideal.mcap")["figures"]["verdict"];
  const auto finding = [](const json& verdict) {
    for (const json& one : verdict["findings"]) {
      if (one["what"] == "reversals") return one;
    }
    return json();
  };
  EXPECT_FALSE(finding(recorded).is_null()) << recorded;
  EXPECT_EQ(finding(recorded), finding(run["verdict"]));
  EXPECT_THAT(palpate({"info", path("ideal.mcap")}).out,
              AllOf(HasSubstr("\n  good  "), HasSubstr("reversals more than the ideal run")));
  ASSERT_EQ(palpate({"report", path("ideal.mcap"), "-o", path("ideal.html")}).status, 0);
  const std::string excess = std::to_string(run["velocity_reversals"]["excess"].get<int>());
  EXPECT_THAT(text_of(path("ideal.html")), HasSubstr(", " + excess + " more than the ideal run"));
}

TEST_F(RecordingTools, AReportShowsTwoRunsSideBySide) {
  ASSERT_EQ(palpate({"cut", path("run.mcap"), path("part.mcap"), "--from", "1"}).status, 0);
  ASSERT_EQ(
      palpate({"report", path("run.mcap"), path("part.mcap"), "-o", path("both.html")}).status, 0);
  const std::string html = text_of(path("both.html"));
  EXPECT_THAT(html, HasSubstr("--runs: 2"));
  for (const std::string& name : {path("run.mcap"), path("part.mcap")}) {
    EXPECT_THAT(html, HasSubstr("<td>" + name + "</td>"));
  }
  const Outcome three = palpate({"report", "a", "b", "c", "-o", path("x.html")});
  EXPECT_EQ(three.status, 2);
}

}  // namespace
}  // namespace palpate
