// The numbers in the tables of proto/README.md are those of the code.
#include <gtest/gtest.h>

#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "common/link/codec/codec.h"
#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "common/link/one_writer.h"
#include "common/link/security/keys.h"
#include "common/link/socket/link_settings.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using Row = std::vector<std::string>;

/// The cells of a line "| a | b |", without spaces and backticks around them.
Row cells_of(const std::string& line) {
  Row cells;
  std::istringstream parts(line.substr(1));
  for (std::string cell; std::getline(parts, cell, '|');) {
    constexpr const char* kAround = " `";
    const std::size_t first = cell.find_first_not_of(kAround);
    cells.push_back(first == std::string::npos
                        ? ""
                        : cell.substr(first, cell.find_last_not_of(kAround) - first + 1));
  }
  return cells;
}

/// The rows of all tables by their first cell, without that cell.
const std::map<std::string, Row>& rows() {
  static const std::map<std::string, Row> all = [] {
    std::map<std::string, Row> found;
    std::istringstream lines(test::text_of(PALPATE_SOURCE_DIR "/proto/README.md"));
    for (std::string line; std::getline(lines, line);) {
      if (!line.starts_with('|')) continue;
      Row row = cells_of(line);
      const std::string name = row.front();
      row.erase(row.begin());
      EXPECT_TRUE(found.emplace(name, row).second || name.starts_with('-') || name.empty())
          << "two rows are named " << name;
    }
    return found;
  }();
  return all;
}
Row row(const std::string& name) {
  const auto found = rows().find(name);
  EXPECT_NE(found, rows().end()) << "no row " << name;
  return found == rows().end() ? Row{} : found->second;
}

std::string ms(int value) { return std::to_string(value) + " ms"; }
std::string ms(Duration value) {
  return std::to_string(std::chrono::duration_cast<std::chrono::milliseconds>(value).count()) +
         " ms";
}
std::string buffers(const LinkSettings& settings) {
  return settings.buffer_bytes == 0 ? "system default"
                                    : std::to_string(settings.buffer_bytes >> 10) + " KiB";
}
std::string heartbeats(const LinkSettings& settings) {
  return settings.heartbeats ? "every " + ms(kHeartbeatMs) + ", timeout " + ms(kHeartbeatTimeoutMs)
                             : "none";
}
/// libzmq keeps one message of a conflated queue.
std::string receive_queue(const LinkSettings& settings) {
  return settings.conflates ? "1 (conflated)" : std::to_string(settings.receive_queue);
}

constexpr LinkSettings kNewest = one_way_receiver(Delivery::kNewest);
constexpr LinkSettings kEvery = one_way_receiver(Delivery::kEvery);

TEST(ProtoReadme, GivesTheQueues) {
  const std::string one_way = std::to_string(kOneWaySender.send_queue);
  EXPECT_EQ(row("send queue per peer (HWM)"),
            (Row{std::to_string(kExchangeClient.send_queue), one_way, one_way,
                 std::to_string(kTelemetrySender.send_queue) + "; physics_node " +
                     std::to_string(kSceneSender.send_queue),
                 one_way}));
  const std::string newest = receive_queue(kNewest) + "; with `faults` " + receive_queue(kEvery);
  EXPECT_EQ(row("receive queue per peer (HWM)"),
            (Row{receive_queue(kExchangeServer), newest, newest,
                 receive_queue(kTelemetrySubscriber), receive_queue(kEvery)}));
  EXPECT_EQ(row("queues over inproc"), (Row{std::to_string(kInprocQueue)}));
  EXPECT_EQ(kExchangeServer.send_queue, kExchangeClient.send_queue);
  EXPECT_EQ(kExchangeServer.receive_queue, kExchangeClient.receive_queue);
}

TEST(ProtoReadme, GivesTheKernelBuffersOfBothEnds) {
  EXPECT_EQ(row("kernel buffers (tcp)"),
            (Row{buffers(kExchangeServer), buffers(kOneWaySender), buffers(kOneWaySender),
                 buffers(kTelemetrySender), buffers(kOneWaySender)}));
  EXPECT_EQ(buffers(kExchangeClient), buffers(kExchangeServer));
  EXPECT_EQ(buffers(kNewest), buffers(kOneWaySender));
  EXPECT_EQ(buffers(kEvery), buffers(kOneWaySender));
  EXPECT_EQ(buffers(kSceneSender), buffers(kTelemetrySender));
  EXPECT_EQ(buffers(kTelemetrySubscriber), buffers(kTelemetrySender));
}

TEST(ProtoReadme, GivesTheHeartbeats) {
  const std::string one_way = heartbeats(kOneWaySender);
  EXPECT_EQ(row("heartbeats of the sender"), (Row{heartbeats(kExchangeClient), one_way, one_way,
                                                  heartbeats(kTelemetrySender), one_way}));
  const std::string newest = heartbeats(kNewest) + "; with `faults` " + heartbeats(kEvery);
  EXPECT_EQ(row("heartbeats of the receiver"),
            (Row{heartbeats(kExchangeServer), newest, newest, heartbeats(kTelemetrySubscriber),
                 heartbeats(kEvery)}));
}

TEST(ProtoReadme, GivesTheTimes) {
  EXPECT_EQ(
      row("linger when closing"),
      (Row{ms(kExchangeServer.linger_ms), ms(kOneWaySender.linger_ms), ms(kOneWaySender.linger_ms),
           ms(kTelemetrySender.linger_ms), ms(kOneWaySender.linger_ms)}));
  EXPECT_EQ(row("another sender is accepted after silence of"),
            (Row{ms(ExchangeServer::kSilence), ms(OneWriter::kSilence), "–", "–", "–"}));
  EXPECT_EQ(row("reconnection interval"), (Row{ms(kReconnectMs)}));
  EXPECT_EQ(row("connection attempt is aborted and repeated after"), (Row{ms(kConnectMs)}));
  EXPECT_EQ(row("handshake is aborted and repeated after"), (Row{ms(kHandshakeMs)}));
  EXPECT_EQ(row("TCP_MAXRT (tcp)"), (Row{ms(kTcpMaxRetransmitMs)}));
  EXPECT_EQ(row("TCP keepalive (tcp)"),
            (Row{"after " + std::to_string(kTcpKeepaliveSeconds) + " s, " +
                 std::to_string(kTcpKeepaliveProbes) + " probes"}));
}

TEST(ProtoReadme, GivesTheThrottlingOfTheExchange) {
  const std::string text = test::text_of(PALPATE_SOURCE_DIR "/proto/README.md");
  EXPECT_NE(text.find("After " + std::to_string(ExchangeClient::kMaxUnanswered) +
                      " unanswered states, device_node sends\nonly one of " +
                      std::to_string(ExchangeClient::kSendOneIn) + " until"),
            std::string::npos);
}

template <class T>
Row frame_row(const LinkSettings& receiver) {
  return {std::to_string(static_cast<int>(kKindOf<T>)),
          std::to_string(kMaxFrameBytes<T> >> 10) + " KiB",
          std::to_string(receiver.largest_frame_bytes >> 20) + " MiB"};
}

TEST(ProtoReadme, GivesTheKindsAndLengthsOfFrames) {
  EXPECT_EQ(row("DeviceState"), frame_row<DeviceState>(kExchangeServer));
  EXPECT_EQ(row("ForceCommand"), frame_row<ForceCommand>(kExchangeClient));
  EXPECT_EQ(row("ToolMotion"), frame_row<ToolMotion>(kNewest));
  EXPECT_EQ(row("Interaction"), frame_row<Interaction>(kNewest));
  EXPECT_EQ(row("DeviceTelemetry"), frame_row<DeviceBatch>(kTelemetrySubscriber));
  EXPECT_EQ(row("MofcTelemetry"), frame_row<MofcBatch>(kTelemetrySubscriber));
  EXPECT_EQ(row("PhysicsTelemetry"), frame_row<PhysicsBatch>(kTelemetrySubscriber));
  EXPECT_EQ(row("SceneState"), frame_row<SceneState>(kTelemetrySubscriber));
  EXPECT_EQ(row("MeshFrame"), frame_row<MeshFrame>(kTelemetrySubscriber));
  EXPECT_EQ(row("HandTarget"), frame_row<HandTarget>(kEvery));
}

TEST(ProtoReadme, GivesTheReasonsInTheOrderOfTheChecks) {
  const std::string text = test::text_of(PALPATE_SOURCE_DIR "/proto/README.md");
  std::size_t at = 0;
  for (std::size_t i = 1; i < kDecodeErrors; ++i) {
    at = text.find("| `" + std::string(name(static_cast<DecodeError>(i))) + "` |", at);
    ASSERT_NE(at, std::string::npos) << name(static_cast<DecodeError>(i));
  }
  EXPECT_EQ(row("header.protocol_major` is " + std::to_string(kProtocolMajor)),
            (Row{name(DecodeError::kWrongVersion)}));
}

TEST(ProtoReadme, GivesTheRolesOfEveryLink) {
  for (const LinkRoles& link : kLinkRoles) {
    EXPECT_EQ(row(std::string(link.link)), (Row{name_of(link.server), name_of(link.client)}));
  }
}

}  // namespace
}  // namespace palpate
