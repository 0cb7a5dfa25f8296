// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/transport/serial_port.h"

#include <fcntl.h>
#include <linux/serial.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <array>
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

struct Speed {
  unsigned bits_per_second;
  speed_t code;
};
constexpr std::array<Speed, 12> kSpeeds{{{9'600, B9600},
                                         {57'600, B57600},
                                         {115'200, B115200},
                                         {230'400, B230400},
                                         {460'800, B460800},
                                         {500'000, B500000},
                                         {921'600, B921600},
                                         {1'000'000, B1000000},
                                         {2'000'000, B2000000},
                                         {3'000'000, B3000000},
                                         {3'500'000, B3500000},
                                         {4'000'000, B4000000}}};

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

void SerialPort::set_speed(unsigned bits_per_second) {
  const auto* known = std::find_if(kSpeeds.begin(), kSpeeds.end(), [&](const Speed& speed) {
    return speed.bits_per_second == bits_per_second;
  });
  if (known == kSpeeds.end()) {
    std::string text =
        std::to_string(bits_per_second) + " bit/s is no speed of a serial line; give";
    for (const Speed& speed : kSpeeds) text += " " + std::to_string(speed.bits_per_second);
    throw std::runtime_error(text);
  }
  termios settings{};
  bool is_set = tcgetattr(terminal_, &settings) == 0 && cfsetspeed(&settings, known->code) == 0 &&
                tcsetattr(terminal_, TCSANOW, &settings) == 0;
  is_set = is_set && tcgetattr(terminal_, &settings) == 0 && cfgetospeed(&settings) == known->code;
  if (!is_set) {
    throw std::runtime_error("the serial line refuses " + std::to_string(bits_per_second) +
                             " bit/s: its adapter does not have that speed");
  }
  // FTDI adapters keep what they receive for 16 ms otherwise; others do not know it
  serial_struct adapter{};
  if (ioctl(terminal_, TIOCGSERIAL, &adapter) == 0) {
    adapter.flags = static_cast<int>(static_cast<unsigned>(adapter.flags) | ASYNC_LOW_LATENCY);
    static_cast<void>(ioctl(terminal_, TIOCSSERIAL, &adapter));
  }
}

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
