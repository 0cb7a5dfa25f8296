// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/dynamixel/dynamixel_packet.h"

#include <algorithm>

namespace palpate::device {
namespace {

constexpr std::byte kFF{0xFF};
constexpr std::byte kFD{0xFD};
constexpr std::size_t kInstructionAt = kDynamixelHeaderBytes;
constexpr std::size_t kCrcBytes = 2;
constexpr std::size_t kLeastBytes = kDynamixelHeaderBytes + 1 + kCrcBytes;

constexpr std::array<std::uint16_t, 256> make_crc_table() {
  std::array<std::uint16_t, 256> table{};
  for (unsigned i = 0; i < table.size(); ++i) {
    unsigned crc = i << 8U;
    for (int bit = 0; bit < 8; ++bit) {
      crc = (crc & 0x8000U) != 0 ? (crc << 1U) ^ 0x8005U : crc << 1U;
    }
    table[i] = static_cast<std::uint16_t>(crc & 0xFFFFU);
  }
  return table;
}
constexpr std::array<std::uint16_t, 256> kCrcTable = make_crc_table();

/// Whether a header's first three bytes end before `at`.
bool is_header_before(std::span<const std::byte> bytes, std::size_t at) {
  return bytes[at - 3] == kFF && bytes[at - 2] == kFF && bytes[at - 1] == kFD;
}

bool has_good_crc(std::span<const std::byte> packet) {
  const std::size_t end = packet.size() - kCrcBytes;
  return dynamixel_crc(packet.first(end)) == dynamixel_u16(packet, end);
}

}  // namespace

std::uint16_t dynamixel_crc(std::span<const std::byte> bytes, std::uint16_t crc) noexcept {
  for (const std::byte b : bytes) {
    const unsigned at = (static_cast<unsigned>(crc) >> 8U) ^ std::to_integer<unsigned>(b);
    crc = static_cast<std::uint16_t>((crc << 8U) ^ kCrcTable[at & 0xFFU]);
  }
  return crc;
}

DynamixelPacket::DynamixelPacket(unsigned id, DynamixelInstruction instruction) noexcept {
  for (const unsigned value : {0xFFU, 0xFFU, 0xFDU, 0x00U, id, 0U, 0U}) put(value);
  put(static_cast<unsigned>(instruction));
}

void DynamixelPacket::put(unsigned value) noexcept {
  if (size_ + kCrcBytes >= bytes_.size()) {
    is_too_long_ = true;
    return;
  }
  bytes_[size_++] = static_cast<std::byte>(value);
}

/// What looks like a header within the parameters gets an FD more.
DynamixelPacket& DynamixelPacket::u8(unsigned value) noexcept {
  put(value);
  if (size_ >= kInstructionAt + 4 && is_header_before(bytes_, size_)) put(0xFD);
  return *this;
}

DynamixelPacket& DynamixelPacket::u16(unsigned value) noexcept {
  return u8(value & 0xFFU).u8(value >> 8U & 0xFFU);
}

DynamixelPacket& DynamixelPacket::bytes(std::span<const std::byte> values) noexcept {
  for (const std::byte value : values) u8(std::to_integer<unsigned>(value));
  return *this;
}

std::span<const std::byte> DynamixelPacket::finish() noexcept {
  if (is_too_long_) return {};
  const std::size_t length = size_ - kDynamixelHeaderBytes + kCrcBytes;
  bytes_[5] = static_cast<std::byte>(length & 0xFFU);
  bytes_[6] = static_cast<std::byte>(length >> 8U);
  const std::uint16_t crc = dynamixel_crc(std::span(bytes_).first(size_));
  bytes_[size_] = static_cast<std::byte>(crc & 0xFFU);
  bytes_[size_ + 1] = static_cast<std::byte>(crc >> 8U);
  return std::span(bytes_).first(size_ + kCrcBytes);
}

std::size_t dynamixel_packet_bytes(
    std::span<const std::byte, kDynamixelHeaderBytes> header) noexcept {
  const auto id = std::to_integer<unsigned>(header[4]);
  const bool is_header = is_header_before(header, 3) && header[3] == std::byte{0} &&
                         (id <= kMostDynamixelId || id == kDynamixelEveryone);
  const std::size_t bytes = kDynamixelHeaderBytes + dynamixel_u16(header, 5);
  return is_header && bytes >= kLeastBytes && bytes <= kMostDynamixelBytes ? bytes : 0;
}

PacketFault read_dynamixel(std::span<std::byte> packet, DynamixelMessage& message) noexcept {
  if (packet.size() < kLeastBytes) return PacketFault::kLength;
  const std::size_t bytes = dynamixel_packet_bytes(packet.first<kDynamixelHeaderBytes>());
  if (bytes == 0) return PacketFault::kHeader;
  if (bytes != packet.size()) return PacketFault::kLength;
  if (!has_good_crc(packet)) return PacketFault::kCrc;

  const std::size_t end = bytes - kCrcBytes;
  std::size_t kept = kInstructionAt + 1;
  bool is_stuffing = false;  // the next byte, if it is FD
  for (std::size_t at = kept; at < end; ++at) {
    if (is_stuffing && packet[at] == kFD) {
      is_stuffing = false;
      continue;
    }
    packet[kept++] = packet[at];
    is_stuffing = kept >= kInstructionAt + 4 && is_header_before(packet, kept);
  }
  message.id = std::to_integer<std::uint8_t>(packet[4]);
  message.instruction = static_cast<DynamixelInstruction>(packet[kInstructionAt]);
  message.parameters = packet.subspan(kInstructionAt + 1, kept - kInstructionAt - 1);
  return PacketFault::kNone;
}

PacketFault read_fast_status(std::span<const std::byte> packet, std::size_t data_bytes,
                             std::span<FastPart> parts) noexcept {
  if (packet.size() < kLeastBytes) return PacketFault::kLength;
  const std::size_t bytes = dynamixel_packet_bytes(packet.first<kDynamixelHeaderBytes>());
  if (bytes == 0) return PacketFault::kHeader;
  if (bytes != packet.size() || bytes != fast_status_bytes(parts.size(), data_bytes)) {
    return PacketFault::kLength;
  }
  if (packet[4] != std::byte{kDynamixelEveryone} ||
      packet[kInstructionAt] != static_cast<std::byte>(DynamixelInstruction::kStatus)) {
    return PacketFault::kForm;
  }
  std::size_t at = kInstructionAt + 1;
  std::size_t checked = 0;
  std::uint16_t crc = 0;
  for (FastPart& part : parts) {
    const std::size_t crc_at = at + 2 + data_bytes;
    // each servo goes on with the CRC of all that came before, the CRCs of others included
    crc = dynamixel_crc(packet.subspan(checked, crc_at - checked), crc);
    if (crc != dynamixel_u16(packet, crc_at)) return PacketFault::kCrc;
    checked = crc_at;
    part = {.id = std::to_integer<std::uint8_t>(packet[at + 1]),
            .error = std::to_integer<std::uint8_t>(packet[at]),
            .data = packet.subspan(at + 2, data_bytes)};
    at = crc_at + kCrcBytes;
  }
  return PacketFault::kNone;
}

}  // namespace palpate::device
