// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/falcon/falcon_firmware.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <fstream>
#include <stdexcept>
#include <utility>

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kLargestImageBytes = 1U << 20U;  // known images have 8 kB
constexpr Duration kAnswer = 1s;

void must_do(Transfer transfer, const char* what) {
  if (transfer != Transfer::kDone) throw std::runtime_error(what);
}

using Requests = std::pair<FtdiRequest, std::uint16_t>;

void send_all(FtdiLine& line, std::span<const Requests> requests) {
  for (const auto& [request, value] : requests) {
    must_do(line.request(request, value), "the FTDI chip refuses a request");
  }
}

/// "\n C \r", answered by five bytes; some Falcons leave out the first, a zero.
void greet(FtdiLine& line) {
  must_do(line.write(kFalconGreeting, kAnswer), "the boot loader cannot be written to");
  std::array<std::byte, kFalconWelcome.size()> answer{};
  must_do(line.read(std::span(answer).first(1), kAnswer), "the boot loader does not answer");
  const std::size_t from = answer[0] == kFalconWelcome[0] ? 1 : 0;
  const auto rest = std::span(answer).subspan(1, kFalconWelcome.size() - 2 + from);
  must_do(line.read(rest, kAnswer), "the boot loader's answer ends early");
  const auto expected = std::span(kFalconWelcome).subspan(1);
  if (!std::equal(expected.begin(), expected.end(), answer.begin() + static_cast<long>(from))) {
    throw std::runtime_error("the boot loader answers something else than expected");
  }
}

void send_echoed(FtdiLine& line, std::span<const std::byte> bytes, std::size_t at) {
  must_do(line.write(bytes, kAnswer), "the boot loader takes no more bytes");
  std::array<std::byte, kFtdiPayloadBytes> echo{};
  const auto got = std::span(echo).first(bytes.size());
  if (line.read(got, kAnswer) != Transfer::kDone ||
      !std::equal(got.begin(), got.end(), bytes.begin())) {
    throw std::runtime_error("wrong echo of the bytes from " + std::to_string(at) + " on");
  }
}

}  // namespace

std::vector<std::byte> read_falcon_image(const std::string& file) {
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  if (!stream) throw std::runtime_error(file + ": " + std::strerror(errno));
  const auto size = static_cast<std::streamoff>(stream.tellg());
  if (size <= 0 || size > static_cast<std::streamoff>(kLargestImageBytes)) {
    throw std::runtime_error(file + " is no firmware of a Falcon: it has " + std::to_string(size) +
                             " bytes, known images about 8000");
  }
  std::vector<std::byte> image(static_cast<std::size_t>(size));
  stream.seekg(0);
  stream.read(reinterpret_cast<char*>(image.data()), static_cast<std::streamsize>(image.size()));
  if (!stream) throw std::runtime_error(file + ": cannot be read to its end");
  return image;
}

void load_falcon_firmware(FtdiLine& line, std::span<const std::byte> image) {
  must_do(line.purge(), "the FTDI chip refuses a request");
  send_all(line, std::array<Requests, 8>{{{FtdiRequest::kLatency, 16},
                                          {FtdiRequest::kEventCharacter, 0},
                                          {FtdiRequest::kBaudRate, kFalconBootDivisor},
                                          {FtdiRequest::kData, kFtdiEightBits},
                                          {FtdiRequest::kFlowControl, 0},
                                          {FtdiRequest::kModemControl, kFtdiRtsLow},
                                          {FtdiRequest::kModemControl, kFtdiDtrLow},
                                          {FtdiRequest::kModemControl, kFtdiDtrHigh}}});
  greet(line);
  send_all(line, std::array<Requests, 2>{{{FtdiRequest::kModemControl, kFtdiDtrLow},
                                          {FtdiRequest::kBaudRate, kFalconLoadDivisor}}});
  send_echoed(line, std::array{std::byte{0x41}}, 0);
  for (std::size_t at = 0; at < image.size(); at += kFtdiPayloadBytes) {
    send_echoed(line, image.subspan(at, std::min(kFtdiPayloadBytes, image.size() - at)), at);
  }
}

void set_falcon_running(FtdiLine& line) {
  // an answer ends with '>': without the event character the chip would keep it for a millisecond
  send_all(line, std::array<Requests, 4>{{{FtdiRequest::kLatency, 1},
                                          {FtdiRequest::kBaudRate, kFalconRunDivisor},
                                          {FtdiRequest::kData, kFtdiEightBits},
                                          {FtdiRequest::kEventCharacter, kFtdiEventOn | '>'}}});
  must_do(line.purge(), "the FTDI chip refuses a request");
}

}  // namespace palpate::device
