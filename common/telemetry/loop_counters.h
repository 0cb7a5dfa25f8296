// loop_counters.h — what every periodic thread counts, and where it leaves its records.
#pragma once

#include <cstdint>

#include "common/core/time.h"

namespace palpate {

struct LoopCounters {
  std::uint64_t ticks = 0;          ///< turns begun
  std::uint64_t skipped_ticks = 0;  ///< appointments missed by overruns
  Duration worst_lateness{};
};

/// Where a periodic thread leaves its records. Never blocks, allocates or throws.
template <class Record>
class TickSink {
 public:
  virtual ~TickSink() = default;
  virtual void keep(const Record& record) noexcept = 0;
};

}  // namespace palpate
