// SPDX-License-Identifier: Apache-2.0
// The log of the viewer: what a page gets that connects late, and the episodes of the clamp.
#include "viewer_node/live/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

#include "tests/support/program.h"
#include "tests/support/web_client.h"
#include "viewer_node/live/channels.h"

namespace palpate::viewer {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;

ServerDescription description_of(const Session& session) {
  ServerDescription description;
  description.name = "v";
  description.session_id = "s";
  description.channels = web_channels(session);
  return description;
}

class WebLogTest : public testing::Test {
 protected:
  WebLogTest() : server_({.port = 0}, description_of(session_)), log_(session_, server_) {}

  /// `count` lines that a page receives which subscribes only now.
  std::vector<std::string> history(std::size_t count) {
    test::WebClient page(server_.port());
    EXPECT_TRUE(page.open_web_socket());
    const int channel = static_cast<int>(index_of(WebChannel::kLog)) + 1;
    page.send_text(R"({"op":"subscribe","subscriptions":[{"id":1,"channelId":)" +
                   std::to_string(channel) + "}]}");
    std::uint64_t client = 0;
    EXPECT_TRUE(test::await([&] {
      for (const auto& event : server_.take_events()) {
        if (event.kind == WebServer::Event::Kind::kSubscribed) client = event.client;
      }
      return client != 0;
    }));
    log_.send_history_to(client);
    std::vector<std::string> lines;
    for (std::size_t i = 0; i < count; ++i) {
      const auto line = page.await_data(1);
      EXPECT_TRUE(line.has_value());
      lines.push_back(line.value_or(""));
    }
    return lines;
  }
  void clamp(std::uint64_t sequence, std::uint64_t ticks, TimePoint now,
             std::uint64_t session_id = 5) {
    MofcBatch batch;
    batch.header = {.session_id = session_id, .sequence = sequence};
    batch.counters.clamped_ticks = ticks;
    log_.note(0, batch, now);
    log_.pump(now);
  }

  Session session_;
  WebServer server_;
  WebLog log_;
};

TEST_F(WebLogTest, ALatePageGetsTheNewestLinesInTheirOrder) {
  for (std::size_t i = 0; i < WebLog::kMostKept + 3; ++i) {
    log_.write(LogLevel::kInfo, "run", "event=marker text=\"" + std::to_string(i) + "\"");
  }
  const std::vector<std::string> lines = history(WebLog::kMostKept);
  EXPECT_THAT(lines.front(), HasSubstr("text=\"3\""));
  EXPECT_THAT(lines.back(), HasSubstr("text=\"514\""));
}

// Twice within a second is one episode; what was clamped before this viewer is none.
TEST_F(WebLogTest, TheClampHasEpisodes) {
  clamp(10, 700, TimePoint(1000ms));
  clamp(11, 720, TimePoint(1020ms));
  clamp(12, 720, TimePoint(1040ms));
  clamp(13, 725, TimePoint(1900ms));
  clamp(14, 725, TimePoint(2880ms));
  clamp(15, 725, TimePoint(2920ms));
  clamp(0, 0, TimePoint(3000ms), 6);  // restarted
  clamp(1, 4, TimePoint(3020ms), 6);
  EXPECT_THAT(history(3), ElementsAre(HasSubstr("event=clamped_began"),
                                      HasSubstr("event=clamped_ended ticks=25"),
                                      HasSubstr("event=clamped_began")));
}

}  // namespace
}  // namespace palpate::viewer
