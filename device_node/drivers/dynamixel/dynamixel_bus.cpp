// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/dynamixel/dynamixel_bus.h"

#include <algorithm>
#include <chrono>

#include "device_node/drivers/transport/wait_for.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kStatusBytes = kDynamixelHeaderBytes + 4;  // instruction, error, CRC
/// Bytes before a header that are taken for noise of the line.
constexpr std::size_t kMostNoiseBytes = 64;
constexpr std::size_t kMostServos = 16;

Duration left_until(WireClock::time_point deadline) {
  return std::max(Duration::zero(),
                  std::chrono::duration_cast<Duration>(deadline - WireClock::now()));
}

}  // namespace

Transfer DynamixelLine::send(std::span<const std::byte> packet, Duration within) noexcept {
  return packet.empty() ? Transfer::kCorrupt : port_.write(packet, within);
}

Transfer DynamixelLine::receive(std::span<std::byte>& packet, Duration within) noexcept {
  const WireClock::time_point deadline = wire_deadline(within);
  const auto header = std::span(buffer_).first<kDynamixelHeaderBytes>();
  Transfer transfer = port_.read(header, within);
  for (std::size_t noise = 0; transfer == Transfer::kDone; ++noise) {
    const std::size_t bytes = dynamixel_packet_bytes(header);
    if (bytes > 0) {
      packet = std::span(buffer_).first(bytes);
      transfer = port_.read(packet.subspan(kDynamixelHeaderBytes), left_until(deadline));
      return transfer == Transfer::kTimeout ? Transfer::kCorrupt : transfer;
    }
    if (noise == kMostNoiseBytes) return Transfer::kCorrupt;
    std::copy(header.begin() + 1, header.end(), header.begin());
    transfer = port_.read(header.last<1>(), left_until(deadline));
    // something came, and no packet
    if (transfer == Transfer::kTimeout) return Transfer::kCorrupt;
  }
  return transfer;
}

DynamixelBus::DynamixelBus(const std::string& path, unsigned bits_per_second, Duration answer_limit)
    : port_(path), line_(port_), bits_per_second_(bits_per_second), answer_limit_(answer_limit) {
  port_.set_speed(bits_per_second);
}

Duration DynamixelBus::time_for(std::size_t bytes) const noexcept {
  return Duration(static_cast<std::int64_t>(bytes) * 10'000'000'000 /
                  static_cast<std::int64_t>(bits_per_second_));
}

Transfer DynamixelBus::ask(DynamixelPacket& instruction, std::size_t answer_bytes) noexcept {
  line_.discard();  // answers to earlier instructions that came too late
  const std::span<const std::byte> packet = instruction.finish();
  return line_.send(packet, answer_limit_ + time_for(packet.size() + answer_bytes));
}

Transfer DynamixelBus::status(unsigned id, std::size_t data_bytes,
                              DynamixelMessage& message) noexcept {
  const Duration within = answer_limit_ + time_for(kStatusBytes + data_bytes);
  const WireClock::time_point deadline = wire_deadline(within);
  // an adapter may echo the instruction
  for (int packets = 0; packets < 2; ++packets) {
    std::span<std::byte> packet;
    const Transfer transfer = line_.receive(packet, left_until(deadline));
    if (transfer != Transfer::kDone) return transfer;
    if (read_dynamixel(packet, message) != PacketFault::kNone) return Transfer::kCorrupt;
    if (message.instruction != DynamixelInstruction::kStatus) continue;
    const bool is_whole = message.id == id && !message.parameters.empty();
    const bool has_error = is_whole && (std::to_integer<unsigned>(message.parameters[0]) & 0x7FU);
    // one that reports an error may have no data
    return is_whole && (has_error || message.parameters.size() == 1 + data_bytes)
               ? Transfer::kDone
               : Transfer::kCorrupt;
  }
  return Transfer::kCorrupt;
}

Transfer DynamixelBus::ping(unsigned id, DynamixelPing& answer) noexcept {
  DynamixelPacket instruction(id, DynamixelInstruction::kPing);
  Transfer transfer = ask(instruction, kStatusBytes + 3);
  if (transfer != Transfer::kDone) return transfer;
  DynamixelMessage message;
  transfer = status(id, 3, message);
  if (transfer != Transfer::kDone) return transfer;
  if (message.parameters.size() != 4) return Transfer::kCorrupt;
  answer = {.model = dynamixel_u16(message.parameters, 1),
            .firmware = std::to_integer<unsigned>(message.parameters[3])};
  return Transfer::kDone;
}

Transfer DynamixelBus::read(unsigned id, unsigned address, std::span<std::byte> data,
                            std::uint8_t& error) noexcept {
  DynamixelPacket instruction(id, DynamixelInstruction::kRead);
  instruction.u16(address).u16(static_cast<unsigned>(data.size()));
  Transfer transfer = ask(instruction, kStatusBytes + data.size());
  if (transfer != Transfer::kDone) return transfer;
  DynamixelMessage message;
  transfer = status(id, data.size(), message);
  if (transfer != Transfer::kDone) return transfer;
  error = std::to_integer<std::uint8_t>(message.parameters[0]);
  if (message.parameters.size() != 1 + data.size()) {
    std::fill(data.begin(), data.end(), std::byte{0});
    return Transfer::kDone;
  }
  std::copy(message.parameters.begin() + 1, message.parameters.end(), data.begin());
  return Transfer::kDone;
}

Transfer DynamixelBus::write(unsigned id, unsigned address, std::span<const std::byte> data,
                             std::uint8_t& error) noexcept {
  DynamixelPacket instruction(id, DynamixelInstruction::kWrite);
  instruction.u16(address).bytes(data);
  Transfer transfer = ask(instruction, kStatusBytes);
  if (transfer != Transfer::kDone) return transfer;
  DynamixelMessage message;
  transfer = status(id, 0, message);
  if (transfer != Transfer::kDone) return transfer;
  error = std::to_integer<std::uint8_t>(message.parameters[0]);
  return Transfer::kDone;
}

Transfer DynamixelBus::sync_write(unsigned address, std::size_t bytes_each,
                                  std::span<const std::uint8_t> ids,
                                  std::span<const std::byte> data) noexcept {
  DynamixelPacket instruction(kDynamixelEveryone, DynamixelInstruction::kSyncWrite);
  instruction.u16(address).u16(static_cast<unsigned>(bytes_each));
  for (std::size_t i = 0; i < ids.size(); ++i) {
    instruction.u8(ids[i]).bytes(data.subspan(i * bytes_each, bytes_each));
  }
  const std::span<const std::byte> packet = instruction.finish();
  return line_.send(packet, answer_limit_ + time_for(packet.size()));
}

Transfer DynamixelBus::sync_read(bool is_fast, unsigned address, std::size_t bytes_each,
                                 std::span<const std::uint8_t> ids,
                                 std::span<DynamixelAnswer> answers) noexcept {
  if (ids.size() > kMostServos || bytes_each > answers[0].data.size()) return Transfer::kCorrupt;
  DynamixelPacket instruction(kDynamixelEveryone, is_fast ? DynamixelInstruction::kFastSyncRead
                                                          : DynamixelInstruction::kSyncRead);
  instruction.u16(address).u16(static_cast<unsigned>(bytes_each));
  for (const std::uint8_t id : ids) instruction.u8(id);
  const std::size_t whole = fast_status_bytes(ids.size(), bytes_each);
  Transfer transfer = ask(instruction, whole);
  if (transfer != Transfer::kDone) return transfer;

  if (!is_fast) {
    for (std::size_t i = 0; i < ids.size(); ++i) {
      DynamixelMessage message;
      transfer = status(ids[i], bytes_each, message);
      if (transfer != Transfer::kDone) return transfer;
      if (message.parameters.size() != 1 + bytes_each) return Transfer::kCorrupt;
      answers[i].error = std::to_integer<std::uint8_t>(message.parameters[0]);
      std::copy(message.parameters.begin() + 1, message.parameters.end(), answers[i].data.begin());
    }
    return Transfer::kDone;
  }

  const WireClock::time_point deadline = wire_deadline(answer_limit_ + time_for(whole));
  std::array<FastPart, kMostServos> parts{};
  for (int packets = 0; packets < 2; ++packets) {
    std::span<std::byte> packet;
    transfer = line_.receive(packet, left_until(deadline));
    if (transfer != Transfer::kDone) return transfer;
    const bool is_echo =
        packet[kDynamixelHeaderBytes] != static_cast<std::byte>(DynamixelInstruction::kStatus);
    if (is_echo) continue;
    const auto asked = std::span(parts).first(ids.size());
    if (read_fast_status(packet, bytes_each, asked) != PacketFault::kNone) {
      return Transfer::kCorrupt;
    }
    for (std::size_t i = 0; i < ids.size(); ++i) {
      if (parts[i].id != ids[i]) return Transfer::kCorrupt;
      answers[i].error = parts[i].error;
      std::copy(parts[i].data.begin(), parts[i].data.end(), answers[i].data.begin());
    }
    return Transfer::kDone;
  }
  return Transfer::kCorrupt;
}

}  // namespace palpate::device
