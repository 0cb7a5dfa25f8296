// SPDX-License-Identifier: Apache-2.0
// lifeline.h — ends what the children of a supervisor have started, even if it is killed itself.
#pragma once

#include <sys/types.h>

namespace palpate {

/// A process beside the supervisor that hears from it which process groups run. When the
/// connection breaks, because the supervisor has ended for any reason, it kills those that are
/// left, and ends.
class Lifeline {
 public:
  /// Throws std::system_error if there can be no such process.
  Lifeline();
  ~Lifeline();
  Lifeline(const Lifeline&) = delete;
  Lifeline& operator=(const Lifeline&) = delete;

  void add(pid_t group) const;
  /// Before the leader of the group is reaped: then its number may be that of another.
  void remove(pid_t group) const;

 private:
  pid_t process_ = 0;
  int socket_ = -1;
};

}  // namespace palpate
