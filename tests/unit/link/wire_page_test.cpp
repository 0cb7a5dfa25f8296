// SPDX-License-Identifier: Apache-2.0
// The numbers in the tables of docs/wire.md are those of the code, and its example frames are
// frames.
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
#include "common/link/socket/connection_monitor.h"
#include "common/link/socket/link_settings.h"
#include "common/link/subscribers.h"
#include "common/link/subscription.h"
#include "common/telemetry/device_telemetry.h"
#include "common/telemetry/mofc_telemetry.h"
#include "tests/support/machine/places.h"
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

/// The rows of all tables but those of fields by their first cell, without that cell.
const std::map<std::string, Row>& rows() {
  static const std::map<std::string, Row> all = [] {
    std::map<std::string, Row> found;
    const std::string page = test::text_of(test::source_dir() + "/docs/wire.md");
    std::istringstream lines(page.substr(0, page.find("\n## Messages\n")));
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
std::string kib(std::int64_t bytes) { return std::to_string(bytes >> 10) + " KiB"; }

TEST(WirePage, GivesTheQueues) {
  const auto sends = [](const LinkSettings& settings) {
    return std::to_string(settings.send_queue);
  };
  const auto receives = [](const LinkSettings& settings) {
    return std::to_string(settings.receive_queue);
  };
  EXPECT_EQ(row("send queue per peer (HWM)"),
            (Row{sends(kExchangeClient), sends(kOneWaySender), sends(kInteractionSender),
                 sends(kTelemetrySender) + "; physics_node " + sends(kSceneSender),
                 sends(kOneWaySender)}));
  EXPECT_EQ(
      row("receive queue per peer (HWM)"),
      (Row{receives(kExchangeServer), receives(kOneWayReceiver), receives(kInteractionReceiver),
           receives(kTelemetryReceiver), receives(kOneWayReceiver)}));
  EXPECT_EQ(row("queues over inproc"), (Row{std::to_string(kInprocQueue)}));
  EXPECT_EQ(kExchangeServer.send_queue, kExchangeClient.send_queue);
  EXPECT_EQ(kExchangeServer.receive_queue, kExchangeClient.receive_queue);
}

TEST(WirePage, GivesTheKernelBuffersOfBothEnds) {
  EXPECT_EQ(row("kernel buffers (tcp)"),
            (Row{buffers(kExchangeServer), buffers(kOneWaySender), buffers(kInteractionSender),
                 buffers(kTelemetrySender), buffers(kOneWaySender)}));
  EXPECT_EQ(buffers(kExchangeClient), buffers(kExchangeServer));
  EXPECT_EQ(buffers(kOneWayReceiver), buffers(kOneWaySender));
  EXPECT_EQ(buffers(kInteractionReceiver), buffers(kInteractionSender));
  EXPECT_EQ(buffers(kSceneSender), buffers(kTelemetrySender));
  EXPECT_EQ(buffers(kTelemetryReceiver), buffers(kTelemetrySender));
}

TEST(WirePage, GivesTheSubscription) {
  EXPECT_EQ(row("kind byte of a subscription"),
            (Row{std::to_string(static_cast<int>(MessageKind::kSubscription))}));
  EXPECT_EQ(row("repeated every"), (Row{ms(Subscription::kInterval)}));
  EXPECT_EQ(row("receiver is forgotten after silence of"), (Row{ms(Subscribers::kSilence)}));
  EXPECT_EQ(row("receivers served by one sender"), (Row{std::to_string(Subscribers::kMost)}));
  for (const LinkSettings& sender : {kInteractionSender, kTelemetrySender, kSceneSender}) {
    EXPECT_EQ(row("libzmq disconnects its sender above"), (Row{kib(sender.largest_frame_bytes)}));
  }
}

TEST(WirePage, GivesTheLimitsOfConnections) {
  EXPECT_EQ(row("an end that libzmq has given up connects again after"),
            (Row{ms(kReconnectLeast) + ", doubled up to " + ms(kReconnectMost)}));
  EXPECT_EQ(row("connections to one binding end (tcp)"), (Row{std::to_string(kMostConnections)}));
  EXPECT_EQ(row("sent beyond one frame without a complete message (tcp)"),
            (Row{kib(kMostIncompleteBytes)}));
}

TEST(WirePage, GivesTheTimes) {
  EXPECT_EQ(row("linger when closing"),
            (Row{ms(kExchangeServer.linger_ms), ms(kOneWaySender.linger_ms),
                 ms(kInteractionSender.linger_ms), ms(kTelemetrySender.linger_ms),
                 ms(kOneWaySender.linger_ms)}));
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

TEST(WirePage, GivesTheThrottlingOfTheExchange) {
  const std::string text = test::text_of(test::source_dir() + "/docs/wire.md");
  EXPECT_NE(text.find("After " + std::to_string(ExchangeClient::kMaxUnanswered) +
                      " unanswered states, device_node sends\nonly one of " +
                      std::to_string(ExchangeClient::kSendOneIn) + " until"),
            std::string::npos);
}

template <class T>
Row frame_row(const LinkSettings& receiver) {
  return {std::to_string(static_cast<int>(kKindOf<T>)), kib(kMaxFrameBytes<T>),
          kib(receiver.largest_frame_bytes)};
}

TEST(WirePage, GivesTheKindsAndLengthsOfFrames) {
  EXPECT_EQ(row("DeviceState"), frame_row<DeviceState>(kExchangeServer));
  EXPECT_EQ(row("ForceCommand"), frame_row<ForceCommand>(kExchangeClient));
  EXPECT_EQ(row("ToolMotion"), frame_row<ToolMotion>(kOneWayReceiver));
  EXPECT_EQ(row("Interaction"), frame_row<Interaction>(kInteractionReceiver));
  EXPECT_EQ(row("DeviceTelemetry"), frame_row<DeviceBatch>(kTelemetryReceiver));
  EXPECT_EQ(row("MofcTelemetry"), frame_row<MofcBatch>(kTelemetryReceiver));
  EXPECT_EQ(row("PhysicsTelemetry"), frame_row<PhysicsBatch>(kTelemetryReceiver));
  EXPECT_EQ(row("SceneState"), frame_row<SceneState>(kTelemetryReceiver));
  EXPECT_EQ(row("MeshFrame"), frame_row<MeshFrame>(kTelemetryReceiver));
  EXPECT_EQ(row("HandTarget"), frame_row<HandTarget>(kOneWayReceiver));
  EXPECT_EQ(row("RunState"), frame_row<RunState>(kTelemetryReceiver));
  EXPECT_EQ(row("RunRequest"), frame_row<RunRequest>(kOneWayReceiver));
  EXPECT_EQ(row("TissueChange"), frame_row<TissueChange>(kOneWayReceiver));
  EXPECT_EQ(row("Acknowledgement"), frame_row<Acknowledgement>(kOneWayReceiver));
}

TEST(WirePage, GivesTheReasonsInTheOrderOfTheChecks) {
  const std::string text = test::text_of(test::source_dir() + "/docs/wire.md");
  std::size_t at = 0;
  for (std::size_t i = 1; i < kDecodeErrors; ++i) {
    at = text.find("| `" + std::string(name(static_cast<DecodeError>(i))) + "` |", at);
    ASSERT_NE(at, std::string::npos) << name(static_cast<DecodeError>(i));
  }
  EXPECT_EQ(row("header.protocol_major` is " + std::to_string(kProtocolMajor)),
            (Row{name(DecodeError::kWrongVersion)}));
}

/// The bytes of the example frame of a message: hexadecimal, up to the ';' of each line.
std::vector<std::byte> example(const std::string& message) {
  const std::string page = test::text_of(test::source_dir() + "/docs/wire.md");
  const std::size_t begin = page.find("\n```\n", page.find("\n`" + message + "`, "));
  if (begin == std::string::npos) return {};
  std::istringstream lines(page.substr(begin + 5, page.find("\n```\n", begin + 1) - begin - 4));
  std::vector<std::byte> frame;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream bytes(line.substr(0, line.find(';')));
    for (std::string byte; bytes >> byte;) {
      frame.push_back(static_cast<std::byte>(std::stoi(byte, nullptr, 16)));
    }
  }
  return frame;
}

template <class T>
T decoded_example(const std::string& message) {
  const std::vector<std::byte> frame = example(message);
  Codec<T> codec;
  T decoded;
  EXPECT_EQ(codec.decode(frame, decoded), DecodeError::kNone) << message;
  std::vector<std::byte> again(codec.encode(decoded));
  codec.write(again.data());
  EXPECT_EQ(again, frame) << message;
  EXPECT_EQ(decoded.header.session_id, 0x0807060504030201u);
  EXPECT_EQ(decoded.header.sequence, 5u);
  EXPECT_EQ(decoded.device_session_id, 0x1817161514131211u);
  EXPECT_EQ(decoded.device_sequence, 42u);
  EXPECT_EQ(decoded.device_sampled_at, TimePoint(std::chrono::seconds(2)));
  EXPECT_EQ(decoded.tool_position_world_m, Vector3(0, 0, -0.002));
  return decoded;
}

TEST(WirePage, ItsToolMotionIsWhatTheCodecWritesAndReads) {
  const auto motion = decoded_example<ToolMotion>("ToolMotion");
  EXPECT_EQ(motion.tool_velocity_world_m_per_s, Vector3(0, 0, -0.1));
  EXPECT_EQ(motion.buttons, 1u);
}

TEST(WirePage, ItsInteractionIsWhatTheCodecWritesAndReads) {
  const auto interaction = decoded_example<Interaction>("Interaction");
  EXPECT_EQ(interaction.force_on_tool_newton, Vector3(0, 0, 0.8));
  EXPECT_EQ(interaction.stored_energy_joule, 0.0008);
  ASSERT_EQ(interaction.listed_count, 1u);
  EXPECT_EQ(interaction.contacts[0].penetration_m, 0.002);
  EXPECT_EQ(interaction.contacts[0].d_force_d_position(2, 2), -400.0);
}

/// "0 limp, 1 answered, …" up to `last`.
template <class State>
std::string values_up_to(State last) {
  std::string text;
  for (int i = 0; i <= static_cast<int>(last); ++i) {
    text += (i > 0 ? ", " : "") + std::to_string(i) + " " + name(static_cast<State>(i));
  }
  return text;
}

TEST(WirePage, GivesTheNumbersOfTheStates) {
  EXPECT_EQ(row("DeviceTelemetry.guard"), (Row{values_up_to(GuardState::kFault)}));
  EXPECT_EQ(row("MofcTelemetry.state"), (Row{values_up_to(MofcState::kClutched)}));
  EXPECT_EQ(row("DeviceCounters.phase"), (Row{values_up_to(DevicePhase::kChecking)}));
  EXPECT_EQ(row("DeviceCounters.last_fault"), (Row{values_up_to(FaultReason::kMotorsDiffer)}));
}

TEST(WirePage, GivesTheRolesOfEveryLink) {
  for (const LinkRoles& link : kLinkRoles) {
    EXPECT_EQ(row(std::string(link.link)), (Row{name_of(link.server), name_of(link.client)}));
  }
}

}  // namespace
}  // namespace palpate
