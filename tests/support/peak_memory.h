// peak_memory.h — the largest resident memory of a process, also between two looks at it.
#pragma once

#include <sys/types.h>

#include <fstream>
#include <string>

namespace palpate::test {

/// From now on, until the next call for the same process.
inline void restart_peak_memory(pid_t process) {
  std::ofstream("/proc/" + std::to_string(process) + "/clear_refs") << "5" << std::flush;
}
/// Largest resident memory since then [MiB].
inline double peak_memory_mib(pid_t process) {
  std::ifstream status("/proc/" + std::to_string(process) + "/status");
  for (std::string word; status >> word;) {
    double kib = 0.0;
    if (word == "VmHWM:" && status >> kib) return kib / 1024;
  }
  return 0.0;
}

}  // namespace palpate::test
