// SPDX-License-Identifier: Apache-2.0
#include "common/process/log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>

#include <sstream>

namespace palpate {
namespace {

using testing::MatchesRegex;

TEST(Log, WritesTheQueuedLinesBeforeItEnds) {
  std::ostringstream text;

  {
    Log log("device", std::make_shared<spdlog::sinks::ostream_sink_mt>(text));
    log.logger().info("event=start session={}", "default");
  }

  EXPECT_THAT(text.str(),
              MatchesRegex("[0-9-]+T[0-9:.]+ info device event=start session=default\n"));
}

}  // namespace
}  // namespace palpate
