// SPDX-License-Identifier: Apache-2.0
// receipts.h — which numbered messages of hop 3 have arrived.
#pragma once

#include <cstdint>

#include "common/core/tissue.h"

namespace palpate::mofc {

/// @param newest    highest number so far; 0: none
/// @param received  bit i: number `newest` − i has arrived
inline void note_receipt(std::uint64_t number, std::uint64_t& newest,
                         std::uint64_t& received) noexcept {
  if (number > newest) {
    const std::uint64_t ahead = number - newest;
    received = ahead < kReceiptBits ? received << ahead : 0;
    newest = number;
  }
  const std::uint64_t back = newest - number;
  if (back < kReceiptBits) received |= std::uint64_t{1} << back;
}

}  // namespace palpate::mofc
