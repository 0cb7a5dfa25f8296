// SPDX-License-Identifier: Apache-2.0
#include "common/link/socket/alarm.h"

#include <sys/timerfd.h>
#include <unistd.h>

namespace palpate {

Alarm::~Alarm() {
  if (descriptor_ >= 0) close(descriptor_);
}

void Alarm::set(TimePoint at) noexcept {
  if (descriptor_ < 0) descriptor_ = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
  const std::int64_t ns = at.time_since_epoch().count();
  const itimerspec when{.it_interval = {},
                        .it_value = {.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000}};
  const bool is_set = timerfd_settime(descriptor_, TFD_TIMER_ABSTIME, &when, nullptr) == 0;
  at_ = is_set ? at : TimePoint{};
}

}  // namespace palpate
