// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/transport/packet_port.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <stdexcept>

#include "device_node/drivers/transport/wait_for.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

int open_packet_file(const std::string& path) {
  if (!is_emulated(path)) return ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof(address.sun_path)) {
    errno = ENAMETOOLONG;
    return -1;
  }
  path.copy(static_cast<char*>(address.sun_path), path.size());
  const int socket = ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (socket < 0) return -1;
  if (::connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) {
    return socket;
  }
  const int error = errno;
  ::close(socket);
  errno = error;
  return -1;
}

/// Of an error that lasts.
Transfer transfer_of(int error) { return error == ENETDOWN ? Transfer::kDown : Transfer::kClosed; }

bool is_momentary(int error) { return error == EAGAIN || error == EWOULDBLOCK || error == EINTR; }

}  // namespace

std::string to_text(const UsbIds& ids) {
  std::string text;
  for (const unsigned id : {unsigned{ids.vendor}, unsigned{ids.product}}) {
    if (!text.empty()) text += ':';
    for (const unsigned shift : {12U, 8U, 4U, 0U}) {
      text += "0123456789abcdef"[(id >> shift) & 15U];
    }
  }
  return text;
}

bool is_emulated(const std::string& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 && S_ISSOCK(status.st_mode);
}

PacketPort::PacketPort(const std::string& path) : file_(open_packet_file(path)) {
  if (file_ < 0) throw std::runtime_error(path + ": " + std::strerror(errno));
}

PacketPort::PacketPort(int file) : file_(file) {
  if (file_ >= 0) fcntl(file_, F_SETFL, fcntl(file_, F_GETFL) | O_NONBLOCK);
}

PacketPort::~PacketPort() {
  if (file_ >= 0) ::close(file_);
}

Transfer PacketPort::write(std::span<const std::byte> packet, Duration within) noexcept {
  const WireClock::time_point deadline = wire_deadline(within);
  for (;;) {
    // a closed socket is an error here, no signal
    ssize_t written = ::send(file_, packet.data(), packet.size(), MSG_NOSIGNAL);
    if (written < 0 && errno == ENOTSOCK) written = ::write(file_, packet.data(), packet.size());
    if (written == static_cast<ssize_t>(packet.size())) return Transfer::kDone;
    if (written >= 0) return Transfer::kCorrupt;
    if (errno == ENOBUFS) {  // the queue of an interface; poll() does not wait for it
      if (WireClock::now() >= deadline) return Transfer::kFull;
      constexpr timespec kWait{.tv_sec = 0, .tv_nsec = 100'000};
      ::nanosleep(&kWait, nullptr);
      continue;
    }
    if (!is_momentary(errno)) return transfer_of(errno);
    const Transfer ready = wait_for(file_, POLLOUT, deadline);
    if (ready != Transfer::kDone) return ready;
  }
}

Transfer PacketPort::read(std::span<std::byte> buffer, std::size_t& size,
                          Duration within) noexcept {
  const WireClock::time_point deadline = wire_deadline(within);
  for (;;) {
    const ssize_t got = ::read(file_, buffer.data(), buffer.size());
    if (got > 0) {
      size = static_cast<std::size_t>(got);
      return Transfer::kDone;
    }
    if (got == 0) return Transfer::kClosed;
    if (!is_momentary(errno)) return transfer_of(errno);
    const Transfer ready = wait_for(file_, POLLIN, deadline);
    if (ready != Transfer::kDone) return ready;
  }
}

bool PacketPort::has_input() const noexcept {
  pollfd entry{.fd = file_, .events = POLLIN, .revents = 0};
  return ::poll(&entry, 1, 0) > 0 && (entry.revents & POLLIN) != 0;
}

void PacketPort::discard_input() noexcept {
  std::array<std::byte, 64> passed{};
  while (::read(file_, passed.data(), passed.size()) > 0) {
  }
}

UsbIds PacketPort::emulated_ids(Duration within) {
  std::array<std::byte, 4> packet{};
  std::size_t size = 0;
  if (read(packet, size, within) != Transfer::kDone || size != packet.size()) {
    throw std::runtime_error("the emulator does not say what it is: its device is unplugged");
  }
  const auto number = [&](std::size_t at) {
    return static_cast<std::uint16_t>(std::to_integer<unsigned>(packet[at]) |
                                      (std::to_integer<unsigned>(packet[at + 1]) << 8U));
  };
  return {.vendor = number(0), .product = number(2)};
}

Transfer PacketPort::send_ids(const UsbIds& ids) noexcept {
  const auto byte = [](unsigned value) { return static_cast<std::byte>(value & 0xFFU); };
  const std::array<std::byte, 4> packet{byte(ids.vendor), byte(ids.vendor >> 8U), byte(ids.product),
                                        byte(ids.product >> 8U)};
  return write(packet, 1s);
}

}  // namespace palpate::device
