#include "common/process/realtime.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <cerrno>
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

bool may_use_fifo(int priority) {
  // try it on a separate thread: capabilities, limits and control groups all decide
  bool may = false;
  std::thread([&] { may = take_fifo(priority) == 0; }).join();
  return may;
}

}  // namespace palpate
