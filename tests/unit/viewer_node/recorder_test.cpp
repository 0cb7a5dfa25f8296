// SPDX-License-Identifier: Apache-2.0
// What a recording keeps of the scene and of markers, whatever the disk and the wall clock do.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/link/codec/viewer_codec.h"
#include "tests/support/network/unheard.h"
#include "tests/support/temp_folder.h"
#include "viewer_node/recording/mcap_reader.h"
#include "viewer_node/recording/recording.h"

namespace palpate::viewer {
namespace {

using testing::ElementsAre;

class Recorder : public testing::Test {
 protected:
  void take(const TelemetryMessage& message, const std::string& payload = {}) {
    recording_.take(message, std::as_bytes(std::span(payload)));
  }
  /// The payloads of a topic in the closed recording.
  [[nodiscard]] std::vector<std::string> recorded(const std::string& topic) {
    recording_.close();
    McapReader reader(path_);
    std::vector<std::string> payloads;
    while (const auto message = reader.next()) {
      for (const McapReader::Topic& one : reader.topics()) {
        if (one.id == message->channel_id && one.topic == topic) {
          payloads.emplace_back(message->payload);
        }
      }
    }
    return payloads;
  }
  [[nodiscard]] std::vector<std::string> markers() {
    std::vector<std::string> texts;
    for (const std::string& payload : recorded("/markers")) {
      texts.push_back(decode_marker(payload).value().text);
    }
    return texts;
  }

  test::TempFolder folder_;
  std::string path_ = (folder_.path() / "run.mcap").string();
  test::Unheard unheard_;
  Recording recording_{{.file = path_}, Session(), "test", unheard_.subscriber};
};

// physics_node sends it again to every new viewer.
TEST_F(Recorder, ASceneThatFoundTheQueueFullIsKeptWhenItComesAgain) {
  SceneState scene;
  scene.header.session_id = 1;
  scene.revision = 1;
  take(scene, std::string((std::size_t{64} << 20) + 1, 'x'));  // more than may wait
  take(scene, "scene");
  take(scene, "scene");  // now it is known

  EXPECT_THAT(recorded("/scene_state"), ElementsAre("scene"));
}

TEST_F(Recorder, NoMarkerIsLostWhenTheWallClockStepsBack) {
  RunState run;
  run.header.session_id = 1;
  take(run);
  run.markers.push_back({.at_ns = 5, .text = "decades ago", .origin = "page"});
  take(run);
  run.markers.push_back({.at_ns = 6, .text = "just after", .origin = "page"});
  take(run);
  RunState next;
  next.header.session_id = 2;
  next.markers.push_back({.at_ns = 3, .text = "of another run", .origin = "page"});
  take(next);

  EXPECT_THAT(markers(), ElementsAre("decades ago", "just after", "of another run"));
}

TEST_F(Recorder, MarkersFromBeforeTheRecordingAreNotInIt) {
  RunState run;
  run.header.session_id = 1;
  run.markers.push_back({.at_ns = 5, .text = "before", .origin = "page"});
  take(run);
  run.markers.push_back({.at_ns = 6, .text = "during", .origin = "page"});
  take(run);

  EXPECT_THAT(markers(), ElementsAre("during"));
}

}  // namespace
}  // namespace palpate::viewer
