// SPDX-License-Identifier: Apache-2.0
// transfer.h — how a transfer over a wire went.
#pragma once

#include <cstdint>

namespace palpate::device {

enum class Transfer : std::uint8_t {
  kDone,
  kTimeout,   ///< nothing, or not all of it, within the time allowed
  kClosed,    ///< the other end is gone: unplugged, or its program ended
  kCorrupt,   ///< what came breaks the rules of the wire
  kNotReady,  ///< the device says that it has no supply or no calibration
  kDown,      ///< the interface of a bus is down, or off the bus after errors
  kFull,      ///< the queue of a bus stays full: nobody acknowledges what is sent
};

}  // namespace palpate::device
