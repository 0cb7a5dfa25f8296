// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/device_claim.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <functional>
#include <string>
#include <system_error>
#include <type_traits>
#include <variant>

#include "common/core/check.h"

namespace palpate::device {
namespace {

constexpr const char* kPrefix = "palpate-device-";

/// A device file by whichever of its names.
std::string real_path(const std::string& port) {
  std::error_code error;
  const auto path = std::filesystem::weakly_canonical(port, error);
  return error || port.empty() ? port : path.string();
}

}  // namespace

std::string place_of(const DriverConfig& driver) {
  return std::visit(
      [](const auto& config) -> std::string {
        using Config = std::decay_t<decltype(config)>;
        if constexpr (std::is_same_v<Config, std::monostate> ||
                      std::is_same_v<Config, PluginConfig>) {
          return "";
        } else if constexpr (std::is_same_v<Config, HaplyConfig>) {
          return "haply " + config.host + ":" + std::to_string(config.port) + " " +
                 config.device_id;
        } else if constexpr (std::is_same_v<Config, HapiConfig>) {
          return "hapi " + real_path(config.port);
        } else if constexpr (std::is_same_v<Config, FalconConfig>) {
          return "falcon " + real_path(config.port);
        } else {
          return "wooden " + real_path(config.port);
        }
      },
      driver);
}

DeviceClaim::DeviceClaim(const std::string& place)
    : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  // the first byte is 0: a name of the kernel, not of a file
  std::string name = kPrefix + place;
  if (name.size() + 1 > sizeof(address.sun_path)) {
    name = kPrefix + std::to_string(std::hash<std::string>{}(place));
  }
  std::memcpy(address.sun_path + 1, name.data(), name.size());
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  if (socket_ >= 0 && ::bind(socket_, reinterpret_cast<const sockaddr*>(&address), size) == 0) {
    return;
  }
  const int error = errno;
  if (socket_ >= 0) ::close(socket_);
  throw SetupError("device \"" + place + "\": " +
                   (error == EADDRINUSE
                        ? "another process drives it, and two forces would add up in the hand; "
                          "stop that one, or name another device"
                        : std::string("cannot be claimed: ") + std::strerror(error)));
}

DeviceClaim::~DeviceClaim() { ::close(socket_); }

}  // namespace palpate::device
