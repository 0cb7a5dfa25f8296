// SPDX-License-Identifier: Apache-2.0
// echo_links.h — minimal ways to send bytes to another process and back, to compare the exchange
// with.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include "common/session/session.h"

namespace palpate::bench {

/// Sizes of request and reply [bytes].
struct EchoBytes {
  std::size_t there = 0;
  std::size_t back = 0;
};

/// Created before the processes of its two ends; each end then calls one function. Both processes
/// have set their scheduling before.
class EchoLink {
 public:
  virtual ~EchoLink() = default;
  /// In the near process: performs one round trip and sleeps until the echo arrives. Ready for the
  /// first when it returns. `realtime`: for the threads of the library.
  virtual std::function<void()> open_near(const RealtimeConfig& realtime) = 0;
  /// In the far process: echoes until it is killed.
  virtual void serve_far(const RealtimeConfig& realtime) = 0;
};

/// DEALER to ROUTER over ipc:// in `folder`, blocking calls.
std::unique_ptr<EchoLink> zmq_ipc_echo(const EchoBytes& bytes, const std::string& folder);
/// PAIR to PAIR over inproc://: the far end is a thread of the near process.
std::unique_ptr<EchoLink> zmq_inproc_echo(const EchoBytes& bytes);
/// @param type  SOCK_STREAM or SOCK_DGRAM
std::unique_ptr<EchoLink> unix_echo(const EchoBytes& bytes, int type);
/// Two buffers in shared memory, a futex each.
std::unique_ptr<EchoLink> shared_memory_echo(const EchoBytes& bytes);
#ifdef PALPATE_HAS_GAZEBO_TRANSPORT
/// Two topics of Gazebo Transport, published there and back by its callbacks.
std::unique_ptr<EchoLink> gazebo_transport_echo(const EchoBytes& bytes);
#endif

}  // namespace palpate::bench
