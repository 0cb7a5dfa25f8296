// SPDX-License-Identifier: Apache-2.0
// machine.h — how fast the machine is on which the tests run, and whether it is quiet.
#pragma once

#include <chrono>
#include <memory>
#include <string>

namespace palpate::test {

/// How long to wait for an event that must happen. Only a failing test waits so long.
/// @param ample  more than enough on an idle machine
/// @return `ample`, times how much slower than the reference machine a fixed piece of work is
///         (measured once in a process, at least 1), times 4 for what is not measured: programs
///         that start later, and several processes that wait for each other
[[nodiscard]] std::chrono::milliseconds patience(std::chrono::milliseconds ample);

/// Observes the machine from its construction on. A figure of real time is checked only if the
/// machine was quiet all that time: otherwise it says nothing about the program.
class QuietMachine {
 public:
  QuietMachine();
  ~QuietMachine();
  QuietMachine(const QuietMachine&) = delete;
  QuietMachine& operator=(const QuietMachine&) = delete;

  /// Whether the machine was quiet until now: a processor at most 1.5 times as slow as the
  /// reference, at most 10 % of the processors' time used by programs that this process did not
  /// start, none of it withheld by a quota, and this process never kept waiting for 20 ms. If not,
  /// prints that `figure` is not checked, and why.
  [[nodiscard]] bool may_check(const std::string& figure) const;
  /// Why not, in words; empty: the machine was quiet.
  [[nodiscard]] std::string disturbance() const;

 private:
  struct Observation;
  std::unique_ptr<Observation> observation_;
};

}  // namespace palpate::test
