// SPDX-License-Identifier: Apache-2.0
// Where DDS of a node listens.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <string>

#include "common/core/check.h"
#include "deploy/ros/dds/loopback.h"
#include "deploy/ros/dds/node.h"

namespace palpate::ros {
namespace {

/// The interface to which a socket is bound; empty: any.
std::string interface_of(int descriptor) {
  std::array<char, IFNAMSIZ> name{};
  socklen_t size = name.size();
  EXPECT_EQ(getsockopt(descriptor, SOL_SOCKET, SO_BINDTODEVICE, name.data(), &size), 0);
  return name.data();
}

TEST(RosNode, ListensOnLoopbackAlone) {
  const std::uint32_t domain = 200 + static_cast<std::uint32_t>(getpid()) % 30;
  EXPECT_TRUE(open_sockets(domain).empty());

  const Node node({.domain = domain});

  EXPECT_FALSE(open_sockets(domain).empty());
  for (const int descriptor : open_sockets(domain)) EXPECT_EQ(interface_of(descriptor), "lo");
}

TEST(RosNetwork, RefusesWhatIsNoAddressAndNoDomain) {
  EXPECT_THROW(static_cast<void>(configuration_of({.domain = 233})), SetupError);
  for (const char* interface : {"", "a\"/>", "lo <"}) {
    EXPECT_THROW(static_cast<void>(configuration_of({.interface = interface})), SetupError)
        << interface;
    EXPECT_THROW(static_cast<void>(configuration_of({.peers = {interface}})), SetupError);
  }
}

/// Empty: it is accepted.
std::string refusal_of(const Network& network) {
  try {
    static_cast<void>(configuration_of(network));
  } catch (const SetupError& error) {
    return error.what();
  }
  return "";
}

TEST(RosNetwork, RefusesAPeerThatItDoesNotReach) {
  EXPECT_THAT(refusal_of({.peers = {"192.0.2.7"}}),
              testing::HasSubstr("nothing leaves this machine"));
  EXPECT_EQ(refusal_of({.peers = {"127.0.0.2"}}), "");
  EXPECT_THAT(refusal_of({.interface = "192.0.2.1", .peers = {"no.such.machine.invalid"}}),
              testing::HasSubstr("no machine of that name"));
  EXPECT_EQ(refusal_of({.interface = "192.0.2.1", .peers = {"192.0.2.7"}}), "");
}

}  // namespace
}  // namespace palpate::ros
