// SPDX-License-Identifier: Apache-2.0
#include "common/process/realtime.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/version.h>
#include <sched.h>
#include <sys/syscall.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <thread>

namespace palpate {
namespace {

using testing::HasSubstr;

/// Runs `body` on a thread of its own, so that the scheduling of the test thread does not change.
template <class Body>
void on_a_thread(Body body) {
  std::thread(body).join();
}

TEST(Realtime, PriorityZeroAndNoProcessorLeaveTheThreadAsItIs) {
  on_a_thread([] {
    cpu_set_t before;
    ASSERT_EQ(sched_getaffinity(0, sizeof(before), &before), 0);

    const RealtimeReport report =
        enter_realtime({.priority = 0, .cpu = -1, .wait = WaitStrategy::kBlock});

    cpu_set_t after;
    ASSERT_EQ(sched_getaffinity(0, sizeof(after), &after), 0);
    EXPECT_TRUE(CPU_EQUAL(&before, &after));
    EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER);
    EXPECT_FALSE(report.has_fifo);
    EXPECT_FALSE(report.is_pinned);
    EXPECT_FALSE(report.has_locked_memory);
    EXPECT_EQ(report.text, "scheduling=ordinary cpu=any wait=block");
  });
}

TEST(Realtime, MoreTicksThanProcessorsAreAWarning) {
  EXPECT_EQ(too_many_ticks(1), "");
  EXPECT_THAT(too_many_ticks(CPU_SETSIZE + 1), HasSubstr("1025 sides on "));
}

TEST(Realtime, ThreadsThatNeverSleepNeedProcessorsOfTheirOwn) {
  const auto with = [](std::size_t sides, WaitStrategy wait, int priority, int cpu) {
    Side side;
    side.realtime = {.priority = priority, .cpu = cpu, .wait = wait};
    return spin_warning(std::vector<Side>(sides, side));
  };
  EXPECT_THAT(with(1, WaitStrategy::kSpin, 80, 0), HasSubstr("spin at priority 80"));
  EXPECT_THAT(with(usable_processors(), WaitStrategy::kSpin, 80, -1), HasSubstr("priority: 0"));
  EXPECT_EQ(with(usable_processors(), WaitStrategy::kSpin, 0, -1), "");
  EXPECT_EQ(with(usable_processors(), WaitStrategy::kHybrid, 80, 0), "");
}

TEST(Realtime, TakesFifoExactlyWhenPermittedAndReportsIt) {
  const bool may = may_use_fifo(10);
  on_a_thread([may] {
    const RealtimeReport report = enter_realtime({.priority = 10, .cpu = -1});

    EXPECT_EQ(report.has_fifo, may);
    EXPECT_EQ(sched_getscheduler(0) & ~SCHED_RESET_ON_FORK, may ? SCHED_FIFO : SCHED_OTHER);
    EXPECT_THAT(report.text, HasSubstr(may ? "scheduling=fifo priority=10" : "fifo_refused="));
  });
}

TEST(Realtime, ThreadsOfARealtimeThreadAreOrdinary) {
  on_a_thread([] {
    enter_realtime({.priority = 10, .cpu = -1});
    on_a_thread([] { EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER); });
  });
}

/// Linux 6.12 and later let an ordinary thread choose its time slice.
bool has_slices() {
  utsname kernel{};
  int major = 0;
  int minor = 0;
  uname(&kernel);
  std::sscanf(kernel.release, "%d.%d", &major, &minor);
  return KERNEL_VERSION(major, minor, 0) >= KERNEL_VERSION(6, 12, 0);
}

/// Of the calling thread, as sched_getattr(2) reports it.
std::uint64_t slice_ns() {
  std::array<char, 56> attributes{};
  EXPECT_EQ(syscall(SYS_sched_getattr, 0, attributes.data(), attributes.size(), 0U), 0);
  std::uint64_t runtime_ns = 0;
  std::memcpy(&runtime_ns, attributes.data() + 24, sizeof(runtime_ns));
  return runtime_ns;
}

TEST(Realtime, ShortSlicesHoldForTheThreadAndThoseItStarts) {
  if (!has_slices()) GTEST_SKIP() << "this kernel has no time slices of threads";
  on_a_thread([] {
    const std::uint64_t before = slice_ns();
    request_short_slices();
    EXPECT_EQ(slice_ns(), 100'000u);
    EXPECT_NE(before, 100'000u);
    on_a_thread([] { EXPECT_EQ(slice_ns(), 100'000u); });
  });
}

TEST(Realtime, ShortSlicesLeaveOtherSchedulingAlone) {
  on_a_thread([] {
    const sched_param none{};
    ASSERT_EQ(sched_setscheduler(0, SCHED_BATCH, &none), 0);
    request_short_slices();
    EXPECT_EQ(sched_getscheduler(0), SCHED_BATCH);
  });
}

TEST(Realtime, PinsToTheRequestedProcessor) {
  on_a_thread([] {
    cpu_set_t allowed;
    ASSERT_EQ(sched_getaffinity(0, sizeof(allowed), &allowed), 0);
    int cpu = 0;
    while (!CPU_ISSET(static_cast<std::size_t>(cpu), &allowed)) ++cpu;

    const RealtimeReport report = enter_realtime({.priority = 0, .cpu = cpu});

    EXPECT_TRUE(report.is_pinned);
    EXPECT_EQ(sched_getcpu(), cpu);
    EXPECT_EQ(report.text, "scheduling=ordinary cpu=" + std::to_string(cpu) + " wait=hybrid");
  });
}

TEST(Realtime, ReportsAMissingProcessor) {
  on_a_thread([] {
    const RealtimeReport report = enter_realtime({.priority = 0, .cpu = 100000});

    EXPECT_FALSE(report.is_pinned);
    EXPECT_EQ(report.text,
              "scheduling=ordinary cpu=any cpu_100000_refused=\"Invalid argument\" wait=hybrid");
  });
}

TEST(Realtime, APriorityBeyondTheRangeIsNotPermitted) { EXPECT_FALSE(may_use_fifo(100)); }

}  // namespace
}  // namespace palpate
