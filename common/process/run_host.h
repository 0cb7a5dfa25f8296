// SPDX-License-Identifier: Apache-2.0
// run_host.h — the link between the program that runs a session, `palpate launch` or `palpate
// replay`, and the viewers of its machine: RunState to them (hop 5), RunRequest from them (hop 7).
// It needs no key: both ends are files in the session's run folder, which only this user can open.
#pragma once

#include <optional>

#include "common/core/clock.h"
#include "common/link/socket/endpoint.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "common/session/session.h"
#include "common/telemetry/run_messages.h"

namespace palpate {

/// Endpoints of the link. Viewers connect to both.
[[nodiscard]] Attachment run_state_of(const Session& session, Attachment::Role role);
[[nodiscard]] Attachment run_requests_of(const Session& session, Attachment::Role role);

/// The end of the program that runs the session.
class RunHost {
 public:
  /// RunState is repeated at this interval, and a viewer that hears none for kGoneAfter is alone.
  static constexpr Duration kInterval = std::chrono::milliseconds(200);
  static constexpr Duration kGoneAfter = std::chrono::seconds(2);

  /// Throws SetupError, for example while another program runs this session.
  /// @param clock  must outlive it
  RunHost(ZmqContext& context, const Clock& clock, const Session& session);

  /// The next request of a viewer, if there is one.
  [[nodiscard]] std::optional<RunRequest> take() noexcept;
  /// Sends the state if it is due or `is_new`. Neither blocks nor waits for a viewer.
  void publish(RunState& state, bool is_new = false);

 private:
  const Clock& clock_;
  ZmqSender<RunState> states_;
  ZmqSource<RunRequest> requests_;
  Header header_;
  TimePoint next_{};
};

}  // namespace palpate
