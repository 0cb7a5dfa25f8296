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
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

constexpr Duration kPatience = 5s;
constexpr LinkSettings kPublisher{
    .type = zmq::socket_type::xpub, .send_queue = 8, .receive_queue = 8};
constexpr LinkSettings kSubscriber{
    .type = zmq::socket_type::sub, .send_queue = 8, .receive_queue = 8};
constexpr RealtimeConfig kOrdinary{.priority = 0, .cpu = -1};

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
    LinkSocket server(servers, kPublisher, {bind_to("tcp://127.0.0.1:*", name)});
    std::uint64_t expected = 0;
    for (std::size_t i = 0; i < kKeyRoles; ++i) {
      const auto role = static_cast<KeyRole>(i);
      ZmqContext clients(kOrdinary, rules(pretending(role)));
      LinkSocket client(clients, kSubscriber, {connect_to(server.endpoint(), name)});
      zmq::message_t notice;
      if (role == link.client) {
        EXPECT_TRUE(eventually([&] { return server.receive(notice); })) << name;
        continue;
      }
      expected = count(servers, link.link, Refusal::kWrongRole) + 1;
      EXPECT_TRUE(eventually([&] {
        return count(servers, link.link, Refusal::kWrongRole) >= expected;
      })) << name
          << " of " << name_of(role);
      EXPECT_TRUE(eventually([&] {
        return count(clients, link.link, Refusal::kRefusedByOther) > 0;
      })) << name
          << " of " << name_of(role);
      // only the end of the subscription of the admitted role, which has disconnected
      while (server.receive(notice)) EXPECT_EQ(*notice.data<char>(), 0) << name;
    }
  }
}

TEST_F(ProtectedLinks, AServerWithAnotherKeyGetsNoClient) {
  LinkKeys impostor_keys = keys_;
  impostor_keys.own.fill(new_key_pair());
  ZmqContext impostors(kOrdinary, rules(impostor_keys));
  ZmqContext clients(kOrdinary, rules(keys_));
  LinkSocket impostor(impostors, kPublisher, {bind_to("tcp://127.0.0.1:*", "links.interaction")});
  LinkSocket client(clients, kSubscriber, {connect_to(impostor.endpoint(), "links.interaction")});

  EXPECT_TRUE(
      eventually([&] { return count(clients, "links.interaction", Refusal::kOtherUnknown) > 0; }));
  EXPECT_TRUE(eventually(
      [&] { return count(impostors, "links.interaction", Refusal::kBadHandshake) > 0; }));
  zmq::message_t notice;
  EXPECT_FALSE(impostor.receive(notice));
}

TEST_F(ProtectedLinks, AViewerConnectsToEachNodeWithItsKeyAndToIpcWithoutOne) {
  ZmqContext servers(kOrdinary, rules(keys_));
  ZmqContext clients(kOrdinary, rules(keys_));
  const test::TempFolder folder;
  const std::string ipc = "ipc://" + (folder.path() / "telemetry.ipc").string();
  LinkSocket device(servers, kPublisher, {bind_to("tcp://127.0.0.1:*", "links.device_telemetry")});
  LinkSocket mofc(servers, kPublisher, {bind_to(ipc, "links.mofc_telemetry")});
  LinkSocket physics(servers, kPublisher,
                     {bind_to("tcp://127.0.0.1:*", "links.physics_telemetry")});
  LinkSocket viewer(clients, kSubscriber,
                    {connect_to(device.endpoint(), "links.device_telemetry"),
                     connect_to(ipc, "links.mofc_telemetry"),
                     connect_to(physics.endpoint(), "links.physics_telemetry")});
  zmq::message_t notice;
  for (LinkSocket* server : {&device, &mofc, &physics}) {
    EXPECT_TRUE(eventually([&] { return server->receive(notice); })) << server->endpoint();
  }
  EXPECT_EQ(clients.refused().total(), 0u);
  EXPECT_EQ(servers.refused().total(), 0u);
}

TEST_F(ProtectedLinks, AProgramWithoutTheKeyOfALinkReportsIt) {
  LinkKeys keys = keys_;
  keys.own = {};
  ZmqContext context(kOrdinary, rules(keys));
  const std::string error = setup_error([&] {
    LinkSocket socket(context, kSubscriber, {bind_to("tcp://127.0.0.1:*", "links.tool_motion")});
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
          setup_error([&] { LinkSocket socket(context, kSubscriber, {attachment}); });
      EXPECT_THAT(error, HasSubstr("plain text")) << elsewhere;
      EXPECT_THAT(error, HasSubstr("palpate keygen DIR")) << elsewhere;
    }
  }
  for (const auto& here : {bind_to("tcp://127.0.0.1:*", "links.tool_motion"),
                           bind_to("tcp://127.1.2.3:*", "links.tool_motion"),
                           connect_to("tcp://localhost:5551", "links.tool_motion"),
                           connect_to("tcp://[::1]:5551", "links.tool_motion")}) {
    EXPECT_EQ(setup_error([&] { LinkSocket socket(context, kSubscriber, {here}); }), "")
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
    LinkSocket server(servers, kPublisher, {bind_to(endpoint, "links.interaction")});
    LinkSocket unknown_peer(unknown_peers, kSubscriber,
                            {connect_to(server.endpoint(), "links.interaction")});
    ++expected;
    EXPECT_TRUE(eventually(
        [&] { return count(servers, "links.interaction", Refusal::kUnknownKey) >= expected; }));
    expected = count(servers, "links.interaction", Refusal::kUnknownKey);
    zmq::message_t notice;
    EXPECT_FALSE(server.receive(notice));
  }
}

TEST_F(ProtectedLinks, MonitorsOfClosedSocketsAreRemoved) {
  ZmqContext context(kOrdinary, rules(keys_));
  LinkSocket kept(context, kPublisher, {bind_to("tcp://127.0.0.1:*", "links.interaction")});
  for (int i = 0; i < 3; ++i) {
    LinkSocket closed(context, kPublisher, {bind_to("tcp://127.0.0.1:*", "links.interaction")});
    EXPECT_GE(context.zap().monitors(), 2);
  }

  EXPECT_TRUE(eventually([&] { return context.zap().monitors() == 1; }));
}

}  // namespace
}  // namespace palpate
