// SPDX-License-Identifier: Apache-2.0
// Where DDS of a node listens.
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

}  // namespace
}  // namespace palpate::ros
