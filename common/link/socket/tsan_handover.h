// SPDX-License-Identifier: Apache-2.0
// tsan_handover.h — internal header of the links: tells ThreadSanitizer what libzmq guarantees.
// Debian's libzmq is not instrumented. Over inproc the receiver reads the very bytes that the
// sender wrote, and ThreadSanitizer does not see the atomics of the queue between them. Without
// ThreadSanitizer both functions do nothing.
#pragma once

#include <zmq.hpp>

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace palpate {

/// Before a part is sent: what was written to it is visible to who receives it.
inline void release_to_receiver([[maybe_unused]] zmq::message_t& part) noexcept {
#ifdef __SANITIZE_THREAD__
  __tsan_release(part.data());
#endif
}

/// After a part was received.
inline void acquire_from_sender([[maybe_unused]] zmq::message_t& part) noexcept {
#ifdef __SANITIZE_THREAD__
  __tsan_acquire(part.data());
#endif
}

}  // namespace palpate
