// SPDX-License-Identifier: Apache-2.0
#include "deploy/lockstep/virtual_time.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace palpate {
namespace {

using namespace std::chrono_literals;

class VirtualTimeTest : public testing::Test {
 protected:
  VirtualTime::Action note(const std::string& what) {
    return [this, what] { said_.push_back(what); };
  }
  VirtualTime time_;
  std::vector<std::string> said_;
};

TEST_F(VirtualTimeTest, RunsEventsInOrderOfTimeThenRankThenScheduling) {
  time_.schedule(TimePoint{} + 2ms, 0, note("late"));
  time_.schedule(TimePoint{} + 1ms, 5, note("low rank"));
  time_.schedule(TimePoint{} + 1ms, 1, note("first"));
  time_.schedule(TimePoint{} + 1ms, 1, note("second"));

  time_.sleep_until(TimePoint{} + 3ms);

  EXPECT_EQ(said_, (std::vector<std::string>{"first", "second", "low rank", "late"}));
  EXPECT_EQ(time_.now(), TimePoint{} + 3ms);
}

TEST_F(VirtualTimeTest, RunsEventsDueAtTheDeadlineAndNothingLater) {
  time_.schedule(TimePoint{} + 1ms, 0, note("at"));
  time_.schedule(TimePoint{} + 1ms + 1ns, 0, note("after"));
  time_.sleep_until(TimePoint{} + 1ms);
  EXPECT_EQ(said_, std::vector<std::string>{"at"});
}

TEST_F(VirtualTimeTest, NowIsTheTimeOfTheRunningEvent) {
  TimePoint seen;
  time_.schedule(TimePoint{} + 7ms, 0, [&] { seen = time_.now(); });
  time_.sleep_until(TimePoint{} + 1s);
  EXPECT_EQ(seen, TimePoint{} + 7ms);
}

TEST_F(VirtualTimeTest, AnEventInThePastRunsNow) {
  time_.sleep_until(TimePoint{} + 5ms);
  TimePoint seen;
  time_.schedule(TimePoint{} + 1ms, 0, [&] { seen = time_.now(); });
  time_.sleep_until(TimePoint{} + 5ms);
  EXPECT_EQ(seen, TimePoint{} + 5ms);
}

TEST_F(VirtualTimeTest, OtherEventsRunWhileAnEventWaits) {
  time_.schedule(TimePoint{} + 1ms, 0, [&] {
    said_.push_back("begin");
    time_.sleep_until(TimePoint{} + 5ms);
    said_.push_back("end");
  });
  time_.schedule(TimePoint{} + 3ms, 0, note("meanwhile"));

  time_.sleep_until(TimePoint{} + 4ms);

  EXPECT_EQ(said_, (std::vector<std::string>{"begin", "meanwhile", "end"}));
  EXPECT_EQ(time_.now(), TimePoint{} + 5ms);  // the inner wait advanced the time
}

TEST_F(VirtualTimeTest, RunOneStopsAfterOneEventOrAtTheDeadline) {
  time_.schedule(TimePoint{} + 1ms, 0, note("one"));
  time_.schedule(TimePoint{} + 1ms, 0, note("two"));
  time_.run_one_until(TimePoint{} + 9ms);
  EXPECT_EQ(said_, std::vector<std::string>{"one"});
  EXPECT_EQ(time_.now(), TimePoint{} + 1ms);
  time_.run_one_until(TimePoint{} + 9ms);
  time_.run_one_until(TimePoint{} + 9ms);
  EXPECT_EQ(time_.now(), TimePoint{} + 9ms);
}

}  // namespace
}  // namespace palpate
