// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/dds/loopback.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <system_error>

namespace palpate::ros {
namespace {

// The ports of RTPS 2.2, §9.6.1.1.
constexpr std::uint32_t kFirstPort = 7400;
constexpr std::uint32_t kPortsOfADomain = 250;

std::string name_of_loopback() {
  std::string name;
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return name;
  for (const ifaddrs* each = all; each != nullptr && name.empty(); each = each->ifa_next) {
    if ((each->ifa_flags & static_cast<unsigned>(IFF_LOOPBACK)) != 0) name = each->ifa_name;
  }
  freeifaddrs(all);
  return name;
}

bool is_open_at(int descriptor, std::uint32_t first_port) {
  int type = 0;
  socklen_t size = sizeof type;
  if (getsockopt(descriptor, SOL_SOCKET, SO_TYPE, &type, &size) != 0 || type != SOCK_DGRAM) {
    return false;
  }
  sockaddr_in address{};
  size = sizeof address;
  if (getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size) != 0 ||
      address.sin_family != AF_INET || address.sin_addr.s_addr != htonl(INADDR_ANY)) {
    return false;
  }
  const std::uint32_t port = ntohs(address.sin_port);
  return port >= first_port && port < first_port + kPortsOfADomain;
}

}  // namespace

std::vector<int> open_sockets(std::uint32_t domain) {
  std::vector<int> sockets;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    const std::string name = entry.path().filename();
    int descriptor = -1;
    const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), descriptor);
    if (error == std::errc{} && is_open_at(descriptor, kFirstPort + kPortsOfADomain * domain)) {
      sockets.push_back(descriptor);
    }
  }
  return sockets;
}

std::string confine_to_loopback(std::uint32_t domain) {
  const std::string name = name_of_loopback();
  const std::vector<int> sockets = open_sockets(domain);
  if (name.empty() || sockets.empty()) return "its sockets are not found";
  for (const int descriptor : sockets) {
    if (setsockopt(descriptor, SOL_SOCKET, SO_BINDTODEVICE, name.c_str(),
                   static_cast<socklen_t>(name.size() + 1)) != 0) {
      return std::generic_category().message(errno);
    }
  }
  return {};
}

}  // namespace palpate::ros
