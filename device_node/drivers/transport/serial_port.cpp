// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/transport/serial_port.h"

#include <fcntl.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "device_node/drivers/transport/wait_for.h"

namespace palpate::device {
namespace {

void make_raw(int terminal) {
  termios settings{};
  if (tcgetattr(terminal, &settings) != 0) return;
  cfmakeraw(&settings);
  cfsetspeed(&settings, B115200);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cc[VMIN] = 0;
  settings.c_cc[VTIME] = 0;
  tcsetattr(terminal, TCSANOW, &settings);
}

/// Moves all bytes with `move(from, size)`, which returns what it moved.
template <class Move>
Transfer transfer_all(int terminal, short events, std::size_t size, Duration within,
                      const Move& move) noexcept {
  const WireClock::time_point deadline = wire_deadline(within);
  bool is_ready = false;
  for (std::size_t done = 0; done < size;) {
    const ssize_t moved = move(done, size - done);
    if (moved > 0) {
      done += static_cast<std::size_t>(moved);
      is_ready = false;
      continue;
    }
    if (moved < 0 && errno == EINTR) continue;
    // a terminal that hung up is always ready to be read, and has nothing
    if (moved == 0 && is_ready) return Transfer::kClosed;
    if (moved < 0 && errno != EAGAIN && errno != EWOULDBLOCK) return Transfer::kClosed;
    const Transfer ready = wait_for(terminal, events, deadline);
    if (ready != Transfer::kDone) return ready;
    is_ready = true;
  }
  return Transfer::kDone;
}

}  // namespace

SerialPort::SerialPort(const std::string& path)
    : SerialPort(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC)) {
  if (terminal_ < 0) throw std::runtime_error(path + ": " + std::strerror(errno));
  if (isatty(terminal_) == 0) {
    ::close(terminal_);
    throw std::runtime_error(path + " is no serial port");
  }
  ioctl(terminal_, TIOCEXCL);
}

SerialPort::SerialPort(int terminal) : terminal_(terminal) {
  if (terminal_ < 0) return;
  make_raw(terminal_);
  fcntl(terminal_, F_SETFL, fcntl(terminal_, F_GETFL) | O_NONBLOCK);
}

SerialPort::~SerialPort() { ::close(terminal_); }

Transfer SerialPort::write(std::span<const std::byte> bytes, Duration within) noexcept {
  return transfer_all(terminal_, POLLOUT, bytes.size(), within,
                      [&](std::size_t from, std::size_t size) {
                        return ::write(terminal_, bytes.data() + from, size);
                      });
}

Transfer SerialPort::read(std::span<std::byte> bytes, Duration within) noexcept {
  return transfer_all(terminal_, POLLIN, bytes.size(), within,
                      [&](std::size_t from, std::size_t size) {
                        return ::read(terminal_, bytes.data() + from, size);
                      });
}

bool SerialPort::has_input() const noexcept {
  int bytes = 0;
  return ioctl(terminal_, FIONREAD, &bytes) == 0 && bytes > 0;
}

void SerialPort::discard_input() noexcept { tcflush(terminal_, TCIFLUSH); }

}  // namespace palpate::device
