// process_links.h — the ZeroMQ contexts of one process.
#pragma once

#include "common/core/session.h"
#include "common/link/zmq_links.h"

namespace palpate {

/// Hops 1 and 4 have an I/O thread of their own, real-time if permitted; everything else shares
/// another one of ordinary priority, so that viewers and a distant physics cannot delay the tick.
/// Nodes that run in one process over inproc:// share one ProcessLinks.
struct ProcessLinks {
  explicit ProcessLinks(const RealtimeConfig& realtime) : exchange(realtime) {}
  ZmqContext exchange;
  ZmqContext side;
};

}  // namespace palpate
