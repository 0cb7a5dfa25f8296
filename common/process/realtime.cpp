// SPDX-License-Identifier: Apache-2.0
#include "common/process/realtime.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <system_error>
#include <thread>

namespace palpate {
namespace {

const char* name(WaitStrategy wait) {
  switch (wait) {
    case WaitStrategy::kHybrid:
      return "hybrid";
    case WaitStrategy::kSpin:
      return "spin";
    case WaitStrategy::kBlock:
      return "block";
  }
  return "?";
}

std::string words_of(int error) { return std::generic_category().message(error); }

/// Returns 0 or an errno. Threads started by this one get ordinary scheduling.
int take_fifo(int priority) noexcept {
  const sched_param parameters{.sched_priority = priority};
  return pthread_setschedparam(pthread_self(), SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters);
}

/// Returns 0 or an errno.
int pin_to(int cpu) noexcept {
  if (cpu >= CPU_SETSIZE) return EINVAL;
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<std::size_t>(cpu), &set);
  return pthread_setaffinity_np(pthread_self(), sizeof(set), &set);
}

/// Returns 0 or an errno. Locks only without a limit: with one, later allocations would fail.
int lock_memory() noexcept {
  const rlimit unlimited{.rlim_cur = RLIM_INFINITY, .rlim_max = RLIM_INFINITY};
  if (setrlimit(RLIMIT_MEMLOCK, &unlimited) != 0) return errno;
  return mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
}

}  // namespace

RealtimeReport enter_realtime(const RealtimeConfig& config) {
  RealtimeReport report;

  if (config.priority > 0) {
    const std::string priority = std::to_string(config.priority);
    const int error = take_fifo(config.priority);
    report.has_fifo = error == 0;
    report.text = report.has_fifo
                      ? "scheduling=fifo priority=" + priority
                      : "scheduling=ordinary fifo_refused=\"" + words_of(error) +
                            "; permit it with ulimit -r " + priority + " or CAP_SYS_NICE\"";
  } else {
    report.text = "scheduling=ordinary";
  }

  if (config.cpu >= 0) {
    const std::string cpu = std::to_string(config.cpu);
    const int error = pin_to(config.cpu);
    report.is_pinned = error == 0;
    report.text += report.is_pinned
                       ? " cpu=" + cpu
                       : " cpu=any cpu_" + cpu + "_refused=\"" + words_of(error) + "\"";
  } else {
    report.text += " cpu=any";
  }
  report.text += std::string(" wait=") + name(config.wait);

  if (config.priority > 0) {
    const int error = lock_memory();
    report.has_locked_memory = error == 0;
    report.text += report.has_locked_memory ? " memory=locked"
                                            : " memory=unlocked lock_refused=\"" + words_of(error) +
                                                  "; permit it with ulimit -l unlimited\"";
  }
  return report;
}

void run_ahead_of(int priority) {
  if (priority <= 0) return;
  if (take_fifo(std::min(priority + 1, sched_get_priority_max(SCHED_FIFO))) != 0) {
    static_cast<void>(take_fifo(priority));
  }
}

std::size_t usable_processors() {
  cpu_set_t allowed;
  if (sched_getaffinity(0, sizeof(allowed), &allowed) != 0) return 0;
  return static_cast<std::size_t>(CPU_COUNT(&allowed));
}

std::string too_many_ticks(std::size_t ticks) {
  const std::size_t processors = usable_processors();
  if (processors == 0 || ticks <= processors) return "";
  return std::to_string(ticks) + " sides on " + std::to_string(processors) +
         (processors == 1 ? " processor" : " processors") +
         ": their ticks may delay each other and all other programs; use fewer sides, a lower "
         "device.rate_hz, or a larger machine";
}

std::string spin_warning(const std::vector<Side>& sides) {
  const std::size_t threads = 2 * sides.size();  // of device_node and mofc_node
  for (const Side& side : sides) {
    const RealtimeConfig& realtime = side.realtime;
    if (realtime.wait != WaitStrategy::kSpin || realtime.priority <= 0) continue;
    if (realtime.cpu < 0 && threads < usable_processors()) continue;
    return "realtime.wait = spin at priority " + std::to_string(realtime.priority) +
           ": device_node and mofc_node leave no processor to each other or to other programs; "
           "give priority: 0 and cpu: -1, or use hybrid, or --together device,mofc";
  }
  return "";
}

void request_short_slices() {
  if (sched_getscheduler(0) != SCHED_OTHER) return;  // chosen by who started the program
  // sched_setattr(2); the C library of Debian 12 has neither the function nor the struct
  struct Attributes {
    std::uint32_t size = sizeof(Attributes);
    std::uint32_t policy = SCHED_OTHER;
    std::uint64_t flags = 0;
    std::int32_t nice = 0;
    std::uint32_t priority = 0;
    std::uint64_t runtime_ns = 0;  // SCHED_OTHER: the time slice
    std::uint64_t deadline_ns = 0;
    std::uint64_t period_ns = 0;
  };
  constexpr std::uint64_t kShortestSliceNs = 100'000;  // of Linux 6.12; about the work of one tick
  const Attributes attributes{.nice = getpriority(PRIO_PROCESS, 0), .runtime_ns = kShortestSliceNs};
  syscall(SYS_sched_setattr, 0, &attributes, 0U);
}

bool may_use_fifo(int priority) {
  // try it on a separate thread: capabilities, limits and control groups all decide
  bool may = false;
  std::thread([&] { may = take_fifo(priority) == 0; }).join();
  return may;
}

}  // namespace palpate
