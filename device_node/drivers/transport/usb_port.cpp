// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/transport/usb_port.h"

#include <fcntl.h>
#include <linux/usbdevice_fs.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <vector>

#include "device_node/drivers/transport/wait_for.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;
namespace fs = std::filesystem;

constexpr unsigned kBulkOut = 0x02;
constexpr unsigned kBulkIn = 0x81;
constexpr std::uint8_t kVendorRequestOut = 0x40;

unsigned at_least_one_ms(Duration within) noexcept {
  const auto ms = std::chrono::ceil<std::chrono::milliseconds>(within).count();
  return static_cast<unsigned>(std::max<decltype(ms)>(ms, 1));
}

Transfer usb_failure() noexcept {
  return errno == ETIMEDOUT ? Transfer::kTimeout : Transfer::kClosed;
}

/// A device that the kernel lists.
class KernelUsbPort final : public UsbPort {
 public:
  KernelUsbPort(const std::string& path, const UsbIds& ids)
      : file_(::open(path.c_str(), O_RDWR | O_CLOEXEC)) {
    if (file_ < 0) throw std::runtime_error(path + ": " + std::strerror(errno));
    try {
      claim(path, ids);
    } catch (...) {
      ::close(file_);
      throw;
    }
  }
  ~KernelUsbPort() override {
    unsigned interface = 0;
    ::ioctl(file_, USBDEVFS_RELEASEINTERFACE, &interface);
    ::close(file_);
  }
  KernelUsbPort(const KernelUsbPort&) = delete;
  KernelUsbPort& operator=(const KernelUsbPort&) = delete;

  [[nodiscard]] Transfer control(std::uint8_t request, std::uint16_t value,
                                 Duration within) noexcept override {
    usbdevfs_ctrltransfer transfer{.bRequestType = kVendorRequestOut,
                                   .bRequest = request,
                                   .wValue = value,
                                   .wIndex = 0,
                                   .wLength = 0,
                                   .timeout = at_least_one_ms(within),
                                   .data = nullptr};
    return ::ioctl(file_, USBDEVFS_CONTROL, &transfer) < 0 ? usb_failure() : Transfer::kDone;
  }

  [[nodiscard]] Transfer write(std::span<const std::byte> bytes,
                               Duration within) noexcept override {
    // the kernel only reads them
    auto* const data = const_cast<std::byte*>(bytes.data());
    std::size_t size = 0;
    const Transfer outcome = bulk(kBulkOut, {data, bytes.size()}, size, within);
    return outcome == Transfer::kDone && size != bytes.size() ? Transfer::kTimeout : outcome;
  }

  [[nodiscard]] Transfer read(std::span<std::byte> buffer, std::size_t& size,
                              Duration within) noexcept override {
    return bulk(kBulkIn, buffer, size, within);
  }

 private:
  void claim(const std::string& path, const UsbIds& ids) const {
    // the file reads as the device's descriptor: idVendor at 8, idProduct at 10
    std::array<std::uint8_t, 18> descriptor{};
    if (::read(file_, descriptor.data(), descriptor.size()) !=
        static_cast<ssize_t>(descriptor.size())) {
      throw std::runtime_error(path + " is no USB device");
    }
    const auto number = [&](std::size_t at) {
      return static_cast<std::uint16_t>(descriptor[at] | (descriptor[at + 1] << 8));
    };
    if (const UsbIds found{number(8), number(10)}; found != ids) {
      throw std::runtime_error(path + " is " + to_text(found) + ", not " + to_text(ids));
    }
    // a serial driver of the kernel may hold it
    usbdevfs_disconnect_claim request{.interface = 0, .flags = 0, .driver = {}};
    if (::ioctl(file_, USBDEVFS_DISCONNECT_CLAIM, &request) < 0) {
      throw std::runtime_error(path + ": " + std::strerror(errno) + "; another program may use it");
    }
  }

  Transfer bulk(unsigned endpoint, std::span<std::byte> bytes, std::size_t& size,
                Duration within) noexcept {
    usbdevfs_bulktransfer transfer{.ep = endpoint,
                                   .len = static_cast<unsigned>(bytes.size()),
                                   .timeout = at_least_one_ms(within),
                                   .data = bytes.data()};
    const int moved = ::ioctl(file_, USBDEVFS_BULK, &transfer);
    if (moved < 0) return usb_failure();
    size = static_cast<std::size_t>(moved);
    return Transfer::kDone;
  }

  int file_;
};

/// The same requests as packets of a socket.
class EmulatedUsbPort final : public UsbPort {
 public:
  EmulatedUsbPort(const std::string& path, const UsbIds& ids) : port_(path) {
    if (const UsbIds found = port_.emulated_ids(1s); found != ids) {
      throw std::runtime_error(path + " is " + to_text(found) + ", not " + to_text(ids));
    }
  }

  [[nodiscard]] Transfer control(std::uint8_t request, std::uint16_t value,
                                 Duration within) noexcept override {
    const std::array<std::byte, 4> packet{kind(EmulatedUsb::kControl), std::byte{request},
                                          static_cast<std::byte>(value & 0xFFU),
                                          static_cast<std::byte>(value >> 8U)};
    const WireClock::time_point deadline = wire_deadline(within);
    Transfer outcome = port_.write(packet, within);
    while (outcome == Transfer::kDone) {
      std::size_t size = 0;
      outcome = port_.read(packet_, size, Duration(deadline - WireClock::now()));
      if (outcome == Transfer::kDone && packet_[0] == kind(EmulatedUsb::kControl)) break;
    }
    return outcome;
  }

  [[nodiscard]] Transfer write(std::span<const std::byte> bytes,
                               Duration within) noexcept override {
    std::array<std::byte, 1 + kUsbPacketBytes> packet{kind(EmulatedUsb::kOut)};
    if (bytes.size() > kUsbPacketBytes) return Transfer::kCorrupt;
    std::copy(bytes.begin(), bytes.end(), packet.begin() + 1);
    return port_.write(std::span(packet).first(1 + bytes.size()), within);
  }

  [[nodiscard]] Transfer read(std::span<std::byte> buffer, std::size_t& size,
                              Duration within) noexcept override {
    const std::byte tag{++tag_};
    const WireClock::time_point deadline = wire_deadline(within);
    Transfer outcome = port_.write(std::array{kind(EmulatedUsb::kIn), tag}, within);
    while (outcome == Transfer::kDone) {
      std::size_t got = 0;
      outcome = port_.read(packet_, got, Duration(deadline - WireClock::now()));
      // what answers an earlier request, which was given up
      if (outcome != Transfer::kDone || got < 2 || packet_[0] != kind(EmulatedUsb::kIn) ||
          packet_[1] != tag) {
        continue;
      }
      size = std::min(got - 2, buffer.size());
      std::copy_n(packet_.begin() + 2, size, buffer.begin());
      break;
    }
    return outcome;
  }

 private:
  static constexpr std::byte kind(EmulatedUsb of) noexcept { return static_cast<std::byte>(of); }

  PacketPort port_;
  std::array<std::byte, 2 + kUsbPacketBytes> packet_{};
  std::uint8_t tag_ = 0;
};

std::string usb_attribute(const fs::path& device, const char* name) {
  std::ifstream stream(device / name);
  std::string line;
  std::getline(stream, line);
  return line;
}

std::string three_digits(const std::string& number) {
  return number.size() < 3 ? std::string(3 - number.size(), '0') + number : number;
}

}  // namespace

std::string find_usb_device(const UsbIds& ids) {
  std::vector<std::string> found;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator("/sys/bus/usb/devices", error)) {
    const std::string name =
        usb_attribute(entry.path(), "idVendor") + ":" + usb_attribute(entry.path(), "idProduct");
    if (name != to_text(ids)) continue;
    found.push_back("/dev/bus/usb/" + three_digits(usb_attribute(entry.path(), "busnum")) + "/" +
                    three_digits(usb_attribute(entry.path(), "devnum")));
  }
  if (found.size() == 1) return found.front();
  if (found.empty()) throw std::runtime_error("no device " + to_text(ids) + " on USB");
  std::string all;
  for (const std::string& path : found) all += " " + path;
  throw std::runtime_error("several devices " + to_text(ids) + " on USB, give one as port:" + all);
}

std::unique_ptr<UsbPort> open_usb(const std::string& path, const UsbIds& ids) {
  if (is_emulated(path)) return std::make_unique<EmulatedUsbPort>(path, ids);
  return std::make_unique<KernelUsbPort>(path, ids);
}

}  // namespace palpate::device
