// SPDX-License-Identifier: Apache-2.0
// Links with keys over tcp on loopback: which role may use which link, and which peers are counted
// as refused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <memory>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/link/socket/link_socket.h"
#include "common/link/subscription.h"
#include "tests/support/machine/machine.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

const Duration kPatience = test::patience(5s);
constexpr RealtimeConfig kOrdinary{.priority = 0, .cpu = -1};

/// The connecting end of a link.
struct Client {
  Client(ZmqContext& context, const Attachment& attachment)
      : socket(context, kTelemetryReceiver, attachment) {}
  LinkSocket socket;
  Subscription subscription{socket};
};

/// Whether the client's subscription has arrived.
bool hears(LinkSocket& server, Client& client) {
  client.subscription.send_if_due();
  zmq::message_t from;
  zmq::message_t frame;
  return server.receive(frame, &from) == Reception::kMessage;
}

class ProtectedLinks : public testing::Test {
 protected:
  ProtectedLinks() {
    std::string list;
    for (std::size_t i = 0; i < kKeyRoles; ++i) {
      keys_.own[i] = new_key_pair();
      list += std::string(name_of(static_cast<KeyRole>(i))) + " " + keys_.own[i]->public_key + "\n";
    }
    keys_.allowed = parse_allowed_keys(list, "test");
  }

  [[nodiscard]] static TcpRules rules(const LinkKeys& keys) {
    return {.keys = std::make_shared<const LinkKeys>(keys)};
  }
  /// The keys of a program that has the key of `role` only and uses it for every role.
  [[nodiscard]] LinkKeys pretending(KeyRole role) const {
    LinkKeys keys = keys_;
    keys.own.fill(keys_.of(role));
    return keys;
  }
  [[nodiscard]] bool eventually(const std::function<bool()>& event) {
    const TimePoint deadline = clock_.now() + kPatience;
    while (!event()) {
      if (clock_.now() > deadline) return false;
      clock_.sleep_until(clock_.now() + 1ms);
    }
    return true;
  }
  [[nodiscard]] static std::uint64_t count(const ZmqContext& context, std::string_view link,
                                           Refusal refusal) {
    const auto counts = context.refused().counts();
    const auto found = counts.find({link, refusal});
    return found == counts.end() ? 0 : found->second.count;
  }
  static std::string setup_error(const std::function<void()>& action) {
    try {
      action();
    } catch (const SetupError& error) {
      return error.what();
    }
    return "";
  }

  SteadyClock clock_;
  LinkKeys keys_;
};

TEST_F(ProtectedLinks, EachLinkAdmitsOnlyItsOwnRole) {
  ZmqContext servers(kOrdinary, rules(keys_));
  for (const LinkRoles& link : kLinkRoles) {
    const std::string name(link.link);
    LinkSocket server(servers, kTelemetrySender, bind_to("tcp://127.0.0.1:*", name));
    for (std::size_t i = 0; i < kKeyRoles; ++i) {
      const auto role = static_cast<KeyRole>(i);
      const std::uint64_t expected = count(servers, link.link, Refusal::kWrongRole) + 1;
      ZmqContext clients(kOrdinary, rules(pretending(role)));
      Client client(clients, connect_to(server.endpoint(), name));
      if (role == link.client) {
        EXPECT_TRUE(eventually([&] { return hears(server, client); })) << name;
        continue;
      }
      EXPECT_TRUE(eventually([&] {
        return count(servers, link.link, Refusal::kWrongRole) >= expected;
      })) << name
          << " of " << name_of(role);
      EXPECT_TRUE(eventually([&] {
        return count(clients, link.link, Refusal::kRefusedByOther) > 0;
      })) << name
          << " of " << name_of(role);
      EXPECT_EQ(client.socket.established(), 0u) << name;
    }
  }
}

TEST_F(ProtectedLinks, AServerWithAnotherKeyGetsNoClient) {
  LinkKeys impostor_keys = keys_;
  impostor_keys.own.fill(new_key_pair());
  ZmqContext impostors(kOrdinary, rules(impostor_keys));
  ZmqContext clients(kOrdinary, rules(keys_));
  LinkSocket impostor(impostors, kTelemetrySender,
                      bind_to("tcp://127.0.0.1:*", "links.interaction"));
  Client client(clients, connect_to(impostor.endpoint(), "links.interaction"));

  EXPECT_TRUE(
      eventually([&] { return count(clients, "links.interaction", Refusal::kOtherUnknown) > 0; }));
  EXPECT_TRUE(eventually(
      [&] { return count(impostors, "links.interaction", Refusal::kBadHandshake) > 0; }));
  EXPECT_FALSE(hears(impostor, client));
}

TEST_F(ProtectedLinks, AViewerConnectsToEachNodeWithItsKeyAndToIpcWithoutOne) {
  ZmqContext servers(kOrdinary, rules(keys_));
  ZmqContext clients(kOrdinary, rules(keys_));
  const test::TempFolder folder;
  const std::string ipc = "ipc://" + (folder.path() / "telemetry.ipc").string();
  LinkSocket device(servers, kTelemetrySender,
                    bind_to("tcp://127.0.0.1:*", "links.device_telemetry"));
  LinkSocket mofc(servers, kTelemetrySender, bind_to(ipc, "links.mofc_telemetry"));
  LinkSocket physics(servers, kTelemetrySender,
                     bind_to("tcp://127.0.0.1:*", "links.physics_telemetry"));
  Client of_device(clients, connect_to(device.endpoint(), "links.device_telemetry"));
  Client of_mofc(clients, connect_to(ipc, "links.mofc_telemetry"));
  Client of_physics(clients, connect_to(physics.endpoint(), "links.physics_telemetry"));
  EXPECT_TRUE(eventually([&] { return hears(device, of_device); }));
  EXPECT_TRUE(eventually([&] { return hears(mofc, of_mofc); }));
  EXPECT_TRUE(eventually([&] { return hears(physics, of_physics); }));
  EXPECT_EQ(clients.refused().total(), 0u);
  EXPECT_EQ(servers.refused().total(), 0u);
}

TEST_F(ProtectedLinks, AProgramWithoutTheKeyOfALinkReportsIt) {
  LinkKeys keys = keys_;
  keys.own = {};
  ZmqContext context(kOrdinary, rules(keys));
  const std::string error = setup_error([&] {
    LinkSocket socket(context, kOneWayReceiver, bind_to("tcp://127.0.0.1:*", "links.tool_motion"));
  });
  EXPECT_THAT(error, HasSubstr("no key of physics"));
}

TEST_F(ProtectedLinks, WithoutKeysOnlyLoopbackIsUsed) {
  ZmqContext context;
  for (const char* elsewhere :
       {"tcp://0.0.0.0:5551", "tcp://192.0.2.1:5551", "tcp://[::]:5551", "tcp://*:5551",
        "tcp://localhost.example.org:5551", "tcp://127.0.0.1.example.org:5551", "tcp://eth0:5551",
        "tcp://127.0.0.1:1;192.0.2.1:5551"}) {
    for (const auto& attachment :
         {bind_to(elsewhere, "links.tool_motion"), connect_to(elsewhere, "links.tool_motion")}) {
      const std::string error =
          setup_error([&] { LinkSocket socket(context, kOneWayReceiver, attachment); });
      EXPECT_THAT(error, HasSubstr("plain text")) << elsewhere;
      EXPECT_THAT(error, HasSubstr("palpate keygen DIR")) << elsewhere;
    }
  }
  for (const auto& here : {bind_to("tcp://127.0.0.1:*", "links.tool_motion"),
                           bind_to("tcp://127.1.2.3:*", "links.tool_motion"),
                           connect_to("tcp://localhost:5551", "links.tool_motion"),
                           connect_to("tcp://[::1]:5551", "links.tool_motion")}) {
    EXPECT_EQ(setup_error([&] { LinkSocket socket(context, kOneWayReceiver, here); }), "")
        << here.endpoint;
  }
}

TEST_F(ProtectedLinks, SocketsOpenAndCloseWhileUnknownPeersConnect) {
  LinkKeys unknown_keys = keys_;
  unknown_keys.own.fill(new_key_pair());
  ZmqContext unknown_peers(kOrdinary, rules(unknown_keys));
  ZmqContext servers(kOrdinary, rules(keys_));
  std::string endpoint = "tcp://127.0.0.1:*";
  std::uint64_t expected = 0;
  for (int i = 0; i < 5; ++i) {
    LinkSocket server(servers, kTelemetrySender, bind_to(endpoint, "links.interaction"));
    Client unknown_peer(unknown_peers, connect_to(server.endpoint(), "links.interaction"));
    ++expected;
    EXPECT_TRUE(eventually(
        [&] { return count(servers, "links.interaction", Refusal::kUnknownKey) >= expected; }));
    expected = count(servers, "links.interaction", Refusal::kUnknownKey);
    EXPECT_FALSE(hears(server, unknown_peer));
  }
}

TEST_F(ProtectedLinks, ClosedSocketsAreNoLongerMonitored) {
  ZmqContext context(kOrdinary, rules(keys_));
  LinkSocket kept(context, kTelemetrySender, bind_to("tcp://127.0.0.1:*", "links.interaction"));
  for (int i = 0; i < 3; ++i) {
    LinkSocket closed(context, kTelemetrySender, bind_to("tcp://127.0.0.1:*", "links.interaction"));
    EXPECT_GE(context.monitor().sockets(), 2);
  }

  EXPECT_TRUE(eventually([&] { return context.monitor().sockets() == 1; }));
}

}  // namespace
}  // namespace palpate
