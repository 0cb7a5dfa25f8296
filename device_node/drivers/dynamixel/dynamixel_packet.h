// SPDX-License-Identifier: Apache-2.0
// dynamixel_packet.h — the packets of Dynamixel's Protocol 2.0, byte by byte: header, stuffing,
// CRC-16, and the one answer of several servos to a Fast Sync Read.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace palpate::device {

enum class DynamixelInstruction : std::uint8_t {
  kPing = 0x01,
  kRead = 0x02,
  kWrite = 0x03,
  kReboot = 0x08,
  kStatus = 0x55,  ///< what a servo answers
  kSyncRead = 0x82,
  kSyncWrite = 0x83,
  kFastSyncRead = 0x8A,
};

inline constexpr std::uint8_t kDynamixelEveryone = 0xFE;  ///< as an id
inline constexpr unsigned kMostDynamixelId = 252;
/// FF FF FD 00, id, length as 16 bits: of instruction, parameters and CRC.
inline constexpr std::size_t kDynamixelHeaderBytes = 7;
inline constexpr std::size_t kMostDynamixelBytes = 320;  ///< of one packet, stuffing included

/// In the error of a status: the hardware error status says why.
inline constexpr unsigned kDynamixelAlert = 0x80;

/// Polynomial 0x8005, most significant bit first, begun at 0 or where it was left.
[[nodiscard]] std::uint16_t dynamixel_crc(std::span<const std::byte> bytes,
                                          std::uint16_t crc = 0) noexcept;

/// One packet to send, in the order of its bytes. Neither allocates nor throws.
class DynamixelPacket {
 public:
  DynamixelPacket(unsigned id, DynamixelInstruction instruction) noexcept;

  DynamixelPacket& u8(unsigned value) noexcept;
  DynamixelPacket& u16(unsigned value) noexcept;
  DynamixelPacket& bytes(std::span<const std::byte> values) noexcept;

  /// Writes length and CRC. Empty if there was more than a packet holds.
  [[nodiscard]] std::span<const std::byte> finish() noexcept;

 private:
  void put(unsigned value) noexcept;

  std::array<std::byte, kMostDynamixelBytes> bytes_{};
  std::size_t size_ = 0;
  bool is_too_long_ = false;
};

enum class PacketFault : std::uint8_t {
  kNone,
  kHeader,  ///< no header, or an id that none has
  kLength,  ///< another length than the header says, or that of no packet
  kCrc,
  kForm,  ///< no answer to what was asked: of another servo or another kind
};

/// The length of the whole packet that begins with this header; 0: it is none.
[[nodiscard]] std::size_t dynamixel_packet_bytes(
    std::span<const std::byte, kDynamixelHeaderBytes> header) noexcept;

/// What a packet says. The parameters of a status begin with its error.
struct DynamixelMessage {
  std::uint8_t id = 0;
  DynamixelInstruction instruction = DynamixelInstruction::kStatus;
  std::span<const std::byte> parameters;  ///< within the packet, without stuffing
};

/// Checks a whole packet and removes its stuffing in place.
[[nodiscard]] PacketFault read_dynamixel(std::span<std::byte> packet,
                                         DynamixelMessage& message) noexcept;

/// The part of one servo in the answer to a Fast Sync Read.
struct FastPart {
  std::uint8_t id = 0;
  std::uint8_t error = 0;
  std::span<const std::byte> data;
};
/// Error, id, data, CRC for each servo. Such an answer is not stuffed.
[[nodiscard]] constexpr std::size_t fast_status_bytes(std::size_t servos, std::size_t data_bytes) {
  return kDynamixelHeaderBytes + 1 + servos * (4 + data_bytes);
}
/// Checks the whole answer, with the CRC of each part.
/// @param parts  one for each servo that was asked
[[nodiscard]] PacketFault read_fast_status(std::span<const std::byte> packet,
                                           std::size_t data_bytes,
                                           std::span<FastPart> parts) noexcept;

/// Little-endian numbers of the control table.
[[nodiscard]] inline unsigned dynamixel_u16(std::span<const std::byte> bytes,
                                            std::size_t at) noexcept {
  return std::to_integer<unsigned>(bytes[at]) | std::to_integer<unsigned>(bytes[at + 1]) << 8U;
}
[[nodiscard]] inline int dynamixel_i16(std::span<const std::byte> bytes, std::size_t at) noexcept {
  return static_cast<std::int16_t>(dynamixel_u16(bytes, at));
}
[[nodiscard]] inline std::int32_t dynamixel_i32(std::span<const std::byte> bytes,
                                                std::size_t at) noexcept {
  return static_cast<std::int32_t>(dynamixel_u16(bytes, at) | dynamixel_u16(bytes, at + 2) << 16U);
}

}  // namespace palpate::device
