// SPDX-License-Identifier: Apache-2.0
// link_fixture.h — fixture of the link tests: endpoints of every transport, waiting with a
// deadline, random messages.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/core/ports.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "tests/support/machine/machine.h"
#include "tests/support/random_messages.h"
#include "tests/support/temp_folder.h"

namespace palpate::test {

/// For events that must happen.
inline const Duration kPatience = patience(std::chrono::seconds(5));

enum class Transport { kInproc, kIpc, kTcp };

/// The text of the SetupError that `action` throws, or "no error".
inline std::string setup_error(const std::function<void()>& action) {
  try {
    action();
  } catch (const SetupError& error) {
    return error.what();
  }
  return "no error";
}

class LinksTest : public testing::Test {
 protected:
  [[nodiscard]] std::string ipc(const std::string& name) const {
    return "ipc://" + (folder_.path() / name).string();
  }

  /// An unused endpoint to bind; tcp gets a free port.
  std::string fresh_endpoint(Transport transport) {
    const std::string name = "e" + std::to_string(endpoints_++);
    switch (transport) {
      case Transport::kInproc:
        return "inproc://" + name;
      case Transport::kIpc:
        return ipc(name);
      case Transport::kTcp:
        break;
    }
    return "tcp://127.0.0.1:*";
  }

  /// Evaluates `event` until it is true; false at the deadline.
  [[nodiscard]] bool eventually(const std::function<bool()>& event) {
    const TimePoint deadline = clock_.now() + kPatience;
    while (!event()) {
      if (clock_.now() > deadline) return false;
      clock_.sleep_until(clock_.now() + std::chrono::microseconds(100));
    }
    return true;
  }

  /// Waits until the sender knows its receiver, which subscribes only while it is polled.
  template <class T, class Receiver>
  [[nodiscard]] bool meet(ZmqSender<T>& sender, Receiver& receiver) {
    return eventually([&] {
      receiver.wait_until(clock_.now());
      return sender.has_subscriber();
    });
  }

  template <class T>
  [[nodiscard]] bool receive(Source<T>& source, T& message) {
    const TimePoint deadline = clock_.now() + kPatience;
    TimePoint received_at;
    while (!source.receive(message, received_at)) {
      if (clock_.now() > deadline) return false;
      source.wait_until(deadline);
    }
    return true;
  }

  [[nodiscard]] DeviceState state(std::uint64_t session_id, std::uint64_t sequence) {
    auto message = random_message<DeviceState>(random_);
    message.header.session_id = session_id;
    message.header.sequence = sequence;
    return message;
  }

  TempFolder folder_;
  SteadyClock clock_;
  ManualClock manual_clock_;
  Random random_{1};
  ZmqContext context_;

 private:
  int endpoints_ = 0;
};

inline std::string transport_name(const testing::TestParamInfo<Transport>& which) {
  if (which.param == Transport::kInproc) return "Inproc";
  return which.param == Transport::kIpc ? "Ipc" : "Tcp";
}
inline const auto kEveryTransport =
    testing::Values(Transport::kInproc, Transport::kIpc, Transport::kTcp);
/// Transports between processes.
inline const auto kEverySocket = testing::Values(Transport::kIpc, Transport::kTcp);

class EveryTransport : public LinksTest, public testing::WithParamInterface<Transport> {};

}  // namespace palpate::test
