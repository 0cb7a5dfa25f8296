// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/transport/can_port.h"

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "device_node/drivers/transport/wait_for.h"

namespace palpate::device {
namespace {

/// More than a bus of eight motors has under way.
constexpr int kMostDiscarded = 256;

/// As std::runtime_error; closes the socket.
[[noreturn]] void refuse(int socket, const std::string& name, const std::string& why) {
  if (socket >= 0) ::close(socket);
  throw std::runtime_error("CAN interface " + name + ": " + why);
}

int open_interface(const std::string& name, bool is_fd) {
  const int socket = ::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW);
  if (socket < 0) {
    refuse(socket, name,
           std::string("this kernel has no SocketCAN (") + std::strerror(errno) +
               "); load the modules can and can_raw");
  }
  ifreq request{};
  if (name.empty() || name.size() >= sizeof(request.ifr_name)) refuse(socket, name, "no name");
  name.copy(static_cast<char*>(request.ifr_name), name.size());
  if (::ioctl(socket, SIOCGIFINDEX, &request) != 0) {
    refuse(socket, name, std::string(std::strerror(errno)) + "; ip link shows which there are");
  }
  const int index = request.ifr_ifindex;
  if (::ioctl(socket, SIOCGIFFLAGS, &request) != 0 || (request.ifr_flags & IFF_UP) == 0) {
    refuse(socket, name, "is down; ip link set " + name + " up");
  }
  if (is_fd) {
    const int on = 1;
    if (::ioctl(socket, SIOCGIFMTU, &request) != 0 || request.ifr_mtu != CANFD_MTU ||
        ::setsockopt(socket, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof(on)) != 0) {
      refuse(socket, name,
             "is not one for FD; ip link set " + name +
                 " type can bitrate 1000000 dbitrate 5000000 fd on, or leave FD out");
    }
  }
  const can_err_mask_t errors = CAN_ERR_BUSOFF;
  ::setsockopt(socket, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof(errors));
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = index;
  if (::bind(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    refuse(socket, name, std::strerror(errno));
  }
  return socket;
}

}  // namespace

CanBytes to_bytes(const CanFrame& frame) noexcept {
  CanBytes out;
  if (frame.is_fd) {
    canfd_frame raw{};
    raw.can_id = frame.id;
    raw.len = frame.size;
    raw.flags = CANFD_BRS;
    std::memcpy(raw.data, frame.data.data(), std::min<std::size_t>(frame.size, sizeof(raw.data)));
    std::memcpy(out.bytes.data(), &raw, sizeof(raw));
    out.size = sizeof(raw);
  } else {
    can_frame raw{};
    raw.can_id = frame.id;
    raw.can_dlc = frame.size;
    std::memcpy(raw.data, frame.data.data(), std::min<std::size_t>(frame.size, sizeof(raw.data)));
    std::memcpy(out.bytes.data(), &raw, sizeof(raw));
    out.size = sizeof(raw);
  }
  return out;
}

CanKind read_can(std::span<const std::byte> bytes, CanFrame& frame) noexcept {
  if (bytes.size() != CAN_MTU && bytes.size() != CANFD_MTU) return CanKind::kCorrupt;
  // both begin with the identifier and the length, and have their data from the same place on
  canfd_frame raw{};
  std::memcpy(&raw, bytes.data(), bytes.size());
  const bool is_fd = bytes.size() == CANFD_MTU;
  if (raw.len > (is_fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN)) return CanKind::kCorrupt;
  if ((raw.can_id & CAN_ERR_FLAG) != 0) {
    return (raw.can_id & CAN_ERR_BUSOFF) != 0 ? CanKind::kBusOff : CanKind::kOther;
  }
  if ((raw.can_id & (CAN_EFF_FLAG | CAN_RTR_FLAG)) != 0) return CanKind::kOther;
  frame = {.id = raw.can_id & CAN_SFF_MASK, .is_fd = is_fd, .size = raw.len};
  std::memcpy(frame.data.data(), raw.data, raw.len);
  return CanKind::kData;
}

CanPort::CanPort(const std::string& name, bool is_fd)
    : port_([&] {
        if (name.find('/') == std::string::npos) return PacketPort(open_interface(name, is_fd));
        return PacketPort(name);
      }()) {}

Transfer CanPort::send(const CanFrame& frame, Duration within) noexcept {
  const CanBytes out = to_bytes(frame);
  const Transfer transfer = port_.write(std::span(out.bytes).first(out.size), within);
  return transfer == Transfer::kTimeout ? Transfer::kFull : transfer;
}

Transfer CanPort::receive(CanFrame& frame, Duration within) noexcept {
  const WireClock::time_point deadline = wire_deadline(within);
  std::array<std::byte, sizeof(canfd_frame) + 1> bytes{};
  for (;;) {
    const Duration left = std::chrono::duration_cast<Duration>(deadline - WireClock::now());
    std::size_t size = 0;
    const Transfer transfer = port_.read(bytes, size, std::max(left, Duration::zero()));
    if (transfer != Transfer::kDone) return transfer;
    switch (read_can(std::span(bytes).first(size), frame)) {
      case CanKind::kData:
        return Transfer::kDone;
      case CanKind::kBusOff:
        return Transfer::kDown;
      case CanKind::kCorrupt:
        return Transfer::kCorrupt;
      case CanKind::kOther:
        if (WireClock::now() >= deadline) return Transfer::kTimeout;
    }
  }
}

void CanPort::discard() noexcept {
  std::array<std::byte, sizeof(canfd_frame)> passed{};
  std::size_t size = 0;
  for (int i = 0; i < kMostDiscarded; ++i) {
    if (port_.read(passed, size, Duration::zero()) != Transfer::kDone) return;
  }
}

}  // namespace palpate::device
