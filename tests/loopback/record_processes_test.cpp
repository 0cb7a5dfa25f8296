// SPDX-License-Identifier: Apache-2.0
// Recording and replaying with the real programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "common/link/telemetry_subscriber.h"
#include "common/link/zmq_sender.h"
#include "common/process/run_host.h"
#include "common/session/session_file.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"
#include "tests/support/web_client.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using test::Program;
using test::run_program;
using test::text_of;
using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kSession = R"(
name: "recorded"
realtime { priority: 0 cpu: -1 }
device { monitor: off }
hand { hold { position_m { z: -0.005 } } }
mofc { controller: none stale_after_ms: 200 }
scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } }
viewer { web { disabled: true } }
)";

class RecordProcesses : public testing::Test {
 protected:
  RecordProcesses() { session_ = files_.write("recorded.txtpb", kSession); }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (files_.path() / name).string();
  }
  /// @return the exit status
  [[nodiscard]] int record(const std::string& file, const std::string& seconds,
                           const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"loopback",   session_,   "--seconds", seconds,
                                          "--no-ideal", "--record", file};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program("palpate", arguments).status;
  }
  [[nodiscard]] static nlohmann::json info(const std::string& file) {
    return nlohmann::json::parse(run_program("palpate", {"info", file, "--json"}).out);
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string session_;
};

TEST_F(RecordProcesses, LaunchRecordsWhatItsTableSays) {
  Program launch("palpate", {"launch", session_, "--no-realtime", "--record", path("run.mcap"),
                             "--csv", path("run.csv"), "--json", path("run.json")});
  ProcessLinks links({.priority = 0, .cpu = -1});
  test::Watcher watcher(load_session(session_), links);
  ASSERT_TRUE(watcher.until([&] {
    const PhysicsCounters& physics = watcher.mirror().physics_counters();
    // more than the 500 ticks of below: launch may begin to hear them later
    return physics.loop.ticks > 1500 && physics.mesh_frames > 0 &&
           watcher.mirror().device_counters().answered_ticks > 0;
  })) << launch.err();
  launch.send_signal(SIGTERM);
  ASSERT_EQ(launch.wait(), 0) << launch.err();
  EXPECT_GT(nlohmann::json::parse(text_of(path("run.json")))["mesh_frames"], 0);  // a dent
  ASSERT_EQ(
      run_program("palpate", {"export", path("run.mcap"), "--csv", path("exported.csv")}).status,
      0);
  EXPECT_EQ(text_of(path("exported.csv")), text_of(path("run.csv")));

  const nlohmann::json told = info(path("run.mcap"));
  EXPECT_TRUE(told["is_whole"]);
  EXPECT_EQ(told["loss"]["messages_dropped"], "0");
  EXPECT_EQ(told["nodes"]["device_node_sessions"], "1");
  EXPECT_GT(told["ticks"]["physics"], 500);

  // one run has one set of figures
  nlohmann::json run_figures = nlohmann::json::parse(text_of(path("run.json")));
  for (const auto& [key, value] : told["figures"].items())
    EXPECT_EQ(run_figures[key], value) << key;
  ASSERT_EQ(run_program("palpate", {"report", path("run.mcap"), "-o", path("run.html")}).status, 0);
  const std::string report = text_of(path("run.html"));
  std::istringstream summary(launch.out());
  int lines = 0;
  for (std::string line; std::getline(summary, line);) {
    if (!line.starts_with("  transparency ") && !line.starts_with("  largest force ") &&
        !line.starts_with("  answered in time ") && !line.starts_with("  reply time ")) {
      continue;
    }
    ++lines;
    const std::string value = line.substr(line.find_first_not_of(' ', 21));
    EXPECT_THAT(report, HasSubstr("<td>" + value + "</td>"));
    EXPECT_THAT(run_program("palpate", {"info", path("run.mcap")}).out, HasSubstr(value));
  }
  EXPECT_EQ(lines, 4) << launch.out();
}

TEST_F(RecordProcesses, AKilledRecorderLosesNoMoreThanItsLastHalfSecond) {
  const test::QuietMachine machine;
  Program nodes("palpate", {"launch", session_, "--no-realtime", "--no-viewer"});
  Program recorder("viewer_node", {"--session", session_, "--quiet", "--record", path("run.mcap")});
  ProcessLinks links({.priority = 0, .cpu = -1});
  test::Watcher watcher(load_session(session_), links);
  // the recorder may begin to hear the nodes later
  ASSERT_TRUE(watcher.until([&] {
    std::error_code error;
    const std::uintmax_t bytes = std::filesystem::file_size(path("run.mcap"), error);
    return !error && bytes > 100'000;
  })) << recorder.err();
  ASSERT_TRUE(watcher.until_rows(3000)) << nodes.err();
  recorder.send_signal(SIGKILL);
  EXPECT_EQ(recorder.wait(), 128 + SIGKILL);
  const std::uint64_t newest = watcher.rows().back().device.sequence;
  nodes.send_signal(SIGTERM);
  EXPECT_EQ(nodes.wait(), 0) << nodes.err();

  const nlohmann::json told = info(path("run.mcap"));
  EXPECT_FALSE(told["is_whole"]);
  EXPECT_EQ(told["messages"]["/scene_state"], 1);
  const auto exported =
      run_program("palpate", {"export", path("run.mcap"), "--csv", path("run.csv")});
  EXPECT_EQ(exported.status, 1);
  EXPECT_THAT(exported.err, HasSubstr("missing: its end: the file was not closed"));
  const std::string table = text_of(path("run.csv"));
  const auto rows = std::count(table.begin(), table.end(), '\n') - 1;
  EXPECT_GT(rows, 0) << newest;
  if (machine.may_check("no more than the last half second is lost")) {
    EXPECT_GE(rows, 3000 - 500) << newest;
  }
}

TEST_F(RecordProcesses, AFullDiskEndsTheRecordingAndNothingElse) {
  Program launch("palpate", {"launch", session_, "--no-realtime", "--no-viewer", "--record",
                             "/dev/full", "--overwrite", "--json", path("run.json")});
  ProcessLinks links({.priority = 0, .cpu = -1});
  test::Watcher watcher(load_session(session_), links);
  launch.await_err("recording /dev/full: No space left on device");
  EXPECT_TRUE(watcher.until_rows(1100)) << launch.err();
  launch.send_signal(SIGTERM);
  EXPECT_EQ(launch.wait(), 1) << launch.err();
  const nlohmann::json summary = nlohmann::json::parse(text_of(path("run.json")));
  EXPECT_GT(summary["ticks"], 1000);
  for (const auto& [node, count] : summary["restarts"].items()) EXPECT_EQ(count, 0) << node;
}

TEST_F(RecordProcesses, AReplayIsSeenAsItWasRecorded) {
  const test::QuietMachine machine;
  const std::string file = path("run.mcap");
  ASSERT_EQ(
      run_program("palpate", {"loopback", session_, "--seconds", "3", "--no-ideal", "--record",
                              file, "--csv", path("run.csv"), "--set",
                              "scene.tissue[0].motion={amplitude_m {z: 0.001} frequency_hz: 1}"})
          .status,
      0);

  Program replay("palpate", {"replay", file, "--speed", "2", "--start", "1"});
  ASSERT_TRUE(test::await([&] {
    return replay.out().find("waiting for a viewer: viewer_node --session " + session_) !=
           std::string::npos;
  })) << replay.out();
  Program late("viewer_node", {"--session", session_, "--quiet", "--record", path("seen.mcap")});
  EXPECT_EQ(replay.wait(), 0) << replay.err();
  EXPECT_THAT(replay.out(), HasSubstr("\nplaying\n"));
  late.send_signal(SIGTERM);
  ASSERT_EQ(late.wait(), 0) << late.err();

  ASSERT_EQ(run_program("palpate", {"export", path("seen.mcap"), "--csv", path("seen.csv")}).status,
            0);
  const std::string recorded = text_of(path("run.csv"));
  std::ifstream seen(path("seen.csv"));
  std::set<std::string> rows;
  std::string line;
  std::getline(seen, line);
  ASSERT_THAT(line, testing::StartsWith("t_s,x_m,y_m,z_m,xm_m,ym_m,zm_m,fe_x,"));
  const std::regex without_mofc("(?:[^,]*,){7}nan,.*");
  while (std::getline(seen, line)) {
    // a viewer that waits for a processor may lose a batch of one node and not of the other
    if (std::regex_match(line, without_mofc)) continue;
    EXPECT_THAT(recorded, HasSubstr("\n" + line + "\n"));
    rows.insert(line);
  }
  nlohmann::json messages = info(path("seen.mcap"))["messages"];
  EXPECT_GT(rows.size(), 0u);
  EXPECT_GE(messages["/scene_state"], 1);
  EXPECT_GE(messages["/mesh"], 1);
  // batches sent before all links stood are missed
  if (machine.may_check("95 % of a replay seen")) {
    EXPECT_GE(rows.size(), 1900u);     // of 2000
    EXPECT_GE(messages["/mesh"], 50);  // moving tissue: 30 a second
  }
}

// The page's own subscription begins it; there is no other viewer.
TEST_F(RecordProcesses, OfWhichNothingCanBeReadAreRefusedByReplay) {
  const std::string whole = path("whole.mcap");
  const std::string session = test::source_dir() + "/deploy/sessions/default.txtpb";
  ASSERT_EQ(
      run_program("palpate", {"loopback", session, "--seconds", "0.5", "--record", whole}).status,
      0);
  std::filesystem::resize_file(whole, std::filesystem::file_size(whole) / 2);  // in its one chunk

  const auto replay = run_program("palpate", {"replay", whole, "--no-viewer"});

  EXPECT_EQ(replay.status, 2);
  EXPECT_THAT(replay.err, AllOf(HasSubstr(whole + ": has nothing to replay; missing: "),
                                HasSubstr("unreadable bytes, its end")));
}

TEST_F(RecordProcesses, ThatAreDamagedAreSaidToBeByReplay) {
  const std::string file = path("run.mcap");
  ASSERT_EQ(record(file, "3"), 0);
  const auto replayed = [&] {
    return run_program("palpate", {"replay", file, "--no-viewer", "--speed", "100", "--wait", "0"});
  };
  EXPECT_EQ(replayed().err, "");
  std::string bytes = text_of(file);
  bytes[bytes.size() / 2] ^= 1;  // in a chunk, which is found when it is read
  std::ofstream(file, std::ios::binary) << bytes;
  const auto damaged = replayed();
  EXPECT_EQ(damaged.status, 1);
  EXPECT_THAT(damaged.err, HasSubstr("is damaged; missing: 1 damaged chunks; `palpate recover`"));

  std::ofstream(file, std::ios::binary) << bytes.substr(0, bytes.size() * 9 / 10);
  const auto cut = replayed();
  EXPECT_EQ(cut.status, 1);
  EXPECT_THAT(cut.err, HasSubstr("its end: the file was not closed"));
}

TEST_F(RecordProcesses, AReplayHasAPageOfItsOwn) {
  const std::string file = path("run.mcap");
  ASSERT_EQ(record(file, "1", {"--set", "viewer.web={port: 0}"}), 0);
  const Session session = load_session(session_);
  std::filesystem::rename(session_, path("elsewhere.txtpb"));  // the recording is enough
  Program replay("palpate", {"replay", file});
  const std::string address = "http://127.0.0.1:";
  ASSERT_TRUE(test::await([&] {
    return replay.out().find("waiting for the page to be opened") != std::string::npos;
  })) << replay.out()
      << replay.err();
  EXPECT_THAT(replay.out(), testing::StartsWith(address));
  EXPECT_THAT(replay.out(), testing::Not(HasSubstr("playing")));

  test::WebClient page(static_cast<std::uint16_t>(std::stoi(replay.out().substr(address.size()))));
  ASSERT_TRUE(page.open_web_socket());
  page.send_text(R"({"op":"subscribe","subscriptions":[{"id":2,"channelId":2},)"
                 R"({"id":3,"channelId":3}]})");
  EXPECT_TRUE(page.await_data(3)) << "ticks of the device";
  EXPECT_THAT(replay.out(), HasSubstr("\nplaying\n"));
  // at its end it stays, for the page may move it
  const SteadyClock clock;
  ProcessLinks links({.priority = 0, .cpu = -1});
  TelemetrySubscriber states(links.side, clock,
                             {run_state_of(session, Attachment::Role::kConnect)});
  ReplayState state;
  EXPECT_TRUE(test::await([&] {
    TelemetryMessage message;
    TimePoint received_at;
    while (states.receive(message, received_at)) {
      const auto* run = std::get_if<RunState>(&message);
      if (run != nullptr && run->replay) state = *run->replay;
    }
    return state.is_paused;
  })) << replay.err();
  EXPECT_EQ(state.position_s, state.length_s);
  replay.send_signal(SIGTERM);
  EXPECT_EQ(replay.wait(), 0) << replay.err();
  EXPECT_EQ(replay.err(), "");
}

TEST_F(RecordProcesses, AReplayWhosePageNobodyOpensEndsIfItDoesNotWait) {
  const std::string file = path("run.mcap");
  ASSERT_EQ(record(file, "1", {"--set", "viewer.web={port: 0}"}), 0);
  const auto alone = run_program("palpate", {"replay", file, "--speed", "20", "--wait", "0"});
  EXPECT_EQ(alone.status, 0) << alone.err;
  EXPECT_THAT(alone.out, HasSubstr("http://127.0.0.1:"));
  const auto quiet = run_program("palpate", {"-q", "replay", file, "--speed", "20", "--wait", "0"});
  EXPECT_EQ(quiet.status, 0) << quiet.err;
  EXPECT_EQ(quiet.out, "") << "no page, no words";
}

TEST_F(RecordProcesses, ALoopBeginsAnewWithNewNodes) {
  const std::string file = path("run.mcap");
  ASSERT_EQ(record(file, "1"), 0);
  ProcessLinks links({.priority = 0, .cpu = -1});
  test::Watcher watcher(load_session(session_), links);
  Program replay("palpate", {"replay", file, "--speed", "5", "--loop"});
  EXPECT_TRUE(watcher.until([&] { return watcher.mirror().device_link().sessions >= 3; }));
  replay.send_signal(SIGINT);
  EXPECT_EQ(replay.wait(), 0) << replay.err();
}

TEST_F(RecordProcesses, AReplayNeedsNoViewerIfItDoesNotWait) {
  const std::string file = path("run.mcap");
  ASSERT_EQ(record(file, "1"), 0);
  const auto alone = run_program("palpate", {"replay", file, "--speed", "20", "--wait", "0"});
  EXPECT_EQ(alone.status, 0) << alone.err;
  EXPECT_THAT(alone.out, testing::Not(HasSubstr("waiting")));

  const auto wrong = run_program("palpate", {"replay", file, "--wait", "-1"});
  EXPECT_EQ(wrong.status, 2);
}

TEST_F(RecordProcesses, AReplayObeysItsViewers) {
  const std::string file = path("run.mcap");
  ASSERT_EQ(record(file, "20"), 0);
  const Session session = load_session(session_);
  ProcessLinks links({.priority = 0, .cpu = -1});
  const SteadyClock clock;
  TelemetrySubscriber states(links.side, clock,
                             {run_state_of(session, Attachment::Role::kConnect)});
  ZmqSender<RunRequest> requests(links.side, run_requests_of(session, Attachment::Role::kConnect));
  test::Watcher watcher(session, links);
  watcher.subscriber().subscribe<SceneState>();
  Program replay("palpate", {"replay", file});

  ReplayState state;
  const auto until = [&](const std::function<bool()>& is_so) {
    return watcher.until([&] {
      TelemetryMessage message;
      TimePoint received_at;
      while (states.receive(message, received_at)) {
        const auto* run = std::get_if<RunState>(&message);
        if (run != nullptr && run->replay) state = *run->replay;
      }
      return is_so();
    });
  };
  const auto request = [&](std::optional<double> seek_s, std::optional<bool> is_paused,
                           std::optional<double> speed_ratio = {}) {
    RunRequest request;
    request.header.session_id = 1;
    request.seek_s = seek_s;
    request.is_paused = is_paused;
    request.speed_ratio = speed_ratio;
    ASSERT_TRUE(watcher.until([&] { return requests.send(request) == SendResult::kSent; }));
  };
  ASSERT_TRUE(until([&] { return state.position_s > 0.0; })) << replay.out() << replay.err();
  EXPECT_EQ(state.file, file);
  EXPECT_NEAR(state.length_s, 20.0, 0.1);
  EXPECT_FALSE(state.is_paused);

  request({}, true);
  ASSERT_TRUE(until([&] { return state.is_paused; }));
  request(15.0, {});
  ASSERT_TRUE(until([&] { return state.position_s == 15.0; })) << "it stands still there";
  std::size_t shown = watcher.rows().size();
  const auto shows = [&](std::uint64_t from, std::uint64_t to) {  // since `shown`
    return std::any_of(watcher.rows().begin() + static_cast<std::ptrdiff_t>(shown),
                       watcher.rows().end(), [&](const TickRow& row) {
                         return row.device.sequence >= from && row.device.sequence < to;
                       });
  };
  request({}, false, 2.0);
  ASSERT_TRUE(until([&] { return shows(15001, 20000) && state.speed_ratio == 2.0; }))
      << "ticks of the 16th second";

  shown = watcher.rows().size();
  request(1.0, {});
  ASSERT_TRUE(until([&] { return shows(0, 5000); }));
  request(19.5, {});
  ASSERT_TRUE(until([&] { return state.is_paused && state.position_s == state.length_s; }))
      << "it stays at its end";
  shown = watcher.rows().size();
  request({}, false);
  ASSERT_TRUE(until([&] { return !state.is_paused && shows(0, 10000); })) << "from its begin";
  replay.send_signal(SIGINT);
  EXPECT_EQ(replay.wait(), 0) << replay.err();
}

TEST_F(RecordProcesses, FilesAreNotWrittenOverEachOther) {
  const auto same = run_program("palpate", {"loopback", session_, "--seconds", "1", "--csv",
                                            path("out"), "--json", path("out")});
  EXPECT_EQ(same.status, 2);
  EXPECT_THAT(same.err, HasSubstr("--json and --csv: both name"));

  const std::vector<std::string> record = {"loopback", session_,   "--seconds",
                                           "1",        "--record", path("run.mcap")};
  EXPECT_EQ(run_program("palpate", record).status, 0);
  const auto again = run_program("palpate", record);
  EXPECT_EQ(again.status, 2);
  EXPECT_THAT(again.err, HasSubstr("exists; give another name, or --overwrite"));
}

TEST_F(RecordProcesses, PlotJugglersPortIsNotOpenToOthers) {
  const auto open =
      run_program("viewer_node", {"--session", session_, "--plotjuggler", "tcp://0.0.0.0:9872"});
  EXPECT_EQ(open.status, 2);
  EXPECT_THAT(open.err, HasSubstr("this port has no access control"));
}

}  // namespace
}  // namespace palpate
