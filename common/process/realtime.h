// SPDX-License-Identifier: Apache-2.0
// realtime.h — real-time scheduling: used when permitted, reported, never required.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "common/session/session.h"

namespace palpate {

struct RealtimeReport {
  bool has_fifo = false;           ///< SCHED_FIFO at the requested priority
  bool is_pinned = false;          ///< runs on the requested processor and on no other
  bool has_locked_memory = false;  ///< of the whole process, so that no page fault delays a tick
  /// One line of key=value pairs for the log, with the reasons for refusals.
  std::string text;
};

/// Gives the calling thread SCHED_FIFO, pins it to its processor and locks the memory of the
/// process, each if permitted; priority 0 requests neither FIFO nor locked memory. Never fails.
/// Call it on the tick thread after all other threads have started: later threads get ordinary
/// scheduling but inherit the processor.
RealtimeReport enter_realtime(const RealtimeConfig& config);

/// Lets the calling thread run ahead of tick threads with this priority, or beside them, if
/// permitted; 0 changes nothing. For threads that sleep nearly always and must be able to end
/// those. The threads and processes that it starts get ordinary scheduling. Never fails.
void run_ahead_of(int priority);

/// That this process may use; 0: not known.
[[nodiscard]] std::size_t usable_processors();

/// A warning if so many ticks are more than this process may use processors; "" otherwise.
[[nodiscard]] std::string too_many_ticks(std::size_t ticks);

/// A warning if threads of these sides never sleep, at a priority that leaves no processor to other
/// programs, or to each other; "" otherwise.
[[nodiscard]] std::string spin_warning(const std::vector<Side>& sides);

/// Asks for short time slices for the calling thread and those that it starts from now on: under
/// ordinary scheduling a thread that wakes then runs ahead of threads with longer slices. Needs no
/// permission; Linux before 6.12 ignores it. Changes nothing under another scheduling. Never fails.
void request_short_slices();

/// Whether a thread of this process may have SCHED_FIFO at `priority` (1 … 99). libzmq aborts the
/// process if its I/O threads get a priority that is not permitted, so check first.
[[nodiscard]] bool may_use_fifo(int priority);

}  // namespace palpate
