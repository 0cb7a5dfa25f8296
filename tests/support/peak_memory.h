// SPDX-License-Identifier: Apache-2.0
// peak_memory.h — the largest resident memory of a process, also between two looks at it.
#pragma once

#include <sys/types.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
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

/// Of the living children of a process: by program, the largest resident memory so far [MiB].
inline std::map<std::string, double> peak_memory_of_children_mib(pid_t parent) {
  namespace fs = std::filesystem;
  std::map<std::string, double> peaks;
  for (const fs::directory_entry& entry : fs::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    std::ifstream status(entry.path() / "status");
    pid_t found = 0;
    for (std::string word; status >> word;) {
      if (word == "PPid:" && status >> found) break;
    }
    std::error_code gone;
    const std::string program = fs::read_symlink(entry.path() / "exe", gone).filename();
    if (gone || found != parent) continue;
    peaks[program] = std::max(peaks[program], peak_memory_mib(std::stoi(name)));
  }
  return peaks;
}

}  // namespace palpate::test
