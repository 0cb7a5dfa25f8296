// SPDX-License-Identifier: Apache-2.0
#include "tests/support/machine/machine.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <sstream>
#include <thread>

namespace palpate::test {
namespace {

using std::chrono::steady_clock;

constexpr double kReferenceWorkS = 0.008;  // on the processor that the limits of the tests are from
constexpr double kMostSlowness = 1.5;
constexpr double kMostOthersRatio = 0.1;
constexpr double kMostOthersS = 0.05;  // five ticks of the kernel's accounts
constexpr auto kLongestPause = std::chrono::milliseconds(20);
constexpr auto kLook = std::chrono::milliseconds(5);

double to_seconds(const timespec& t) {
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double processor_time_s() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return to_seconds(t);
}

struct Slowness {
  double of_processor;  ///< by processor time: its speed
  double of_machine;    ///< by the time that passed: other programs too
};

/// A chain of operations, each of which needs the one before.
Slowness measure_slowness() {
  const auto begin = steady_clock::now();
  const double begin_s = processor_time_s();
  std::uint64_t x = 88172645463325252U;
  for (int i = 0; i < 4'000'000; ++i) {
    x ^= x << 13U;
    x ^= x >> 7U;
    x ^= x << 17U;
  }
  volatile std::uint64_t sink = x;
  static_cast<void>(sink);
  const std::chrono::duration<double> took = steady_clock::now() - begin;
  return {.of_processor = (processor_time_s() - begin_s) / kReferenceWorkS,
          .of_machine = took.count() / kReferenceWorkS};
}

double ticks_to_s(double ticks) { return ticks / static_cast<double>(sysconf(_SC_CLK_TCK)); }

/// Of all processors since the machine started.
struct ProcessorTimes {
  double all_s = 0.0;
  double busy_s = 0.0;  ///< including what a hypervisor took away

  ProcessorTimes() {
    std::ifstream stat("/proc/stat");
    std::string name;
    stat >> name;
    double ticks = 0.0;
    for (int field = 0; field < 8 && stat >> ticks; ++field) {
      all_s += ticks_to_s(ticks);
      const bool is_idle = field == 3 || field == 4;
      if (!is_idle) busy_s += ticks_to_s(ticks);
    }
  }
};

/// Processor time of this process and of all that it started, with theirs.
double own_s() {
  struct Process {
    long parent = 0;
    double used_s = 0.0;
  };
  std::map<long, Process> processes;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    char* end = nullptr;
    const std::string name = entry.path().filename();
    const long pid = std::strtol(name.c_str(), &end, 10);
    if (*end != '\0') continue;
    std::ifstream stat(entry.path() / "stat");
    std::string text;
    std::getline(stat, text);
    std::istringstream fields(text.substr(std::min(text.size(), text.rfind(')') + 2)));
    std::string state;
    Process process;
    fields >> state >> process.parent;
    for (int field = 5; field <= 13; ++field) fields >> text;
    for (int field = 14; field <= 17; ++field) {  // of itself and of children waited for
      double ticks = 0.0;
      if (fields >> ticks) process.used_s += ticks_to_s(ticks);
    }
    processes[pid] = process;
  }
  double sum_s = 0.0;
  for (const auto& [pid, process] : processes) {
    std::set<long> seen;
    for (long at = pid; at > 0 && seen.insert(at).second && processes.contains(at);
         at = processes[at].parent) {
      if (at != getpid()) continue;
      sum_s += process.used_s;
      break;
    }
  }
  return sum_s;
}

/// How often the control group of this process was made to wait for its quota.
long throttled_times() {
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const std::size_t name = line.find(':') + 1;
    const std::size_t path = line.find(':', name) + 1;
    const std::string controllers = "," + line.substr(name, path - 1 - name) + ",";
    const bool is_unified = controllers == ",,";
    if (!is_unified && controllers.find(",cpu,") == std::string::npos) continue;
    std::ifstream stat(std::string("/sys/fs/cgroup") + (is_unified ? "" : "/cpu") +
                       line.substr(path) + "/cpu.stat");
    std::string key;
    for (long value = 0; stat >> key >> value;) {
      if (key == "nr_throttled") return value;
    }
  }
  return 0;
}

}  // namespace

std::chrono::milliseconds patience(std::chrono::milliseconds ample) {
  static const double slowness = std::max(1.0, measure_slowness().of_machine);
  return std::chrono::milliseconds(
      static_cast<std::int64_t>(4.0 * slowness * static_cast<double>(ample.count())));
}

struct QuietMachine::Observation {
  Slowness slowness = measure_slowness();
  ProcessorTimes processors;
  double own_s = test::own_s();
  long throttled_times = test::throttled_times();
  std::atomic<steady_clock::duration> longest_pause{};
  std::jthread look{[this](const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      const auto due = steady_clock::now() + kLook;
      std::this_thread::sleep_until(due);
      longest_pause = std::max(longest_pause.load(), steady_clock::now() - due);
    }
  }};
};

QuietMachine::QuietMachine() : observation_(std::make_unique<Observation>()) {}
QuietMachine::~QuietMachine() = default;

std::string QuietMachine::disturbance() const {
  char words[96] = "";
  const Observation& begin = *observation_;
  const ProcessorTimes now;
  const double others_s = now.busy_s - begin.processors.busy_s - (own_s() - begin.own_s);
  const double others_ratio = others_s / std::max(0.01, now.all_s - begin.processors.all_s);
  const std::chrono::duration<double, std::milli> pause = begin.longest_pause.load();
  if (begin.slowness.of_processor > kMostSlowness) {
    std::snprintf(words, sizeof(words), "the processor takes %.1f times as long as the reference",
                  begin.slowness.of_processor);
  } else if (others_s > kMostOthersS && others_ratio > kMostOthersRatio) {
    std::snprintf(words, sizeof(words), "other programs used %.0f %% of the processors",
                  100.0 * others_ratio);
  } else if (throttled_times() > begin.throttled_times) {
    std::snprintf(words, sizeof(words), "a quota withheld processor time");
  } else if (pause > kLongestPause) {
    std::snprintf(words, sizeof(words), "the test itself was kept waiting for %.0f ms",
                  pause.count());
  }
  return words;
}

bool QuietMachine::may_check(const std::string& figure) const {
  const std::string why_not = disturbance();
  if (why_not.empty()) return true;
  std::printf("not checked: %s: the machine was not quiet: %s\n", figure.c_str(), why_not.c_str());
  return false;
}

}  // namespace palpate::test
