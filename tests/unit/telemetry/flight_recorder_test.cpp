// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/flight_recorder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <sys/stat.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::SizeIs;

class FlightRecorderTest : public testing::Test {
 protected:
  FlightFiles files() {
    return {.folder = folder_.path() / "made",
            .node = "device",
            .session = "a-session",
            .requests = requests_,
            .log = log_};
  }
  std::vector<fs::path> written() const {
    std::vector<fs::path> paths;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder_.path() / "made", none)) {
      paths.push_back(entry.path());
    }
    return paths;
  }
  static std::vector<std::string> lines_of(const fs::path& file) {
    std::vector<std::string> lines;
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
  }

  test::TempFolder folder_;
  SignalRequests requests_;
  std::ostringstream text_;
  spdlog::logger log_{"device", std::make_shared<spdlog::sinks::ostream_sink_mt>(text_)};
};

TEST_F(FlightRecorderTest, ASignalWritesTheLastTicksOldestFirstAndTheLogNamesTheFile) {
  FlightRecorder<DeviceTick> recorder(files(), 4);
  for (std::uint64_t i = 0; i < 10; ++i) recorder.keep({.sequence = i});
  ++requests_.recordings;

  recorder.write_if_due(DeviceCounters{});

  ASSERT_THAT(written(), SizeIs(1));
  const std::vector<std::string> lines = lines_of(written()[0]);
  ASSERT_THAT(lines, SizeIs(5));
  for (std::size_t i = 1; i < 5; ++i) {
    EXPECT_EQ(lines[i].substr(0, 2), std::to_string(i + 5) + ",");
  }
  EXPECT_THAT(written()[0].filename().string(),
              testing::MatchesRegex("flight-device-a-session-[0-9]+T[0-9]+[.][0-9]+Z[.]csv"));
  EXPECT_THAT(text_.str(), HasSubstr("event=flight_recording reason=signal ticks=4 file=" +
                                     written()[0].string()));
  struct stat status {};
  ASSERT_EQ(stat(written()[0].c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
}

TEST_F(FlightRecorderTest, ANewFaultWritesOnceAndNothingElseWrites) {
  FlightRecorder<DeviceTick> recorder(files());
  DeviceCounters counters;
  recorder.keep({.sequence = 3, .guard = GuardState::kFault});
  recorder.write_if_due(counters);
  EXPECT_THAT(written(), SizeIs(0));

  counters.device_faults = 1;
  recorder.write_if_due(counters);
  recorder.write_if_due(counters);

  EXPECT_THAT(written(), SizeIs(1));
  EXPECT_THAT(text_.str(), HasSubstr("reason=fault ticks=1"));
  EXPECT_THAT(lines_of(written()[0]).at(1), HasSubstr(",fault,0,0,0,nan,"));
}

TEST_F(FlightRecorderTest, IncidentsWriteOneFileForEachWindowAndAddTheirLines) {
  FlightRecorder<DeviceTick> recorder(files(), 4);
  recorder.append = [](std::ostream& out) { out << "#device a device\n"; };
  DeviceCounters counters;
  const auto reduce = [&](std::uint64_t ticks) {
    for (std::uint64_t i = 0; i < ticks; ++i) recorder.keep({.sequence = i});
    ++counters.monitor_reductions;
    recorder.write_if_due(counters);
  };

  reduce(2);
  reduce(2);  // the same window
  EXPECT_THAT(written(), SizeIs(1));
  EXPECT_EQ(lines_of(written()[0]).back(), "#device a device");
  EXPECT_THAT(text_.str(), HasSubstr("reason=monitor"));
  recorder.write_if_due(counters);
  EXPECT_THAT(written(), SizeIs(1));
}

TEST_F(FlightRecorderTest, EveryRowHasTheColumnsOfItsHeader) {
  const auto expect_same = [](const auto& record) {
    std::ostringstream header;
    std::ostringstream row;
    write_flight_header(header, record);
    write_flight_row(row, record);
    const auto commas = [](const std::string& text) {
      return std::count(text.begin(), text.end(), ',');
    };
    EXPECT_GT(commas(header.str()), 9);
    EXPECT_EQ(commas(row.str()), commas(header.str())) << header.str();
  };
  expect_same(DeviceTick{});
  expect_same(MofcTick{});
  expect_same(PhysicsTick{});
}

TEST_F(FlightRecorderTest, AFolderThatCannotBeWrittenIsAnErrorInTheLogAndNoMore) {
  FlightFiles nowhere{.folder = "/proc/none/none",
                      .node = "device",
                      .session = "a",
                      .requests = requests_,
                      .log = log_};
  FlightRecorder<DeviceTick> recorder(nowhere);
  ++requests_.recordings;

  recorder.write_if_due(DeviceCounters{});

  EXPECT_THAT(text_.str(), HasSubstr("event=flight_recording_failed file=/proc/none/none/flight-"));
}

}  // namespace
}  // namespace palpate
