// SPDX-License-Identifier: Apache-2.0
// acknowledge.h — the person at a real device that `palpate launch` runs.
#pragma once

#include <unistd.h>

#include <csignal>
#include <string>

#include "tests/support/program.h"

namespace palpate::test {

[[nodiscard]] inline int times_in(const std::string& text, const std::string& what) {
  int times = 0;
  for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) {
    ++times;
  }
  return times;
}

/// Sends SIGUSR2 to device_node, as often as the device asks for it, until it was enabled `times`
/// times in all.
[[nodiscard]] inline bool is_enabled(Program& launch, int times = 1) {
  const pid_t node = std::stoi(launch.await_err("event=node_started node=device pid="));
  launch.await_err("event=device_phase phase=");  // from now on the signal acknowledges
  bool has_ended = false;
  const bool is_told = await([&] {
    if (times_in(launch.err(), "event=device_phase phase=enabled") >= times) return true;
    has_ended = kill(node, SIGUSR2) != 0;
    usleep(50'000);
    return has_ended;
  });
  return is_told && !has_ended;
}

}  // namespace palpate::test
