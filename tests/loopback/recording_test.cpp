// SPDX-License-Identifier: Apache-2.0
// Recordings of lockstep runs: the same bits for the same session, and everything that is read from
// them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/version.h"
#include "common/process/run_node.h"
#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "deploy/lockstep/recompute.h"
#include "deploy/palpate/recordings/recording_info.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"
#include "viewer_node/recording/recording_file.h"
#include "viewer_node/recording/report.h"

namespace palpate {
namespace {

using testing::HasSubstr;
using testing::Not;

Session shipped(const std::vector<std::string>& overrides = {},
                const std::string& name = "default") {
  return load_session(test::source_dir() + "/deploy/sessions/" + name + ".txtpb", overrides);
}

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class Recordings : public testing::Test {
 protected:
  /// Runs `session` so long and records it.
  std::string record(const std::string& name, const Session& session, double seconds,
                     const std::string& csv = "") {
    const std::string file = (folder.path() / name).string();
    static_cast<void>(
        run_loopback(session, {.seconds = seconds,
                               .csv_file = csv.empty() ? "" : (folder.path() / csv).string(),
                               .record = {.file = file},
                               .lockstep = {.has_ideal = false}}));
    return file;
  }

  test::TempFolder folder;
};

TEST_F(Recordings, TheSameSessionGivesTheSameFileToTheBit) {
  const std::string first = bytes_of(record("first.mcap", shipped(), 2.0));
  EXPECT_EQ(bytes_of(record("second.mcap", shipped(), 2.0)), first);
  EXPECT_NE(bytes_of(record("other.mcap", shipped({"mofc.controller=none"}), 2.0)), first);
}

TEST_F(Recordings, ASessionReadBackFromItsRecordingRunsTheSame) {
  const std::string first = record("first.mcap", shipped(), 1.0);
  RecordingFile recording(first);
  const Session again = parse_session(recording.about("session"), recording.about("session_file"));
  EXPECT_EQ(bytes_of(record("again.mcap", again, 1.0)), bytes_of(first));
}

// 5 mm · sin(2π 0.25 t), t the virtual time of the step that the frame shows.
TEST_F(Recordings, MovingTissueIsInThemWhereItWas) {
  const Session session =
      shipped({"scene.tissue[0].motion={amplitude_m {z: 0.005} frequency_hz: 0.25}"});
  RecordingFile recording(record("run.mcap", session, 4.0));
  std::size_t frames = 0;
  std::uint64_t told = 0;
  while (const RecordingFile::Item* item = recording.next()) {
    if (const auto* physics = std::get_if<PhysicsBatch>(&item->message)) {
      EXPECT_EQ(physics->counters.meshes_skipped, 0u);
      told = physics->counters.mesh_frames;
    }
    const auto* frame = std::get_if<MeshFrame>(&item->message);
    if (frame == nullptr || frame->tissue != 0) continue;
    ++frames;
    const double t_s = 1e-9 * static_cast<double>(item->log_time_ns);
    EXPECT_NEAR(frame->displacement_world_m.z(), 5e-3 * std::sin(0.5 * std::numbers::pi * t_s),
                2e-5);
  }
  EXPECT_NEAR(static_cast<double>(frames), 120.0, 3.0);
  EXPECT_GE(told, frames);
}

TEST_F(Recordings, TheExportedTableIsTheOneTheRunWrote) {
  RecordingFile recording(record("run.mcap", shipped(), 2.0, "run.csv"));
  const std::string exported = (folder.path() / "exported.csv").string();
  export_csv(recording, exported);
  const std::string table = bytes_of(exported);
  EXPECT_EQ(table, bytes_of((folder.path() / "run.csv").string()));
  EXPECT_EQ(std::count(table.begin(), table.end(), '\n'), 2001);  // 2 s at 1 kHz and the header
}

// Ticks are missing for 9 ms at a time, so leases end by themselves; answers act 0.3 ms after the
// reading.
TEST_F(Recordings, ComputedAgainTheyAreTheSameUnlessHandOrTissueAreOthers) {
  const std::string file = (folder.path() / "holes.mcap").string();
  const Session session =
      shipped({"faults.force_command.delay_ms=0.3",
               "faults.device.skip={from_s: 0.0201 until_s: 0.029 every_s: 0.05}"});
  const RunStatistics statistics =
      run_loopback(session,
                   {.seconds = 1.5, .record = {.file = file}, .lockstep = {.has_ideal = true}})
          .statistics;
  RecordingFile recording(file);
  const auto again = [&](const std::vector<std::string>& overrides) {
    return recompute(recording, recorded_session(recording, overrides));
  };

  const Recomputed same = again({});
  EXPECT_EQ(same.not_moved, "");
  EXPECT_EQ(same.largest_position_difference_m, 0.0);
  EXPECT_EQ(same.largest_energy_difference_joule, 0.0);
  EXPECT_GT(same.to_ideal.integrals().judged_s, 0.5);
  EXPECT_DOUBLE_EQ(same.to_ideal.transparency(), statistics.ideal_transparency());
  EXPECT_DOUBLE_EQ(same.to_ideal.gain(), statistics.gain());
  EXPECT_DOUBLE_EQ(same.transparency.recomputed, statistics.vector_transparency());
  EXPECT_LE(same.largest_ledger_excess_joule, 1e-9);
  EXPECT_TRUE(same.is_same());

  const Recomputed tissue = again({"scene.tissue[0].kelvin_voigt.stiffness_newton_per_m=251"});
  EXPECT_EQ(tissue.largest_energy_difference_joule, 0.0);
  EXPECT_FALSE(tissue.is_same());
  const Recomputed hand = again({"hand.stiffness_newton_per_m=151"});
  EXPECT_GT(hand.largest_position_difference_m, 0.0);
  EXPECT_GT(hand.largest_energy_difference_joule, 0.0);
  EXPECT_FALSE(hand.is_same());
  // the device has less friction than the controller counts on
  const Recomputed friction = again({"device.profile.coulomb_newton=0.02"});
  EXPECT_GT(friction.largest_ledger_excess_joule, 1e-6);
  EXPECT_FALSE(friction.is_same());
}

TEST_F(Recordings, InfoSaysWhoRanAndHowMuchIsThere) {
  RecordingFile recording(record("run.mcap", shipped(), 1.0));
  const auto info = info_json(recording);
  EXPECT_TRUE(info["is_whole"]);
  EXPECT_EQ(info["controller"], "mofc guard");
  EXPECT_EQ(info["recorded_by"], "palpate loopback");
  for (const char* node : {"device_node", "mofc_node", "physics_node"}) {
    EXPECT_EQ(info["nodes"][node], version()) << node;
  }
  EXPECT_EQ(info["ticks"]["device"], 1000);
  EXPECT_EQ(info["ticks"]["mofc"], 1000);
  EXPECT_EQ(info["messages"]["/scene_state"], 1);
  EXPECT_THAT(info["session"].get<std::string>(), HasSubstr("kelvin_voigt"));
  EXPECT_THAT(info_text(recording),
              HasSubstr("1000 ticks in 51 messages"));  // 20 ms each, the rest
}

// Chunks of 0.5 s: of a file cut off in its fifth second, 4 s at least are there.
TEST_F(Recordings, ACutOffRecordingIsReadUpToItsLastChunk) {
  const std::string file = record("run.mcap", shipped(), 5.0);
  const std::string whole = bytes_of(file);
  std::ofstream(file, std::ios::binary | std::ios::trunc) << whole.substr(0, whole.size() * 9 / 10);

  RecordingFile recording(file);
  std::uint64_t rows = 0;
  for_each_row(recording, [&](const TickRow& row) {
    EXPECT_EQ(row.device.sequence, rows);
    ++rows;
  });
  EXPECT_GE(rows, 4000u);
  EXPECT_LT(rows, 5000u);
  EXPECT_FALSE(info_json(recording)["is_whole"]);
}

TEST_F(Recordings, AHandWithoutStiffnessCannotRepeatAMotion) {
  Session session = shipped();
  RecordingFile recording(record("run.mcap", session, 0.1));
  session.side().hand.stiffness_newton_per_m = 0.0;
  try {
    static_cast<void>(hand_path_of(recording, session.side().hand));
    FAIL() << "divided by zero";
  } catch (const SetupError& error) {
    EXPECT_THAT(error.what(), HasSubstr("hand.stiffness_newton_per_m is 0"));
    EXPECT_THAT(error.what(), HasSubstr("stiffness > 0"));
    EXPECT_THAT(error.what(), HasSubstr("hand.stiffness_newton_per_m=150"));
  }
}

// A hand of 150 N/m that means to be 10 mm deep in tissue of 250 N/m rests about 4 mm deep. What it
// meant is found to within what the device's friction holds back: 0.3 N / 150 N/m = 2 mm.
TEST_F(Recordings, AHandThatIsPushedMeantToGoFurther) {
  const Session session = parse_session(R"(
      name: "pressing"
      hand { hold { position_m { z: -0.01 } } }
      device { monitor: off }
      mofc { controller: none }
      scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 250 } } })",
                                        "test.txtpb");
  RecordingFile recording(record("run.mcap", session, 3.0));
  double measured_z_m = 0.0;
  for_each_row(recording,
               [&](const TickRow& row) { measured_z_m = row.device.measured_hand_position_m.z(); });
  const RecordedPath path = hand_path_of(recording, session.side().hand);
  ASSERT_EQ(path.samples.size(), 300u);
  EXPECT_NEAR(path.samples[42].t_s, 0.4245, 1e-9);  // the mean of 420 … 429 ms
  EXPECT_GT(measured_z_m, -0.007);
  EXPECT_NEAR(path.samples.back().position_m.z(), -0.01, 2e-3);
}

// What the recorded hand did is done again, but for the friction of the device.
TEST_F(Recordings, TheSameSessionOnItsRecordedHandMovesTheSame) {
  const Session session = shipped();
  RecordingFile first(record("first.mcap", session, 5.0));
  std::vector<Vector3> moved;
  for_each_row(first,
               [&](const TickRow& row) { moved.push_back(row.device.true_tool_position_world_m); });
  Session again = session;
  again.side().hand.path = hand_path_of(first, session.side().hand);
  RecordingFile second(record("second.mcap", again, 5.0));
  double sum2_m2 = 0.0;
  for_each_row(second, [&](const TickRow& row) {
    sum2_m2 +=
        (row.device.true_tool_position_world_m - moved.at(row.device.sequence)).squaredNorm();
  });
  const double rms_m = std::sqrt(sum2_m2 / 5000.0);
  RecordProperty("rms_mm", std::to_string(1e3 * rms_m));
  EXPECT_LT(rms_m, 2e-3) << "of a motion of 30 mm";
}

TEST_F(Recordings, AnotherControllerIsTriedOnTheSameHand) {
  const std::vector<std::string> moves_at_once = {"hand.v.free_motion_s=0"};
  RecordingFile recording(record("run.mcap", shipped(moves_at_once, "paper_rigid"), 3.0));
  const auto run = [&](const std::string& controller) {
    Session session = shipped({"mofc.controller=" + controller}, "paper_rigid");
    session.side().hand.path = hand_path_of(recording, session.side().hand);
    return run_loopback(session, {.seconds = 3.0});
  };
  const RunReport with = run("mofc");
  const RunReport without = run("none");
  EXPECT_GT(with.statistics.contact_ticks(), 20u);
  EXPECT_GT(with.mofc.clamped_ticks, 0u);
  EXPECT_EQ(without.mofc.clamped_ticks, 0u);
  // the ideal run knows no controller: the hand is the same for both
  EXPECT_EQ(with.statistics.ideal_reversals(), without.statistics.ideal_reversals());
}

TEST_F(Recordings, TheReportStandsOnItsOwn) {
  Session session = shipped();
  session.text += "# a<b\n";
  std::vector<std::unique_ptr<RecordingFile>> recordings;
  recordings.push_back(std::make_unique<RecordingFile>(record("run.mcap", session, 2.0)));
  const std::string html = report_html(recordings);
  for (const char* part : {"Tool position", "before and after the clamp", "Energy", "Transparency",
                           "Latency", "2000 ticks", "mofc guard", "a&lt;b"}) {
    EXPECT_THAT(html, HasSubstr(part));
  }
  // nothing is fetched; no text of the session is read as HTML
  EXPECT_THAT(html, HasSubstr("content=\"default-src 'none'; style-src 'unsafe-inline'; "
                              "script-src 'unsafe-inline'\""));
  for (const char* part : {" src=", " href=", "url(", "@import", "a<b", "NaN,"}) {
    EXPECT_THAT(html, Not(HasSubstr(part)));
  }
}

TEST_F(Recordings, AFullDiskIsToldWithTheNameOfTheFile) {
  try {
    static_cast<void>(run_loopback(
        shipped(), {.seconds = 2.0, .record = {.file = "/dev/full", .may_overwrite = true}}));
    FAIL() << "nothing was said";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("/dev/full: No space left on device"));
  }
}

TEST_F(Recordings, ATableIsNoRecording) {
  EXPECT_THROW(RecordingFile(folder.write("run.csv", "t,x,y,z\n0,0,0,0\n")), SetupError);
}

}  // namespace
}  // namespace palpate
