// SPDX-License-Identifier: Apache-2.0
// A task whose telemetry was partly lost: who sees the same has the same score, live, in a replay
// and from the recording, and all say how much is missing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "common/link/codec/viewer_codec.h"
#include "common/session/session_file.h"
#include "tests/support/network/unheard.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/viewer_node/batches.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/recording/recording.h"
#include "viewer_node/task/recorded_score.h"
#include "viewer_node/task/task_view.h"

namespace palpate::viewer {
namespace {

using testing::HasSubstr;

constexpr std::uint64_t kBatches = 150;
constexpr std::uint64_t kTicksPerBatch = 20;

/// What a viewer and its recorder receive of 3 s.
class LostTelemetry : public testing::Test {
 protected:
  /// @param is_lost  of a batch
  template <class Lost>
  void run(const Lost& is_lost) {
    live_mirror_.on_row = [this](const TickRow& row) { live_.take(row); };
    replay_mirror_.on_row = [this](const TickRow& row) { replay_.take(row); };
    RunState state;
    state.replay = ReplayState{.file = {}, .position_s = 0.0, .length_s = 3.0};
    replay_.take(state);
    Recording recording({.file = path_}, session_, "test", unheard_.subscriber);
    for (std::uint64_t i = 0; i < kBatches; ++i) {
      const std::uint64_t first = i * kTicksPerBatch;
      const std::uint64_t last = first + kTicksPerBatch - 1;
      if (!is_lost(i)) receive(recording, device_batch(i, first, last));
      receive(recording, mofc_batch(i, first, last));
    }
    recording.close();
    live_mirror_.flush_rows();
    replay_mirror_.flush_rows();
    // both end as the run does
    RunState stop;
    stop.markers.push_back({.at_ns = 1,
                            .kind = Marker::Kind::kTaskStop,
                            .device_session_id = kDeviceSession,
                            .device_sequence = kBatches * kTicksPerBatch - 2});
    live_.take(stop);
    stop.replay = state.replay;
    replay_.take(stop);
  }
  [[nodiscard]] TaskScore recorded() const {
    RecordingFile file(path_);
    file.choose_side("");
    return score_of(file);
  }

  Session session_ = parse_session(R"(
    name: "x"
    scene { tool { tip_radius_m: 0.006 }
            tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 400 } } }
    task { free {} most_force_newton: 0.5 })",
                                   "x.txtpb", {}, "/tmp");
  TaskView live_{session_};
  TaskView replay_{session_};

 private:
  template <class Batch>
  void receive(Recording& recording, const Batch& batch) {
    Codec<Batch> codec;
    const std::string payload = payload_of(codec, batch);
    recording.take(TelemetryMessage(batch), std::as_bytes(std::span(payload)));
    live_mirror_.take(batch, batch.header.sampled_at);
    replay_mirror_.take(batch, batch.header.sampled_at);
  }

  test::TempFolder folder_;
  std::string path_ = (folder_.path() / "run.mcap").string();
  test::Unheard unheard_;
  TelemetryMirror live_mirror_;
  TelemetryMirror replay_mirror_;
};

// 1 N, 0.5 N beyond the limit, in all ticks that were received.
TEST_F(LostTelemetry, HasOneScoreThatSaysHowMuchIsMissing) {
  run([](std::uint64_t batch) { return batch % 10 == 3; });
  const TaskScore recorded_score = recorded();
  // the last tick is that after the stop
  EXPECT_EQ(recorded_score.missing_ticks, 15 * kTicksPerBatch);
  EXPECT_EQ(recorded_score.ticks + recorded_score.missing_ticks, kBatches * kTicksPerBatch);
  for (const TaskView* view : {&live_, &replay_}) {
    ASSERT_TRUE(view->has_ended());
    EXPECT_EQ(view->score().missing_ticks, recorded_score.missing_ticks);
    EXPECT_EQ(view->score().ticks + 1, recorded_score.ticks);
    EXPECT_EQ(view->score().force.median_newton, recorded_score.force.median_newton);
    EXPECT_NEAR(view->score().beyond_s, 2.7, 0.01);
    EXPECT_THAT(view->state().findings.front(),
                HasSubstr("10.0 % of the measurements are missing"));
  }
  EXPECT_EQ(score_json(live_.score()), score_json(replay_.score()));
  EXPECT_THAT(findings_of(recorded_score).front(),
              HasSubstr("10.0 % of the measurements are missing"));
}

TEST_F(LostTelemetry, WithoutALossNothingIsSaidToBeMissing) {
  run([](std::uint64_t) { return false; });
  EXPECT_EQ(recorded().missing_ticks, 0U);
  EXPECT_EQ(live_.score().missing_ticks, 0U);
  EXPECT_EQ(score_json(live_.score()), score_json(replay_.score()));
  EXPECT_THAT(live_.state().findings.front(), testing::Not(HasSubstr("missing")));
}

}  // namespace
}  // namespace palpate::viewer
