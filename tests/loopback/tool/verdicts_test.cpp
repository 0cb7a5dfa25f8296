// SPDX-License-Identifier: Apache-2.0
// The matrix of verdicts: each trouble as loopback, launch, a recording, its report and the page
// tell it, by the code that each of them runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/core/clock.h"
#include "common/link/codec/viewer_codec.h"
#include "common/telemetry/verdict/verdict.h"
#include "deploy/palpate/launch/launch_figures.h"
#include "deploy/palpate/recordings/recording_info.h"
#include "tests/support/network/unheard.h"
#include "tests/support/temp_folder.h"
#include "tests/support/web_client.h"
#include "tests/unit/telemetry/verdict_cases.h"
#include "tests/unit/viewer_node/batches.h"
#include "viewer_node/live/channels.h"
#include "viewer_node/live/health.h"
#include "viewer_node/recording/recording.h"
#include "viewer_node/recording/recording_copy.h"
#include "viewer_node/recording/report.h"

namespace palpate {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using namespace viewer;  // batches, recording, page

constexpr std::uint64_t kTicks = 10'000;
constexpr std::uint64_t kTicksPerBatch = 100;

/// All telemetry of the run. Nodes that were restarted spoke before the others' first batch.
std::vector<TelemetryMessage> telemetry_of(const TroubledRun& run) {
  std::vector<TelemetryMessage> messages;
  if (run.is_device_restarted) messages.emplace_back(device_batch(0, 0, 9, kDeviceSession - 1));
  if (run.is_mofc_restarted) {
    messages.emplace_back(mofc_batch(0, 0, 9, kDeviceSession, kMofcSession - 1));
  }
  if (run.is_physics_restarted) messages.emplace_back(physics_batch(0, 0, 9, kPhysicsSession - 1));
  for (std::uint64_t first = 0; first < kTicks; first += kTicksPerBatch) {
    const std::uint64_t batch = first / kTicksPerBatch;
    const std::uint64_t last = first + kTicksPerBatch - 1;
    const bool is_last = last + 1 == kTicks;
    DeviceBatch device = device_batch(batch, first, last);
    if (is_last) device.counters = run.device;
    messages.emplace_back(std::move(device));
    if (run.is_mofc_heard && (batch == 0 || is_last)) {
      MofcBatch mofc = mofc_batch(batch, first, last);
      if (is_last) mofc.counters = run.mofc;
      messages.emplace_back(std::move(mofc));
    }
  }
  if (run.is_physics_heard) {
    PhysicsBatch physics = physics_batch(0, 0, 1);
    physics.counters = run.physics;
    physics.records.front().stepped_at = {};
    for (PhysicsTick& tick : physics.records) tick.compute_time = std::chrono::milliseconds(1);
    physics.records.back().sequence = run.physics_steps;
    physics.records.back().stepped_at = TimePoint(std::chrono::seconds(10));
    messages.emplace_back(std::move(physics));
  }
  return messages;
}

TimePoint received_at() { return time_of_tick(kTicks); }

/// What `palpate loopback --json` writes.
json by_loopback(const TroubledRun& run) {
  RunReport report = report_of(run);
  TickRow row;
  row.device = device_batch(0, 0, 0).records.front();
  row.device.force_on_hand_newton = {0, 0, run.device.max_force_newton};
  row.device.minimum_true_energy_joule = run.device.minimum_true_energy_joule;
  report.statistics.add(row, {});
  return json::parse(summary_json(run.session, report).dump())["verdict"];
}

/// What `palpate launch --json` writes.
json by_launch(const TroubledRun& run, const std::vector<TelemetryMessage>& messages) {
  TelemetryMirror mirror;
  RunFigures figures;
  mirror.on_row = [&](const TickRow& row) { figures.add(row); };
  for (const TelemetryMessage& message : messages) {
    std::visit(
        [&](const auto& batch) {
          if constexpr (requires { batch.counters; }) {
            mirror.take(batch, received_at());
            figures.add(batch);
          }
        },
        message);
  }
  mirror.flush_rows();
  const std::vector<ObservedDevice> devices{{run.session.side(), mirror, figures}};
  LaunchResult result;
  result.wall = std::chrono::seconds(10);
  return json::parse(launch_json(run.session, devices, result).dump())["verdict"];
}

/// What a page asks for at /verdict.
json by_page(const TroubledRun& run, const std::vector<TelemetryMessage>& messages) {
  const test::Unheard unheard;
  WebServer server(
      {.port = 0},
      {.name = {}, .session_id = {}, .session_name = {}, .channels = web_channels(run.session)});
  WebLog log(run.session, server);
  std::vector<TelemetryMirror> mirrors(1);
  WebHealth health(run.session, mirrors, unheard.subscriber, server, log);
  for (const TelemetryMessage& message : messages) {
    std::visit(
        [&](const auto& batch) {
          if constexpr (requires { batch.counters; }) {
            mirrors.front().take(batch, received_at());
            health.note(0, batch);
          }
        },
        message);
  }
  health.pump(received_at(), [] { return ViewerHealth{}; });
  test::WebClient client(server.port());
  client.send_raw("GET /verdict HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  const std::string answer = client.read_to_end();
  const std::size_t body = answer.find("\r\n\r\n");
  if (body == std::string::npos) return {};
  return json::parse(answer.substr(body + 4))["sides"][""];
}

/// Of a recording of the run: what `palpate info --json` and `palpate report` write.
struct Recorded {
  json verdict;
  std::string report;
};
void record(const TroubledRun& run, const std::vector<TelemetryMessage>& messages,
            const std::string& file) {
  test::Unheard unheard;
  viewer::Recording recording({.file = file}, run.session, "palpate launch", unheard.subscriber);
  for (const TelemetryMessage& message : messages) {
    std::visit(
        [&](const auto& batch) {
          if constexpr (requires { batch.counters; }) {
            Codec<std::decay_t<decltype(batch)>> codec;
            const std::string payload = payload_of(codec, batch);
            recording.take(message, std::as_bytes(std::span(payload)));
          }
        },
        message);
  }
  recording.close();
}
Recorded by_recording(const TroubledRun& run, const std::vector<TelemetryMessage>& messages) {
  const test::TempFolder folder;
  const std::string file = (folder.path() / "run.mcap").string();
  record(run, messages, file);
  std::vector<std::unique_ptr<RecordingFile>> files;
  files.push_back(std::make_unique<RecordingFile>(file));
  json verdict = json::parse(info_json(*files.front()).dump())["figures"]["verdict"];
  return {std::move(verdict), report_html(files)};
}

/// The rows of the report's table that are as bad as the run.
std::string escaped(const std::string& text) {
  std::string html;
  for (const char c : text) {
    html += c == '&'   ? "&amp;"
            : c == '<' ? "&lt;"
            : c == '>' ? "&gt;"
            : c == '"' ? "&quot;"
                       : std::string(1, c);
  }
  return html;
}

void expect(const VerdictCase& one, const json& verdict) {
  ASSERT_TRUE(verdict.is_object()) << verdict;
  EXPECT_EQ(verdict["cause"], one.cause) << verdict.dump(1);
  EXPECT_EQ(verdict["grade"], one.grade) << verdict.dump(1);
  EXPECT_THAT(verdict.dump(), HasSubstr(json(one.remedy).dump().substr(1, one.remedy.size())));
}

TEST(VerdictMatrix, EveryTroubleHasTheSameCauseWhereverItIsTold) {
  std::size_t causes = 0;
  for (const VerdictCase& one : verdict_cases()) {
    SCOPED_TRACE(one.name);
    const TroubledRun run = run_of(one);
    if (one.is_of_lockstep) {
      SCOPED_TRACE("loopback");
      expect(one, by_loopback(run));
    }
    if (one.is_of_real_time) {
      const std::vector<TelemetryMessage> messages = telemetry_of(run);
      {
        SCOPED_TRACE("launch");
        expect(one, by_launch(run, messages));
      }
      {
        SCOPED_TRACE("page");
        expect(one, by_page(run, messages));
      }
      SCOPED_TRACE("recording and report");
      const Recorded recorded = by_recording(run, messages);
      expect(one, recorded.verdict);
      for (const json& finding : recorded.verdict["findings"]) {
        EXPECT_THAT(recorded.report, HasSubstr(escaped(finding["text"].get<std::string>())));
        EXPECT_THAT(recorded.report, HasSubstr(escaped(finding["remedy"].get<std::string>())));
      }
    }
    if (one.is_of_lockstep && one.is_of_real_time && !one.cause.empty()) ++causes;
  }
  EXPECT_GE(causes, 20u) << "in all of them";
}

/// Restarts of the three nodes that the verdict on a recording counts.
std::vector<std::uint64_t> restarts_in(const std::string& file) {
  RecordingFile recording(file);
  RecordedRun run;
  read_run(recording, run);
  const RunFacts facts = facts_of(recording, run);
  return {facts.device_node.restarts, facts.mofc_node.restarts, facts.physics_node.restarts};
}

// a copy of a run is the same run, another one that was appended is not
TEST(VerdictOfCopies, CountTheRestartsOfTheRun) {
  const test::TempFolder folder;
  const auto path = [&](const char* name) { return (folder.path() / name).string(); };
  VerdictCase one;
  one.trouble = [](TroubledRun& run) {
    run.is_device_restarted = run.is_mofc_restarted = run.is_physics_restarted = true;
  };
  const TroubledRun run = run_of(one);
  record(run, telemetry_of(run), path("run.mcap"));
  const auto copy = [&](const std::vector<std::string>& inputs, const CopyOptions& options) {
    std::vector<std::unique_ptr<McapReader>> sources;
    sources.reserve(inputs.size());
    for (const std::string& input : inputs) {
      sources.push_back(std::make_unique<McapReader>(path(input.c_str())));
    }
    copy_recordings(sources, options);
  };
  const std::vector<std::uint64_t> once{1, 1, 1};
  ASSERT_EQ(restarts_in(path("run.mcap")), once);
  copy({"run.mcap"}, {.command = "cut", .file = path("cut.mcap")});
  copy({"run.mcap"}, {.command = "recover", .file = path("whole.mcap"), .is_recovery = true});
  copy({"cut.mcap", "whole.mcap"}, {.command = "merge", .file = path("both.mcap")});
  for (const char* file : {"cut.mcap", "whole.mcap", "both.mcap"}) {
    EXPECT_EQ(restarts_in(path(file)), once) << file;
    EXPECT_THAT(seams_of(McapReader(path(file))), testing::IsEmpty()) << file;
  }

  TroubledRun other = run;
  other.is_device_restarted = other.is_mofc_restarted = other.is_physics_restarted = false;
  std::vector<TelemetryMessage> messages = telemetry_of(other);
  for (TelemetryMessage& message : messages) {
    std::visit([](auto& batch) { batch.header.session_id += 100; }, message);
    if (auto* mofc = std::get_if<MofcBatch>(&message)) {
      for (MofcTick& tick : mofc->records) tick.device_session_id += 100;
    }
  }
  record(other, messages, path("other.mcap"));
  copy({"run.mcap", "other.mcap"},
       {.command = "merge", .file = path("row.mcap"), .is_sequence = true});
  EXPECT_EQ(restarts_in(path("row.mcap")), once);
  ASSERT_EQ(seams_of(McapReader(path("row.mcap"))).size(), 1u);
  copy({"row.mcap"}, {.command = "recover", .file = path("row2.mcap"), .is_recovery = true});
  EXPECT_EQ(restarts_in(path("row2.mcap")), once) << "a copy keeps the seam";
}

}  // namespace
}  // namespace palpate
