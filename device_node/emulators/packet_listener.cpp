// SPDX-License-Identifier: Apache-2.0
#include "device_node/emulators/packet_listener.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "common/core/check.h"

namespace palpate::device {
namespace {

namespace fs = std::filesystem;

std::string new_name(const std::string& field) {
  return "; give the emulator a new name with " +
         (field.starts_with("--") ? field + " " : "--set " + field + "=") + "/tmp/NAME";
}

}  // namespace

PacketListener::PacketListener(const std::string& path, const std::string& field)
    : path_(path), listener_(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
  const auto refuse = [&](const std::string& why) {
    if (listener_ >= 0) ::close(listener_);
    throw SetupError(field + ": \"" + path + "\": " + why + new_name(field));
  };
  if (listener_ < 0) refuse(std::strerror(errno));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty()) refuse("an emulator needs a file of its own");
  if (path.size() >= sizeof(address.sun_path)) refuse("too long for a socket");
  path.copy(static_cast<char*>(address.sun_path), path.size());
  const auto* const generic = reinterpret_cast<const sockaddr*>(&address);
  if (::connect(listener_, generic, sizeof(address)) == 0) refuse("another emulator listens there");
  std::error_code passed;
  // left by an emulator that was killed
  if (is_emulated(path)) fs::remove(path, passed);
  if (fs::exists(fs::symlink_status(path, passed))) refuse("exists, and no emulator made it");
  if (::bind(listener_, generic, sizeof(address)) != 0 || ::listen(listener_, 4) != 0) {
    refuse(std::strerror(errno));
  }
}

PacketListener::~PacketListener() {
  ::close(listener_);
  std::error_code passed;
  fs::remove(path_, passed);
}

int PacketListener::accept() const noexcept {
  pollfd entry{.fd = listener_, .events = POLLIN, .revents = 0};
  if (::poll(&entry, 1, 50) <= 0) return -1;
  return ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
}

}  // namespace palpate::device
