// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/dds/node.h"

#include <netdb.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <string_view>

#include "common/core/check.h"
#include "deploy/ros/dds/loopback.h"

namespace palpate::ros {
namespace {

constexpr std::uint32_t kHighestDomain = 232;  // ports beyond would not exist
// As many participants on a machine as nodes of ROS 2 look for where there is no multicast.
constexpr int kMostParticipants = 32;
constexpr std::size_t kMostStrangers = 32;
constexpr std::size_t kMostLines = 100;
// A reliable reader that does not keep up makes its writer wait so long, in which nothing is shown.
constexpr dds_duration_t kLongestWait = DDS_MSECS(2);
constexpr int kSensorDepth = 5;
constexpr int kReliableDepth = 100;
constexpr int kLatchedDepth = 256;
constexpr std::size_t kLongestShown = 80;

using Qos = std::unique_ptr<dds_qos_t, decltype(&dds_delete_qos)>;

Qos qos_of(const TopicType& type) {
  Qos qos(dds_create_qos(), &dds_delete_qos);
  const std::string data = std::string("typehash=") + type.hash + ";";
  dds_qset_userdata(qos.get(), data.data(), data.size());
  return qos;
}

/// Letters of an address or of the name of an interface: nothing that XML would read otherwise.
bool is_plain(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' ||
           c == ':' || c == '-' || c == '_';
  });
}

bool is_address(const std::string& text) {
  return text.find_first_not_of("0123456789.") == std::string::npos;
}

/// An address or a name that this machine knows. Asks the network, maybe.
bool is_known(const std::string& host) {
  addrinfo* found = nullptr;
  const bool is_there = getaddrinfo(host.c_str(), nullptr, nullptr, &found) == 0;
  if (found != nullptr) freeaddrinfo(found);
  return is_there;
}

/// What strangers call themselves may be anything.
std::string shown(const char* text) {
  std::string result;
  for (const char* c = text; c != nullptr && *c != '\0' && result.size() < kLongestShown; ++c) {
    result += *c > ' ' && *c < '\x7F' && *c != '"' ? *c : '?';
  }
  return result;
}

/// Of USER_DATA; empty: it has none, as before Iron.
std::string hash_in(const dds_qos_t* qos) {
  void* bytes = nullptr;
  std::size_t size = 0;
  if (qos == nullptr || !dds_qget_userdata(qos, &bytes, &size) || bytes == nullptr) return {};
  const std::string data(static_cast<const char*>(bytes), size);
  dds_free(bytes);
  constexpr std::string_view kKey = "typehash=";
  const std::size_t begin = data.find(kKey);
  if (begin == std::string::npos) return {};
  const std::size_t from = begin + kKey.size();
  return data.substr(from, data.find(';', from) - from);
}

/// Of a type whose name is right.
std::string hash_complaint(const dds_builtintopic_endpoint_t& stranger, const TopicType& type) {
  const std::string hash = hash_in(stranger.qos);
  if (hash.empty() || hash == type.hash) return {};
  return "its definition of " + shown(stranger.type_name) + " is " + shown(hash.c_str()) +
         ", here it is " + type.hash + ": it comes from another version of the package";
}

/// On loopback it is confined before a participant may be found.
dds_entity_t create_domain(const Network& network) {
  const dds_entity_t domain = dds_create_domain(network.domain, configuration_of(network).c_str());
  if (domain < 0 || !network.is_loopback()) return domain;
  if (const std::string why = confine_to_loopback(network.domain); !why.empty()) {
    dds_delete(domain);
    throw SetupError("DDS cannot be kept on this machine (" + why +
                     "); if the network is yours alone, name one of its addresses with --interface "
                     "and --domain");
  }
  return domain;
}

}  // namespace

std::string ros_name_of(const TopicType& type) {
  std::string name = type.descriptor->m_typename;  // PACKAGE::msg::dds_::NAME_
  constexpr std::string_view kMiddle = "::msg::dds_::";
  name.replace(name.find(kMiddle), kMiddle.size(), "/msg/");
  name.pop_back();
  return name;
}

std::string text_of(const Network& network) {
  if (!network.rosbridge.empty()) return "rosbridge=" + network.rosbridge;
  return "domain=" + std::to_string(network.domain) + " interface=" + network.interface;
}

std::string configuration_of(const Network& network) {
  if (network.domain > kHighestDomain) {
    throw SetupError("--domain = " + std::to_string(network.domain) + ": must be 0 to 232");
  }
  if (!is_plain(network.interface)) {
    throw SetupError("--interface = " + network.interface +
                     ": must be the address or the name of an interface, such as 192.168.1.5");
  }
  std::string peers;
  const auto add_peer = [&](const std::string& peer) {
    if (!is_plain(peer)) throw SetupError("--peer = " + peer + ": must be an address");
    peers += "<Peer Address=\"" + peer + "\"/>";
  };
  if (network.is_loopback()) add_peer("127.0.0.1");
  for (const std::string& peer : network.peers) {
    add_peer(peer);
    if (network.is_loopback() && !peer.starts_with("127.")) {
      throw SetupError("--peer = " + peer +
                       ": nothing leaves this machine by --interface = " + network.interface +
                       "; give the address of the interface to it, and --domain");
    }
    if (!is_known(peer)) {
      throw SetupError("--peer = " + peer + ": no machine of that name or address is known");
    }
  }
  return "<CycloneDDS><Domain><General><Interfaces><NetworkInterface " +
         std::string(is_address(network.interface) ? "address" : "name") + "=\"" +
         network.interface + "\"" + (network.is_loopback() ? " multicast=\"false\"" : "") +
         "/></Interfaces><AllowMulticast>" + (network.is_loopback() ? "false" : "true") +
         "</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
         "<MaxAutoParticipantIndex>" +
         std::to_string(kMostParticipants) + "</MaxAutoParticipantIndex><Peers>" + peers +
         "</Peers></Discovery><Internal><MaxSampleSize>" + std::to_string(network.largest_bytes) +
         "B</MaxSampleSize></Internal></Domain></CycloneDDS>";
}

Entity::Entity(dds_entity_t entity, const std::string& what) : entity_(entity) {
  if (entity < 0) throw SetupError(what + " (" + dds_strretcode(-entity) + ")");
}

Entity::~Entity() {
  if (entity_ > 0) dds_delete(entity_);
}

Node::Node(const Network& network)
    : Node(network.rosbridge.empty() ? nullptr : std::make_unique<Rosbridge>(network.rosbridge),
           network) {}

Node::Node(std::unique_ptr<Rosbridge> bridge, const Network& network)
    : bridge_(std::move(bridge)),
      domain_(bridge_ ? Entity()
                      : Entity(create_domain(network),
                               "--interface = " + network.interface +
                                   ": DDS does not start there; is it an address or a name of "
                                   "this machine (ip address)?")),
      participant_(bridge_ ? Entity()
                           : Entity(dds_create_participant(network.domain, nullptr, nullptr),
                                    "DDS does not start at " + network.interface +
                                        "; is it an address or a name of this machine (ip "
                                        "address)?")),
      publications_(strangers(DDS_BUILTIN_TOPIC_DCPSPUBLICATION)),
      subscriptions_(strangers(DDS_BUILTIN_TOPIC_DCPSSUBSCRIPTION)) {}

Entity Node::strangers(dds_entity_t builtin_topic) const {
  if (bridge_) return {};
  return {dds_create_reader(participant_.get(), builtin_topic, nullptr, nullptr), "discovery"};
}

dds_entity_t Node::topic_of(const std::string& name, const TopicType& type) {
  // deleted with the participant; a topic of the same name and type may be created again
  const dds_entity_t topic =
      dds_create_topic(participant_.get(), type.descriptor, name.c_str(), nullptr, nullptr);
  if (topic < 0) throw SetupError("topic " + name + " (" + dds_strretcode(-topic) + ")");
  return topic;
}

Entity Node::make_writer(const std::string& topic, const TopicType& type, Offer offer) {
  const std::string name = "rt/" + topic;
  const Qos qos = qos_of(type);
  dds_qset_writer_data_lifecycle(qos.get(), false);
  if (offer == Offer::kSensorData) {
    dds_qset_reliability(qos.get(), DDS_RELIABILITY_BEST_EFFORT, 0);
    dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, kSensorDepth);
  } else {
    const int depth = offer == Offer::kLatched   ? kLatchedDepth
                      : offer == Offer::kCommand ? 1
                                                 : kReliableDepth;
    dds_qset_reliability(qos.get(), DDS_RELIABILITY_RELIABLE, kLongestWait);
    dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
    if (offer == Offer::kLatched) {
      dds_qset_durability(qos.get(), DDS_DURABILITY_TRANSIENT_LOCAL);
      dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, depth, DDS_LENGTH_UNLIMITED,
                                  DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
    }
  }
  Entity writer(dds_create_writer(participant_.get(), topic_of(name, type), qos.get(), nullptr),
                "topic " + name);
  locals_.emplace(name, Local{.type = type, .is_writer = true, .offer = offer});
  return writer;
}

Entity Node::make_reader(const std::string& topic, const TopicType& type, int depth,
                         bool is_of_kept) {
  const std::string name = "rt/" + topic;
  const Qos qos = qos_of(type);
  dds_qset_reliability(qos.get(),
                       is_of_kept ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, 0);
  if (is_of_kept) dds_qset_durability(qos.get(), DDS_DURABILITY_TRANSIENT_LOCAL);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  Entity reader(dds_create_reader(participant_.get(), topic_of(name, type), qos.get(), nullptr),
                "topic " + name);
  locals_.emplace(name, Local{.type = type});
  return reader;
}

Entity Node::arrivals_of(dds_entity_t reader) {
  Entity arrivals(dds_create_waitset(participant_.get()), "waiting for messages");
  // deleted with the reader
  const dds_entity_t condition = dds_create_readcondition(reader, DDS_ANY_STATE);
  if (dds_waitset_attach(arrivals.get(), condition, 0) < 0) {
    throw SetupError("waiting for messages: DDS does not");
  }
  return arrivals;
}

bool Node::wait(const Entity& arrivals, Duration longest) {
  return dds_waitset_wait(arrivals.get(), nullptr, 0, longest.count()) > 0;
}

void Node::note_strangers(const Say& say) {
  if (bridge_) {
    for (const std::string& line : bridge_->take_lines()) say("rosbridge", line);
    return;
  }
  note(publications_.get(), true, say);
  note(subscriptions_.get(), false, say);
}

void Node::note(dds_entity_t reader, bool are_writers, const Say& say) {
  std::array<void*, kMostStrangers> samples{};
  std::array<dds_sample_info_t, kMostStrangers> infos{};
  dds_guid_t own{};
  dds_get_guid(participant_.get(), &own);
  const dds_return_t count =
      dds_take(reader, samples.data(), infos.data(), kMostStrangers, kMostStrangers);
  for (std::size_t i = 0; i < static_cast<std::size_t>(std::max(count, 0)); ++i) {
    if (!infos[i].valid_data) continue;
    const auto& stranger = *static_cast<const dds_builtintopic_endpoint_t*>(samples[i]);
    if (std::memcmp(&stranger.participant_key, &own, sizeof own) == 0) continue;
    const std::string line = complaint_about(stranger, are_writers);
    if (!line.empty() && said_.size() < kMostLines && said_.insert(line).second) {
      say("ros_stranger", line);
    }
  }
  if (count > 0) dds_return_loan(reader, samples.data(), count);
}

/// A stranger's writer concerns a reader here, its reader a writer.
std::string Node::complaint_about(const dds_builtintopic_endpoint_t& stranger,
                                  bool is_writer) const {
  const auto [begin, end] = locals_.equal_range(stranger.topic_name);
  for (auto it = begin; it != end; ++it) {
    const Local& local = it->second;
    if (local.is_writer && is_writer) {
      return "a publisher of " + it->first.substr(3) +
             ": this program publishes it too, so whoever listens hears both: end one of the two, "
             "or give another --namespace";
    }
    if (local.is_writer == is_writer) continue;
    const std::string who = std::string(is_writer ? "a publisher" : "a subscriber") + " of " +
                            it->first.substr(3) + ": ";
    if (std::strcmp(stranger.type_name, local.type.descriptor->m_typename) != 0) {
      return who + "its type is " + shown(stranger.type_name) + ", here it is " +
             local.type.descriptor->m_typename + ": they do not meet";
    }
    if (const std::string hash = hash_complaint(stranger, local.type); !hash.empty()) {
      return who + hash + (is_writer ? "; what it sends is refused" : "");
    }
    if (is_writer) continue;
    dds_reliability_kind_t reliability = DDS_RELIABILITY_BEST_EFFORT;
    dds_duration_t wait = 0;
    dds_qget_reliability(stranger.qos, &reliability, &wait);
    if (reliability == DDS_RELIABILITY_RELIABLE && local.offer == Offer::kSensorData) {
      return who +
             "it asks for reliable, offered is best effort: it hears nothing; give it the QoS of "
             "sensor data, or give --reliable here";
    }
    dds_durability_kind_t durability = DDS_DURABILITY_VOLATILE;
    dds_qget_durability(stranger.qos, &durability);
    if (durability > (local.offer == Offer::kLatched ? DDS_DURABILITY_TRANSIENT_LOCAL
                                                     : DDS_DURABILITY_VOLATILE)) {
      return who +
             "it asks for messages of before it came (durability transient local), which are not "
             "offered: it hears nothing; ask for volatile";
    }
  }
  return {};
}

namespace {

using Endpoint =
    std::unique_ptr<dds_builtintopic_endpoint_t, decltype(&dds_builtintopic_free_endpoint)>;
Endpoint writer_of(dds_entity_t reader, std::uint64_t source) {
  return {dds_get_matched_publication_data(reader, source), &dds_builtintopic_free_endpoint};
}

}  // namespace

bool is_there(dds_entity_t reader, std::uint64_t source) {
  return writer_of(reader, source) != nullptr;
}

std::string complaint_about(dds_entity_t reader, std::uint64_t source, const TopicType& type) {
  const Endpoint stranger = writer_of(reader, source);
  return stranger ? hash_complaint(*stranger, type) : std::string();
}

}  // namespace palpate::ros
