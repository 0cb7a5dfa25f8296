// SPDX-License-Identifier: Apache-2.0
// foxglove_client.h — the server's side of the Foxglove WebSocket protocol v1 for one client:
// greeting, requests, subscriptions. No socket: texts and bytes in and
// out. https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace palpate::viewer {

/// Subprotocol names; their messages are the same.
inline constexpr std::array<std::string_view, 2> kSubprotocols = {"foxglove.sdk.v1",
                                                                  "foxglove.websocket.v1"};

struct Channel {
  std::string topic;
  std::string schema_name;  ///< fully qualified protobuf message
  std::string schema;       ///< FileDescriptorSet, binary
  bool is_state = false;    ///< each message replaces the one before
  bool is_held = false;     ///< who publishes it keeps the newest payload
};

/// What a client may publish.
enum class ClientTopic : std::uint8_t { kHandTarget, kRunRequest, kTissueChange, kAcknowledgement };

/// The server, as described to every client. With a topic that it accepts it has the capability
/// clientPublish.
struct ServerDescription {
  std::string name;
  std::string session_id;    ///< changes at each server start
  std::string session_name;  ///< of the deployment
  std::vector<Channel> channels{};
  /// Topics for HandTarget by side of the session; empty: the side accepts none.
  std::vector<std::string> hand_topics{};
  bool accepts_requests = false;          ///< topic /run_request
  bool accepts_changes = false;           ///< topic /tissue_change
  bool accepts_acknowledgements = false;  ///< topic /acknowledgement
};

/// All channels, with their schemas: the same text for every client.
[[nodiscard]] std::string advertisement(const ServerDescription& server);

enum class StatusLevel : std::uint8_t { kInfo = 0, kWarning = 1, kError = 2 };
/// @param id  for removeStatus; may be empty
[[nodiscard]] std::string status_text(StatusLevel level, std::string_view message,
                                      std::string_view id = {});
[[nodiscard]] std::string remove_status_text(std::string_view id);

/// Header of a binary data frame: opcode, subscription, time; little-endian.
using DataHeader = std::array<char, 13>;
[[nodiscard]] DataHeader data_header(std::uint32_t subscription, std::uint64_t log_time_ns);

/// Malformed messages get a status reply; nothing a client sends causes an exception.
/// Channels are counted from 0 here and from 1 on the wire.
class FoxgloveClient {
 public:
  /// `server` must outlive it. @param id  of this client, from 1
  FoxgloveClient(const ServerDescription& server, std::uint64_t id)
      : server_(server), id_(id), subscription_of_(server.channels.size()) {}

  [[nodiscard]] std::uint64_t id() const { return id_; }
  /// The server's first message; advertisement() is the second.
  [[nodiscard]] std::string server_info() const;

  /// Effects of one message.
  struct Outcome {
    std::vector<std::string> replies;     ///< texts
    std::vector<std::size_t> subscribed;  ///< channels, newly
    std::vector<std::size_t> unsubscribed;
    std::optional<ClientTopic> published{};
    std::size_t side = 0;   ///< kHandTarget: index in hand_topics
    std::string payload{};  ///< of what was published: a protobuf message, not decoded
  };
  [[nodiscard]] Outcome take_text(std::string_view text);
  [[nodiscard]] Outcome take_binary(std::string_view bytes);

  /// The client's id of its subscription to the channel, if it subscribes.
  [[nodiscard]] std::optional<std::uint32_t> subscription(std::size_t channel) const {
    return subscription_of_.at(channel);
  }

 private:
  const ServerDescription& server_;
  std::uint64_t id_;
  std::map<std::uint32_t, std::size_t> channel_of_;            // by subscription
  std::vector<std::optional<std::uint32_t>> subscription_of_;  // by channel
  struct Published {
    ClientTopic topic;
    std::size_t side = 0;
  };
  std::map<std::uint32_t, Published> topic_of_;  // by the client's id of its channel
};

}  // namespace palpate::viewer
