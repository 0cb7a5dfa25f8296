// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/server/foxglove_client.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/core/user/utf8.h"

namespace palpate::viewer {
namespace {

using Json = nlohmann::ordered_json;

struct AcceptedTopic {
  ClientTopic topic;
  std::string_view name;
  std::string_view schema;
  std::size_t side = 0;
};
constexpr std::size_t kMostClientChannels = 8;  // beside a hand target of each side

/// What clients of this server may publish.
std::vector<AcceptedTopic> accepted_topics(const ServerDescription& server) {
  std::vector<AcceptedTopic> topics;
  for (std::size_t side = 0; side < server.hand_topics.size(); ++side) {
    const std::string& name = server.hand_topics[side];
    if (name.empty()) continue;
    topics.push_back({ClientTopic::kHandTarget, name, "palpate.v1.HandTarget", side});
  }
  const auto add = [&](bool is_accepted, const AcceptedTopic& topic) {
    if (is_accepted) topics.push_back(topic);
  };
  add(server.accepts_requests, {ClientTopic::kRunRequest, "/run_request", "palpate.v1.RunRequest"});
  add(server.accepts_changes,
      {ClientTopic::kTissueChange, "/tissue_change", "palpate.v1.TissueChange"});
  add(server.accepts_acknowledgements,
      {ClientTopic::kAcknowledgement, "/acknowledgement", "palpate.v1.Acknowledgement"});
  return topics;
}
constexpr std::size_t kMaxComplaints = 8;  // per message
constexpr std::size_t kMaxQuotedBytes = 40;
constexpr char kClientData = 1;  // opcode

std::string in_quotes(std::string_view text) {
  return "\"" + std::string(text.substr(0, kMaxQuotedBytes)) + "\"";
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto byte = i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0U;
      group = (group << 8) | byte;
    }
    for (std::size_t k = 0; k < 4; ++k) {
      const bool is_padding = i + k > bytes.size();
      text += is_padding ? '=' : kDigits[(group >> (18 - 6 * k)) & 63];
    }
  }
  return text;
}

/// The member, if it is a number of 32 bits.
std::optional<std::uint32_t> number(const Json& object, const char* name) {
  const auto member = object.is_object() ? object.find(name) : object.end();
  if (!object.is_object() || member == object.end() || !member->is_number_unsigned()) {
    return std::nullopt;
  }
  const auto value = member->get<std::uint64_t>();
  if (value > std::numeric_limits<std::uint32_t>::max()) return std::nullopt;
  return static_cast<std::uint32_t>(value);
}

std::string text_of(const Json& object, const char* name) {
  const auto member = object.is_object() ? object.find(name) : object.end();
  const bool is_text = object.is_object() && member != object.end() && member->is_string();
  return is_text ? member->get<std::string>() : std::string();
}

/// A list member; empty if missing.
const Json& list(const Json& object, const char* name) {
  static const Json kNone = Json::array();
  const auto member = object.find(name);
  return member != object.end() && member->is_array() ? *member : kNone;
}

class Complaints {
 public:
  explicit Complaints(std::vector<std::string>& replies) : replies_(replies) {}
  void add(const std::string& message) {
    if (count_++ < kMaxComplaints) replies_.push_back(status_text(StatusLevel::kError, message));
  }

 private:
  std::vector<std::string>& replies_;
  std::size_t count_ = 0;
};

/// The one of the topics that the client wants to publish on; null: none.
const AcceptedTopic* find(const Json& offered, const std::vector<AcceptedTopic>& topics) {
  if (text_of(offered, "encoding") != "protobuf") return nullptr;
  const std::string name = text_of(offered, "topic");
  const std::string schema = text_of(offered, "schemaName");
  const auto found = std::find_if(topics.begin(), topics.end(), [&](const AcceptedTopic& topic) {
    return name == topic.name && schema == topic.schema;
  });
  return found == topics.end() ? nullptr : &*found;
}

std::string accepted_words(const std::vector<AcceptedTopic>& topics) {
  std::string words;
  for (const AcceptedTopic& topic : topics) {
    words += (words.empty() ? "" : " and ") + std::string(topic.name) + ", protobuf " +
             std::string(topic.schema);
  }
  return "advertise: only " + words + " is accepted";
}

}  // namespace

std::string status_text(StatusLevel level, std::string_view message, std::string_view id) {
  Json json = {{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}};
  if (!id.empty()) json["id"] = id;
  return json_text(json);
}

std::string remove_status_text(std::string_view id) {
  return json_text(Json{{"op", "removeStatus"}, {"statusIds", Json::array({id})}});
}

DataHeader data_header(std::uint32_t subscription, std::uint64_t log_time_ns) {
  DataHeader header{};
  header[0] = 1;
  for (std::size_t i = 0; i < 4; ++i) header[1 + i] = static_cast<char>(subscription >> (8 * i));
  for (std::size_t i = 0; i < 8; ++i) header[5 + i] = static_cast<char>(log_time_ns >> (8 * i));
  return header;
}

std::string FoxgloveClient::server_info() const {
  Json info = {
      {"op", "serverInfo"},
      {"name", server_.name},
      {"capabilities", Json::array()},
      {"sessionId", server_.session_id},
      {"metadata", {{"client_id", std::to_string(id_)}, {"session", server_.session_name}}}};
  const std::vector<AcceptedTopic> accepted = accepted_topics(server_);
  if (!accepted.empty()) {
    info["capabilities"].push_back("clientPublish");
    info["supportedEncodings"] = Json::array({"protobuf"});
    std::string topics;
    for (const AcceptedTopic& topic : accepted) {
      topics += (topics.empty() ? "" : " ") + std::string(topic.name);
    }
    info["metadata"]["client_topics"] = topics;
  }
  return json_text(info);
}

std::string advertisement(const ServerDescription& server) {
  Json channels = Json::array();
  for (std::size_t i = 0; i < server.channels.size(); ++i) {
    const Channel& channel = server.channels[i];
    channels.push_back({{"id", i + 1},
                        {"topic", channel.topic},
                        {"encoding", "protobuf"},
                        {"schemaName", channel.schema_name},
                        {"schemaEncoding", "protobuf"},
                        {"schema", base64(channel.schema)}});
  }
  return json_text(Json{{"op", "advertise"}, {"channels", std::move(channels)}});
}

FoxgloveClient::Outcome FoxgloveClient::take_text(std::string_view text) {
  Outcome outcome;
  Complaints complaints(outcome.replies);
  const Json message = Json::parse(text, nullptr, false);
  if (!message.is_object()) {
    complaints.add("a text message must be a JSON object with an op");
    return outcome;
  }

  const std::string op = text_of(message, "op");
  if (op == "subscribe") {
    for (const Json& wanted : list(message, "subscriptions")) {
      const auto id = number(wanted, "id");
      const auto channel = number(wanted, "channelId");
      if (!id || !channel || *channel == 0 || *channel > server_.channels.size()) {
        complaints.add("subscribe: needs an id and the channelId of an advertised channel");
      } else if (channel_of_.contains(*id)) {
        complaints.add("subscribe: id " + std::to_string(*id) + " is in use");
      } else if (subscription(*channel - 1)) {
        complaints.add("subscribe: channel " + std::to_string(*channel) +
                       " is already subscribed to");
      } else {
        channel_of_[*id] = *channel - 1;
        subscription_of_[*channel - 1] = *id;
        outcome.subscribed.push_back(*channel - 1);
      }
    }
  } else if (op == "unsubscribe") {
    for (const Json& id : list(message, "subscriptionIds")) {
      const auto it = id.is_number_unsigned() && id.get<std::uint64_t>() <= ~std::uint32_t{0}
                          ? channel_of_.find(id.get<std::uint32_t>())
                          : channel_of_.end();
      if (it == channel_of_.end()) {
        complaints.add("unsubscribe: no such subscription");
        continue;
      }
      outcome.unsubscribed.push_back(it->second);
      subscription_of_[it->second].reset();
      channel_of_.erase(it);
    }
  } else if (op == "advertise" && !accepted_topics(server_).empty()) {
    const std::vector<AcceptedTopic> topics = accepted_topics(server_);
    const std::size_t most = kMostClientChannels + server_.hand_topics.size();
    for (const Json& offered : list(message, "channels")) {
      const auto id = number(offered, "id");
      const AcceptedTopic* const topic = find(offered, topics);
      if (id && topic != nullptr && (topic_of_.contains(*id) || topic_of_.size() < most)) {
        topic_of_[*id] = {topic->topic, topic->side};
      } else {
        complaints.add(accepted_words(topics));
      }
    }
  } else if (op == "unadvertise" && !accepted_topics(server_).empty()) {
    for (const Json& id : list(message, "channelIds")) {
      if (id.is_number_unsigned() && id.get<std::uint64_t>() <= ~std::uint32_t{0}) {
        topic_of_.erase(id.get<std::uint32_t>());
      }
    }
  } else {
    complaints.add("op " + in_quotes(op) + " is not supported");
  }
  return outcome;
}

FoxgloveClient::Outcome FoxgloveClient::take_binary(std::string_view bytes) {
  constexpr std::size_t kHeaderBytes = 5;  // opcode, the client's id of the channel
  Outcome outcome;
  std::uint32_t channel = 0;
  if (bytes.size() >= kHeaderBytes) {
    for (std::size_t i = 4; i > 0; --i) {
      channel = (channel << 8) | static_cast<unsigned char>(bytes[i]);
    }
  }
  const auto topic = topic_of_.find(channel);
  if (bytes.size() < kHeaderBytes || bytes[0] != kClientData || topic == topic_of_.end()) {
    Complaints(outcome.replies).add("a binary message must be data of an advertised channel");
    return outcome;
  }
  outcome.published = topic->second.topic;
  outcome.side = topic->second.side;
  outcome.payload = bytes.substr(kHeaderBytes);
  return outcome;
}

}  // namespace palpate::viewer
