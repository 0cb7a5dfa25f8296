// realtime.h — real-time scheduling: taken when permitted, reported, never required.
#pragma once

#include <string>

#include "common/session/session.h"

namespace palpate {

struct RealtimeReport {
  bool has_fifo = false;           ///< SCHED_FIFO at the priority asked for
  bool is_pinned = false;          ///< runs on the processor asked for and on no other
  bool has_locked_memory = false;  ///< of the whole process: no page fault can delay a tick
  /// One line of key=value words for the log, with the reason for what was refused.
  std::string text;
};

/// Gives the calling thread SCHED_FIFO and its processor and locks the memory of the process, each
/// if it is permitted; priority 0 asks for neither FIFO nor locked memory. Never fails. Call it on
/// the tick thread after other threads were started: threads started later get ordinary scheduling,
/// but inherit the processor.
RealtimeReport enter_realtime(const RealtimeConfig& config);

/// Whether a thread of this process may have SCHED_FIFO at `priority` (1 … 99). libzmq aborts the
/// process if its I/O threads are given a priority that is not permitted, so ask first.
[[nodiscard]] bool may_use_fifo(int priority);

}  // namespace palpate
