// SPDX-License-Identifier: Apache-2.0
// Peers that violate the protocol: whatever they send, no end of a link aborts, stops working or
// grows without limit.
#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdio>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "common/link/plot_sender.h"
#include "common/link/scene_sender.h"
#include "common/link/socket/link_socket.h"
#include "common/link/telemetry_subscriber.h"
#include "tests/loopback/links/link_fixture.h"
#include "tests/support/encoded_frame.h"
#include "tests/support/hostile/raw_zmtp.h"
#include "tests/support/peak_memory.h"
#include "tests/support/port.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;

#ifdef __SANITIZE_ADDRESS__
constexpr double kMostGrowthMib = 512.0;  // freed memory is kept for a while
#else
constexpr double kMostGrowthMib = 32.0;
#endif

/// Sends malformed messages in a thread, over a new connection whenever one has ended, until its
/// destruction.
class Attacker {
 public:
  /// @param listens  at the endpoint; otherwise connects to it
  /// @param type     of the socket that it pretends to be: "DEALER"
  Attacker(const std::string& endpoint, bool listens, const char* type, std::string frames)
      : type_(type), frames_(std::move(frames)) {
    if (listens) {
      listener_.emplace(endpoint);
      EXPECT_TRUE(listener_->is_open()) << endpoint;
    }
    thread_ = std::jthread([this, endpoint](const std::stop_token& stop) {
      while (!stop.stop_requested()) {
        if (const auto stream = meet(endpoint)) attack(*stream, stop);
      }
    });
  }
  ~Attacker() {
    thread_.request_stop();
    const std::lock_guard lock(mutex_);
    if (stream_ != nullptr) stream_->hang_up();
  }
  Attacker(const Attacker&) = delete;
  Attacker& operator=(const Attacker&) = delete;

  [[nodiscard]] int rounds() const { return rounds_; }

 private:
  std::unique_ptr<RawStream> meet(const std::string& endpoint) {
    if (!listener_) return std::make_unique<RawStream>(endpoint);
    const int accepted = listener_->accept();
    return accepted < 0 ? nullptr : std::make_unique<RawStream>(accepted);
  }
  void attack(RawStream& stream, const std::stop_token& stop) {
    hold(&stream);
    if (stream.shake_hands(type_)) {
      while (!stop.stop_requested() && stream.write(frames_)) ++rounds_;
    }
    hold(nullptr);
  }
  void hold(RawStream* stream) {
    const std::lock_guard lock(mutex_);
    stream_ = stream;
  }

  const char* type_;
  std::string frames_;
  std::optional<RawListener> listener_;
  std::atomic<int> rounds_{0};
  std::mutex mutex_;
  RawStream* stream_ = nullptr;
  std::jthread thread_;  // last: ends first
};

/// Messages of two parts and of a hundred, a long frame of no kind, and an empty one.
/// @param largest  [bytes] that the attacked end accepts
std::string malformed(const std::string& valid, std::int64_t largest) {
  const auto size = static_cast<std::size_t>(largest) - 10;
  std::string frames =
      zmtp_frame(kMoreParts, valid) + zmtp_frame(kLastPart, std::string(size, 'x'));
  for (int i = 0; i < 100; ++i) frames += zmtp_frame(kMoreParts, valid);
  frames += zmtp_frame(kLastPart, "");
  return frames + zmtp_frame(kLastPart, std::string(size, '\1')) + zmtp_frame(kLastPart, "");
}

class HostilePeer : public EveryTransport {
 protected:
  /// The endpoint where the attacked end connects, which this test binds.
  std::string unused_endpoint() {
    if (GetParam() != Transport::kTcp) return fresh_endpoint(GetParam());
    return ports_.emplace_back(std::make_unique<HeldPort>())->endpoint();
  }

  std::vector<std::unique_ptr<HeldPort>> ports_;  // held, so that each endpoint is another one
  TimePoint at_;
};
INSTANTIATE_TEST_SUITE_P(Links, HostilePeer, kEverySocket, transport_name);

// --- messages of several parts, too long ones, none at all ------------------------------------

TEST_P(HostilePeer, DoesNotDisturbTheEndsThatBind) {
  ExchangeServer exchange(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  ZmqSource<ToolMotion> motions(context_, clock_,
                                bind_to(fresh_endpoint(GetParam()), "links.tool_motion"));
  ZmqSource<HandTarget> targets(context_, clock_,
                                bind_to(fresh_endpoint(GetParam()), "links.hand_target"));
  ZmqSender<Interaction> interactions(context_,
                                      bind_to(fresh_endpoint(GetParam()), "links.interaction"));
  SceneSender scene(context_, bind_to(fresh_endpoint(GetParam()), "links.physics_telemetry"));
  PlotSender plot(context_, fresh_endpoint(GetParam()), "--plotjuggler");
  const auto state_message = state(4, 0);
  const auto motion = random_message<ToolMotion>(random_);
  const auto target = random_message<HandTarget>(random_);
  const std::string subscription("\x0b\4\7", 3);
  const std::string of_state = malformed(test::frame_of(state_message), kLargestFrameBytes);
  const std::string of_motion = malformed(test::frame_of(motion), kLargestFrameBytes);
  const std::string of_target = malformed(test::frame_of(target), kLargestFrameBytes);
  const std::string of_subscription = malformed(subscription, kLargestSubscriptionBytes);
  DeviceState received_state;
  ToolMotion received_motion;
  HandTarget received_target;
  {
    std::list<Attacker> attackers;
    attackers.emplace_back(exchange.endpoint(), false, "DEALER", of_state);
    attackers.emplace_back(motions.endpoint(), false, "PUSH", of_motion);
    attackers.emplace_back(targets.endpoint(), false, "PUSH", of_target);
    attackers.emplace_back(interactions.endpoint(), false, "DEALER", of_subscription);
    attackers.emplace_back(scene.endpoint(), false, "DEALER", of_subscription);
    attackers.emplace_back(plot.endpoint(), false, "XSUB", of_subscription);
    EXPECT_TRUE(eventually([&] {
      static_cast<void>(exchange.receive(received_state, at_));
      static_cast<void>(motions.receive(received_motion, at_));
      static_cast<void>(targets.receive(received_target, at_));
      static_cast<void>(interactions.has_subscriber());
      static_cast<void>(scene.has_subscriber<SceneState>());
      plot.send(0, {}, {}, 1.0);
      return exchange.rejected() > 100 && motions.rejected() > 100 && targets.rejected() > 100 &&
             std::all_of(attackers.begin(), attackers.end(),
                         [](const Attacker& attacker) { return attacker.rounds() >= 20; });
    })) << exchange.rejected()
        << " " << motions.rejected() << " " << targets.rejected();
  }

  // the ends still serve their peers
  ExchangeClient device(context_, clock_, connect_to(exchange.endpoint(), "links.exchange"));
  ZmqSender<ToolMotion> motion_out(context_, connect_to(motions.endpoint(), "links.tool_motion"));
  ZmqSource<Interaction> interaction_in(context_, clock_,
                                        connect_to(interactions.endpoint(), "links.interaction"));
  std::uint64_t sequence = 0;
  EXPECT_TRUE(eventually([&] {
    static_cast<void>(device.send(state(4, ++sequence)));
    return exchange.receive(received_state, at_) && received_state.header.sequence > 0;
  }));
  EXPECT_TRUE(eventually([&] {
    static_cast<void>(motion_out.send(motion));
    return motions.receive(received_motion, at_);
  }));
  Interaction interaction = random_message<Interaction>(random_);
  EXPECT_TRUE(eventually([&] {
    static_cast<void>(interactions.send(interaction));
    return interaction_in.receive(interaction, at_);
  }));
}

TEST_P(HostilePeer, DoesNotDisturbTheEndsThatConnect) {
  const std::array<std::string, 3> endpoints{unused_endpoint(), unused_endpoint(),
                                             unused_endpoint()};
  ports_.clear();
  ExchangeClient device(context_, clock_, connect_to(endpoints[0], "links.exchange"));
  ZmqSource<Interaction> interactions(context_, clock_,
                                      connect_to(endpoints[1], "links.interaction"));
  TelemetrySubscriber viewer(context_, clock_, {connect_to(endpoints[2], "physics")});
  const std::array<std::string, 3> valid{test::frame_of(random_message<ForceCommand>(random_)),
                                         test::frame_of(random_message<Interaction>(random_)),
                                         test::frame_of(random_message<PhysicsBatch>(random_))};
  ForceCommand command;
  Interaction interaction;
  TelemetryMessage telemetry;
  std::uint64_t sequence = 0;
  {
    std::list<Attacker> attackers;
    for (std::size_t i = 0; i < endpoints.size(); ++i) {
      attackers.emplace_back(endpoints[i], true, "ROUTER", malformed(valid[i], kLargestFrameBytes));
    }
    EXPECT_TRUE(eventually([&] {
      static_cast<void>(device.send(state(1, ++sequence)));
      static_cast<void>(device.receive(command, at_));
      static_cast<void>(interactions.receive(interaction, at_));
      static_cast<void>(viewer.receive(telemetry, at_));
      return device.rejected() > 100 && interactions.rejected() > 100 && viewer.rejected() > 100;
    })) << device.rejected()
        << " " << interactions.rejected() << " " << viewer.rejected();
  }

  // true peers take over
  std::optional<ExchangeServer> exchange;
  std::optional<ZmqSender<Interaction>> interaction_out;
  std::optional<ZmqSender<PhysicsBatch>> batch_out;
  ASSERT_TRUE(eventually([&] {  // libzmq releases a port shortly after closing
    try {
      if (!exchange) exchange.emplace(context_, clock_, bind_to(endpoints[0], "links.exchange"));
      if (!interaction_out) {
        interaction_out.emplace(context_, bind_to(endpoints[1], "links.interaction"));
      }
      if (!batch_out) batch_out.emplace(context_, bind_to(endpoints[2], "physics"));
    } catch (const SetupError&) {
    }
    return exchange && interaction_out && batch_out;
  }));
  DeviceState received_state;
  EXPECT_TRUE(eventually([&] {
    static_cast<void>(device.send(state(1, ++sequence)));
    if (exchange->receive(received_state, at_)) {
      exchange->send(random_message<ForceCommand>(random_));
    }
    return device.receive(command, at_);
  }));
  EXPECT_TRUE(eventually([&] {
    static_cast<void>(interaction_out->send(random_message<Interaction>(random_)));
    return interactions.receive(interaction, at_);
  }));
  EXPECT_TRUE(eventually([&] {
    static_cast<void>(batch_out->send(random_message<PhysicsBatch>(random_)));
    return viewer.receive(telemetry, at_);
  }));
}

// The socket has read a part of the message when its connection ends.
TEST_P(HostilePeer, MayHangUpWithinAMessageOfManyParts) {
  for (const LinkSettings& settings : {kExchangeClient, kInteractionReceiver, kTelemetryReceiver}) {
    const std::string endpoint = unused_endpoint();
    ports_.clear();
    LinkSocket end(context_, settings, connect_to(endpoint, "links.interaction"));
    zmq::message_t frame;
    const auto send = [&](int parts) {
      const RawListener listener(endpoint);
      ASSERT_TRUE(listener.is_open());
      int accepted = -1;
      ASSERT_TRUE(eventually([&] { return (accepted = listener.accept()) >= 0; }));
      RawStream peer(accepted);
      ASSERT_TRUE(peer.shake_hands("ROUTER"));
      std::string frames;
      for (int i = 1; i < parts; ++i) frames += zmtp_frame(kMoreParts, "x");
      frames += zmtp_frame(kLastPart, "x");
      ASSERT_TRUE(peer.write(frames));
      const Reception expected = parts == 1 ? Reception::kMessage : Reception::kMalformed;
      EXPECT_TRUE(eventually([&] { return end.receive(frame) == expected; }));
    };
    send(5000);
    ASSERT_TRUE(eventually([&] { return end.has_lost_peer(); }));
    for (int i = 0; i < 100; ++i) EXPECT_EQ(end.receive(frame), Reception::kNothing);
    send(1);
  }
}

// --- memory -----------------------------------------------------------------------------------

class Swelling : public LinksTest {
 protected:
  struct Attack {
    const char* type;      ///< of the attacker's socket
    std::string frames;    ///< repeated after the handshake
    std::size_t mib;       ///< in all or as much as patience(0.5 s) allows, over a new connection
                           ///< whenever one is ended
    bool must_end = true;  ///< its connections
  };
  struct Effect {
    int ended = 0;  ///< connections
    double growth_mib = 0.0;
  };

  /// Attacks the endpoint while `work` runs and expects bounded growth and the end of connections.
  /// On a busy machine the monitor or the attacker may come late, so there are several attempts;
  /// without a limit each would fail.
  void expect_bounded(const char* what, const std::string& endpoint, const Attack& attack,
                      const std::function<void()>& work) {
    constexpr int kMostAttempts = 4;
    const QuietMachine machine;
    Effect effect;
    for (int attempt = 0; attempt < kMostAttempts; ++attempt) {
      effect = suffer(endpoint, attack, work);
      if (effect.growth_mib < kMostGrowthMib && (effect.ended > 0 || !attack.must_end)) break;
    }
    std::printf("%s: %d connections ended, grew by %.1f MiB\n", what, effect.ended,
                effect.growth_mib);
    if (effect.growth_mib < kMostGrowthMib || machine.may_check(what)) {
      EXPECT_LT(effect.growth_mib, kMostGrowthMib) << what;
    }
    EXPECT_TRUE(effect.ended > 0 || !attack.must_end) << what;
  }
  TimePoint at_;

 private:
  Effect suffer(const std::string& endpoint, const Attack& attack,
                const std::function<void()>& work) {
    const std::size_t total = attack.mib << 20;
    std::string block;
    while (block.size() < (64 << 10)) block += attack.frames;
    malloc_trim(0);  // what earlier attacks left
    restart_peak_memory(getpid());
    const double before = peak_memory_mib(getpid());
    Effect effect;
    const TimePoint end =
        clock_.now() + patience(500ms);  // frames that are read one by one are read slowly
    std::atomic<bool> is_done{false};
    std::thread attacker([&] {
      for (std::size_t sent = 0; sent < total && clock_.now() < end;) {
        RawStream stream(endpoint);
        bool is_open = stream.shake_hands(attack.type);
        do {
          is_open = is_open && stream.write(block);
          sent += block.size();
        } while (is_open && sent < total && clock_.now() < end);
        if (stream.was_closed()) ++effect.ended;
      }
      is_done = true;
    });
    while (!is_done) {
      work();
      clock_.sleep_until(clock_.now() + 1ms);
    }
    attacker.join();
    effect.growth_mib = peak_memory_mib(getpid()) - before;
    return effect;
  }
};

// libzmq counts whole messages in its queues; the parts of an unfinished one are not limited.
TEST_F(Swelling, AnEndlessMessageEndsItsConnection) {
  ZmqSource<ToolMotion> motions(context_, clock_, bind_to("tcp://127.0.0.1:*", "links.x"));
  ZmqSender<Interaction> interactions(context_, bind_to("tcp://127.0.0.1:*", "links.x"));
  ToolMotion motion;
  for (const std::size_t size : {0u, 30u, 1000u}) {
    const std::string part = zmtp_frame(kMoreParts, std::string(size, 'x'));
    const std::size_t mib = size == 0 ? 10 : 100;
    const std::string parts = "parts of " + std::to_string(size) + " bytes to a ";
    expect_bounded((parts + "PULL").c_str(), motions.endpoint(), {"PUSH", part, mib},
                   [&] { static_cast<void>(motions.receive(motion, at_)); });
    expect_bounded((parts + "ROUTER").c_str(), interactions.endpoint(), {"DEALER", part, mib},
                   [&] { static_cast<void>(interactions.has_subscriber()); });
  }
  EXPECT_GT(context_.refused().total(), 0u);
}

TEST_F(Swelling, SubscriptionsTakeNoMemory) {
  ZmqSender<DeviceBatch> device(context_, bind_to("tcp://127.0.0.1:*", "links.x"));
  std::string frames;
  for (int i = 0; i < 1000; ++i) {
    frames += zmtp_frame(kLastPart, "\x0b" + std::to_string(i));
    frames += zmtp_frame(kLastPart, "\1topic " + std::to_string(random_.bits()));
  }
  expect_bounded("subscriptions", device.endpoint(), {"DEALER", frames, 100, false},
                 [&] { static_cast<void>(device.has_subscriber()); });
}

// PlotJuggler needs libzmq's own subscriptions, whose topics libzmq stores.
TEST_F(Swelling, TopicsEndTheConnectionOfAPlottingTool) {
  PlotSender plot(context_, "tcp://127.0.0.1:*", "--plotjuggler");
  std::string frames;
  for (int i = 0; i < 100'000; ++i) {
    frames += zmtp_frame(kLastPart, "\1" + std::to_string(random_.bits()));
  }
  expect_bounded("topics to PlotJuggler's port", plot.endpoint(), {"SUB", frames, 100},
                 [&] { plot.send(0, {}, {}, 1.0); });
}

TEST_F(Swelling, OnlySoManySubscribersAreServed) {
  ZmqSender<DeviceBatch> device(context_, bind_to("inproc://device", "links.x"));
  std::vector<zmq::socket_t> peers;
  for (std::size_t i = 0; i <= Subscribers::kMost; ++i) {
    peers.emplace_back(context_.get(), zmq::socket_type::dealer).connect("inproc://device");
    peers.back().send(zmq::str_buffer("\x0b\5"));
  }
  ASSERT_TRUE(device.has_subscriber());
  ASSERT_TRUE(device.has_subscriber());  // the second call reads the last one
  EXPECT_EQ(device.send(random_message<DeviceBatch>(random_)), SendResult::kSent);
  zmq::message_t frame;
  for (std::size_t i = 0; i < Subscribers::kMost; ++i) {
    EXPECT_TRUE(peers[i].recv(frame, zmq::recv_flags::dontwait)) << i;
  }
  EXPECT_FALSE(peers.back().recv(frame, zmq::recv_flags::dontwait));
}

}  // namespace
}  // namespace palpate::test
