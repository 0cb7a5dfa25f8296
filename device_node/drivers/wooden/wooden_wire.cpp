// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/wooden/wooden_wire.h"

namespace palpate::device {
namespace {

void put_number(std::span<std::byte> bytes, std::size_t& at, std::int16_t value) noexcept {
  const auto bits = static_cast<std::uint16_t>(value);
  bytes[at++] = static_cast<std::byte>(bits & 0xFFU);
  bytes[at++] = static_cast<std::byte>(bits >> 8U);
}

std::int16_t take_number(std::span<const std::byte> bytes, std::size_t& at) noexcept {
  const auto low = std::to_integer<unsigned>(bytes[at++]);
  const auto high = std::to_integer<unsigned>(bytes[at++]);
  return static_cast<std::int16_t>(static_cast<std::uint16_t>(low | (high << 8U)));
}

}  // namespace

WoodenCommandBytes wooden_command(const WoodenCommand& command) noexcept {
  WoodenCommandBytes bytes{};
  std::size_t at = 1;
  for (const std::int16_t current : command.currents_ma) put_number(bytes, at, current);
  put_number(bytes, at, command.command);
  for (const std::int16_t attribute : command.attributes) put_number(bytes, at, attribute);
  return bytes;
}

bool read_wooden_command(std::span<const std::byte> bytes, WoodenCommand& command) noexcept {
  if (bytes.size() != 1 + kWoodenReportBytes || bytes[0] != std::byte{0}) return false;
  std::size_t at = 1;
  for (std::int16_t& current : command.currents_ma) current = take_number(bytes, at);
  command.command = take_number(bytes, at);
  for (std::int16_t& attribute : command.attributes) attribute = take_number(bytes, at);
  return true;
}

WoodenReportBytes wooden_report(const WoodenReading& reading) noexcept {
  WoodenReportBytes bytes{};
  std::size_t at = 0;
  for (const std::int16_t count : reading.encoders) put_number(bytes, at, count);
  put_number(bytes, at, reading.info);
  return bytes;
}

bool read_wooden_report(std::span<const std::byte> bytes, WoodenReading& reading) noexcept {
  if (bytes.size() != kWoodenReportBytes) return false;
  std::size_t at = 0;
  for (std::int16_t& count : reading.encoders) count = take_number(bytes, at);
  reading.info = take_number(bytes, at);
  return reading.info == 0 || reading.info == 1;
}

}  // namespace palpate::device
