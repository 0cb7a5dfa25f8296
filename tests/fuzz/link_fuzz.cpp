// SPDX-License-Identifier: Apache-2.0
// Arbitrary messages for every end of a link: of several parts, too long, interleaved among peers,
// and arbitrary bytes in the stream of a binding end. No end aborts, and each still works after it.
//
// The input is a list of actions: one byte selects the attacked end, one the shape, two the length;
// then that many bytes of content.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "common/link/plot_sender.h"
#include "common/link/scene_sender.h"
#include "common/link/telemetry_subscriber.h"
#include "common/link/zmq_sender.h"
#include "common/link/zmq_source.h"
#include "tests/support/hostile/raw_zmtp.h"
#include "tests/support/random_messages.h"
#include "tests/support/temp_folder.h"

namespace {

using namespace palpate;

/// Every kind of end, each with a hostile peer and a true one, over inproc: a message that was sent
/// can be received at once. One end binds ipc for arbitrary bytes.
class Ends {
 public:
  static constexpr std::size_t kEnds = 8;

  Ends() {
    for (std::size_t i = 0; i < kAttacked.size(); ++i) {
      zmq::socket_t& socket = attackers_[i].emplace(context_.get(), kAttacked[i].type);
      socket.set(zmq::sockopt::linger, 0);
      socket.set(zmq::sockopt::sndhwm, 1000);
      if (kAttacked[i].type == zmq::socket_type::router) {
        socket.set(zmq::sockopt::router_mandatory, true);
        socket.bind(kAttacked[i].endpoint);
      } else {
        socket.connect(kAttacked[i].endpoint);
      }
    }
    client_.emplace(context_, clock_, connect_to("inproc://client", "x"));
    source_.emplace(context_, clock_, connect_to("inproc://source", "x"));
    viewer_.emplace(context_, clock_, std::vector{connect_to("inproc://viewer", "x")});
    static_cast<void>(client_->send(state_));
    // a ROUTER knows a peer once it has sent something
    for (const std::size_t i : {4u, 5u, 6u}) {
      zmq::message_t rest;
      PALPATE_REQUIRE(attackers_[i]->recv(peers_[i]).has_value());
      PALPATE_REQUIRE(attackers_[i]->recv(rest).has_value());
    }
  }

  /// @param shape  bits 0…2: parts beyond the first; the others: see below
  void attack(std::size_t end, std::uint8_t shape, std::span<const std::uint8_t> content) {
    const std::string bytes(content.begin(), content.end());
    if (end == kAttacked.size()) {
      test::RawStream stream(stream_source_.endpoint());
      if ((shape & 1) != 0) stream.write(test::zmtp_greeting());
      if ((shape & 2) != 0) stream.write(test::zmtp_ready("PUSH"));
      stream.write(bytes);
      return;
    }
    zmq::socket_t& socket = *attackers_[end];
    try {
      if (peers_[end].size() > 0) {
        zmq::message_t to;
        to.copy(peers_[end]);
        if (!socket.send(to, zmq::send_flags::sndmore | zmq::send_flags::dontwait)) return;
      }
      for (int more = shape & 7; more > 0; --more) {
        socket.send(zmq::buffer(bytes), zmq::send_flags::sndmore | zmq::send_flags::dontwait);
      }
      // repeated up to 1 MiB
      std::string last = bytes;
      if ((shape & 8) != 0) {
        while (!last.empty() && last.size() < (1 << 20)) last += last;
      }
      socket.send(zmq::buffer(last), zmq::send_flags::dontwait);
    } catch (const zmq::error_t&) {  // its queue is full
    }
    if ((shape & 16) != 0) receive();
  }

  /// Reads everything and sends a message through every end.
  void check() {
    receive();
    static_cast<void>(honest_device_.send(state_));
    PALPATE_REQUIRE(honest_motion_.send(motion_) == SendResult::kSent);
    PALPATE_REQUIRE(honest_pointer_.send(target_) == SendResult::kSent);
    receive();
    PALPATE_REQUIRE(received_motion_.header.sequence == motion_.header.sequence);
    PALPATE_REQUIRE(received_target_.header.sequence == target_.header.sequence);
    ++state_.header.sequence;
    ++motion_.header.sequence;
    ++target_.header.sequence;
    static_cast<void>(interactions_.send(interaction_));
    static_cast<void>(scenes_.has_subscriber<SceneState>());
    plot_.send(0, {}, {}, 1.0);
  }

 private:
  struct Attacked {
    zmq::socket_type type;
    const char* endpoint;
  };
  static constexpr std::array<Attacked, kEnds - 1> kAttacked{{
      {zmq::socket_type::dealer, "inproc://server"},
      {zmq::socket_type::push, "inproc://motion"},
      {zmq::socket_type::push, "inproc://target"},
      {zmq::socket_type::dealer, "inproc://interaction"},
      {zmq::socket_type::router, "inproc://client"},
      {zmq::socket_type::router, "inproc://source"},
      {zmq::socket_type::router, "inproc://viewer"},
  }};

  /// Reads an end until it finds nothing; a call ends early after so many refused frames.
  template <class End, class Message>
  static void read_all(End& end, Message& message) {
    TimePoint at;
    for (std::uint64_t rejected = ~std::uint64_t{0}; rejected != end.rejected();) {
      rejected = end.rejected();
      while (end.receive(message, at)) {
      }
    }
  }
  void receive() {
    DeviceState state;
    Interaction interaction;
    ForceCommand command;
    TelemetryMessage telemetry;
    ToolMotion motion;
    read_all(server_, state);
    read_all(motions_, received_motion_);
    read_all(targets_, received_target_);
    read_all(*client_, command);
    read_all(*source_, interaction);
    read_all(*viewer_, telemetry);
    read_all(stream_source_, motion);
  }

  SteadyClock clock_;
  test::TempFolder folder_;
  Random random_{1};
  ZmqContext context_;
  DeviceState state_ = test::random_message<DeviceState>(random_);
  ToolMotion motion_ = test::random_message<ToolMotion>(random_);
  HandTarget target_ = test::random_message<HandTarget>(random_);
  Interaction interaction_ = test::random_message<Interaction>(random_);

  ExchangeServer server_{context_, clock_, bind_to("inproc://server", "x")};
  ZmqSource<ToolMotion> motions_{context_, clock_, bind_to("inproc://motion", "x")};
  ZmqSource<HandTarget> targets_{context_, clock_, bind_to("inproc://target", "x")};
  ZmqSender<Interaction> interactions_{context_, bind_to("inproc://interaction", "x")};
  SceneSender scenes_{context_, bind_to("inproc://scene", "x")};
  ZmqSource<ToolMotion> stream_source_{
      context_, clock_, bind_to("ipc://" + (folder_.path() / "motion").string(), "x")};
  PlotSender plot_{context_, "tcp://127.0.0.1:*", "--plotjuggler"};
  std::array<std::optional<zmq::socket_t>, kAttacked.size()> attackers_;
  std::array<zmq::message_t, kAttacked.size()> peers_;
  std::optional<ExchangeClient> client_;
  std::optional<ZmqSource<Interaction>> source_;
  std::optional<TelemetrySubscriber> viewer_;
  ExchangeClient honest_device_{context_, clock_, connect_to("inproc://server", "x")};
  ZmqSender<ToolMotion> honest_motion_{context_, connect_to("inproc://motion", "x")};
  ZmqSender<HandTarget> honest_pointer_{context_, connect_to("inproc://target", "x")};
  ToolMotion received_motion_;
  HandTarget received_target_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static Ends ends;
  std::span<const std::uint8_t> rest(data, size);
  while (rest.size() >= 4) {
    const std::size_t end = rest[0] % Ends::kEnds;
    const std::uint8_t shape = rest[1];
    const std::size_t length =
        std::min<std::size_t>(rest[2] + std::size_t{256} * rest[3], rest.size() - 4);
    ends.attack(end, shape, rest.subspan(4, length));
    rest = rest.subspan(4 + length);
  }
  ends.check();
  return 0;
}
