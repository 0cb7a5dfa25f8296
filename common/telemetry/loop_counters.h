// SPDX-License-Identifier: Apache-2.0
// loop_counters.h — counters of a periodic thread, and the sink for its records.
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate {

struct LoopCounters {
  std::uint64_t ticks = 0;          ///< started
  std::uint64_t skipped_ticks = 0;  ///< scheduled ticks missed because of overruns
  Duration worst_lateness{};
};

/// Receives the records of a periodic thread. Never blocks, allocates or throws.
template <class Record>
class TickSink {
 public:
  virtual ~TickSink() = default;
  virtual void keep(const Record& record) noexcept = 0;
};

}  // namespace palpate
