// SPDX-License-Identifier: Apache-2.0
// node.h — a participant of DDS whose topics and types are those that nodes of ROS 2 expect: topic
// rt/NAME, type PACKAGE::msg::dds_::NAME_, the type's hash in USER_DATA. Its network is what the
// options say; no variable of the environment and no file adds to it. Or, where they name a
// rosbridge server, its client: the same topics as JSON.
#pragma once

#include <dds/dds.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "common/core/time.h"
#include "deploy/ros/dds/json_messages.h"
#include "deploy/ros/dds/messages.h"
#include "deploy/ros/rosbridge/rosbridge.h"

namespace palpate::ros {

/// Where strangers can be heard and hear. DDS asks nobody for a key: whoever is on that network, or
/// with loopback on that machine, may read and write the topics of the domain.
struct Network {
  std::uint32_t domain = 0;             ///< 0 … 232, as ROS_DOMAIN_ID
  std::string interface = "127.0.0.1";  ///< its address or name
  std::vector<std::string> peers{};     ///< addresses that are asked where multicast is not
  std::size_t largest_bytes = std::size_t{64} * 1024;  ///< of a sample, in or out
  std::string rosbridge{};  ///< address of a server, in place of DDS; empty: DDS

  [[nodiscard]] bool is_loopback() const {
    return interface == "lo" || interface.starts_with("127.");
  }
};

/// For the log: "domain=0 interface=127.0.0.1", "rosbridge=192.168.1.5:9090".
[[nodiscard]] std::string text_of(const Network& network);

/// The configuration of Cyclone DDS. Throws SetupError.
[[nodiscard]] std::string configuration_of(const Network& network);

/// How a topic is offered.
enum class Offer : std::uint8_t {
  kSensorData,  ///< best effort, keep last 5, as ROS 2 calls it
  kReliable,    ///< reliable, keep last 100
  kCommand,     ///< reliable, and only the newest is sent again
  kLatched,     ///< reliable, and kept for those that come later
};

/// An entity of DDS, deleted with what it contains at the end.
class Entity {
 public:
  /// None.
  Entity() = default;
  /// @throws SetupError  it is an error: "what (why)"
  Entity(dds_entity_t entity, const std::string& what);
  ~Entity();
  Entity(Entity&& other) noexcept : entity_(std::exchange(other.entity_, 0)) {}
  Entity& operator=(Entity&&) = delete;
  Entity(const Entity&) = delete;
  Entity& operator=(const Entity&) = delete;

  [[nodiscard]] dds_entity_t get() const { return entity_; }

 private:
  dds_entity_t entity_ = 0;
};

template <class T>
class Writer {
 public:
  explicit Writer(Entity writer) : writer_(std::move(writer)) {}
  /// @param bridge  must outlive it
  Writer(Rosbridge& bridge, std::string topic) : bridge_(&bridge), topic_(std::move(topic)) {}

  /// @return false: left out, because reliable readers, or the server, do not keep up
  bool write(const T& message) {
    if (bridge_ != nullptr) return bridge_->publish(topic_, json_of(message));
    return dds_write(writer_.get(), &message) == DDS_RETCODE_OK;
  }
  /// Matched so far, those that have gone included. Of a server's nothing is known: its
  /// connections.
  [[nodiscard]] std::uint32_t readers_so_far() const {
    return bridge_ != nullptr ? bridge_->connections() : matched().total_count;
  }
  [[nodiscard]] bool has_reader() const {
    return bridge_ != nullptr ? bridge_->is_connected() : matched().current_count > 0;
  }

 private:
  [[nodiscard]] dds_publication_matched_status_t matched() const {
    dds_publication_matched_status_t status{};
    dds_get_publication_matched_status(writer_.get(), &status);
    return status;
  }

  Entity writer_;
  Rosbridge* bridge_ = nullptr;
  std::string topic_;
};

/// What came with a message.
struct Arrival {
  std::uint64_t source = 0;  ///< of the writer, or of all behind one server; not 0
  std::int64_t sent_ns = 0;  ///< its wall clock, or when it came from the server
};

/// What is wrong with the type of the writer of a sample; empty: nothing.
[[nodiscard]] std::string complaint_about(dds_entity_t reader, std::uint64_t source,
                                          const TopicType& type);
/// Whether that writer is still matched.
[[nodiscard]] bool is_there(dds_entity_t reader, std::uint64_t source);

template <class T>
class Reader {
 public:
  static constexpr std::uint32_t kDepth = 8;

  explicit Reader(Entity reader) : reader_(std::move(reader)) {}
  explicit Reader(std::shared_ptr<Inbox> inbox) : inbox_(std::move(inbox)) {}

  /// Takes what has come since the last call, oldest first, of each burst the newest kDepth.
  template <class Take>
  void take(Take&& take) {
    if constexpr (std::is_same_v<T, WrenchStamped>) {
      if (inbox_) {
        for (const Inbox::Message& one : inbox_->take()) {
          ReadWrench wrench;
          read_json(*one.fields, wrench);
          take(wrench.message, Arrival{.source = 1, .sent_ns = one.received_ns});
        }
        return;
      }
    }
    std::array<void*, kDepth> samples{};
    std::array<dds_sample_info_t, kDepth> infos{};
    const dds_return_t count =
        dds_take(reader_.get(), samples.data(), infos.data(), kDepth, kDepth);
    for (std::size_t i = 0; i < static_cast<std::size_t>(count > 0 ? count : 0); ++i) {
      if (!infos[i].valid_data) continue;
      take(*static_cast<const T*>(samples[i]),
           Arrival{.source = infos[i].publication_handle, .sent_ns = infos[i].source_timestamp});
    }
    if (count > 0) dds_return_loan(reader_.get(), samples.data(), count);
  }
  [[nodiscard]] dds_entity_t get() const { return reader_.get(); }
  /// Whether the fields of what this writer sends are ours. By the thread of take().
  [[nodiscard]] bool is_known_type(std::uint64_t source) {
    if (inbox_) return true;  // a server compares types by name
    if (source != judged_source_) {
      judged_source_ = source;
      is_known_ = complaint_about(reader_.get(), source, TypeOf<T>::kType).empty();
    }
    return is_known_;
  }
  /// Matched now.
  [[nodiscard]] std::size_t writers() const {
    dds_subscription_matched_status_t status{};
    dds_get_subscription_matched_status(reader_.get(), &status);
    return status.current_count;
  }

 private:
  Entity reader_;
  std::shared_ptr<Inbox> inbox_;
  std::uint64_t judged_source_ = 0;  // whose type was looked at last
  bool is_known_ = false;
};

/// A participant or a client, its writers and readers. Its functions may be called by several
/// threads, but for writer() and reader().
class Node {
 public:
  /// @throws SetupError  wrong network
  explicit Node(const Network& network);

  /// @param topic  without rt/
  template <class T>
  [[nodiscard]] Writer<T> writer(const std::string& topic, Offer offer) {
    if (bridge_) {
      bridge_->advertise("/" + topic, ros_name_of(TypeOf<T>::kType), offer == Offer::kLatched);
      return Writer<T>(*bridge_, "/" + topic);
    }
    return Writer<T>(make_writer(topic, TypeOf<T>::kType, offer));
  }
  /// Of any writer, reliable or not. Keeps Reader::kDepth.
  template <class T>
  [[nodiscard]] Reader<T> reader(const std::string& topic) {
    if (bridge_) {
      if constexpr (std::is_same_v<T, WrenchStamped>) {
        return Reader<T>(bridge_->subscribe("/" + topic, ros_name_of(TypeOf<T>::kType)));
      }
      throw std::logic_error("of a rosbridge server only wrenches are read");
    }
    return Reader<T>(
        make_reader(topic, TypeOf<T>::kType, static_cast<int>(Reader<T>::kDepth), false));
  }
  /// Of writers that keep their newest message for those that come later: that one, too.
  template <class T>
  [[nodiscard]] Reader<T> reader_of_kept(const std::string& topic) {
    return Reader<T>(
        make_reader(topic, TypeOf<T>::kType, static_cast<int>(Reader<T>::kDepth), true));
  }

  /// For wait(): messages of this reader.
  [[nodiscard]] Entity arrivals_of(dds_entity_t reader);
  /// @return whether one is there; false: not within `longest`
  [[nodiscard]] static bool wait(const Entity& arrivals, Duration longest);

  using Say = std::function<void(const char* event, const std::string& line)>;
  /// Calls `say` for each stranger on these topics that is not understood or does not hear: another
  /// type, another definition of the type, a quality that is not offered. Each line once. At most
  /// 32 strangers a call, and 100 lines in all. Of a rosbridge server what take_lines() gives.
  void note_strangers(const Say& say);

 private:
  Node(std::unique_ptr<Rosbridge> bridge, const Network& network);
  [[nodiscard]] Entity strangers(dds_entity_t builtin_topic) const;

  struct Local {
    TopicType type;
    bool is_writer = false;
    Offer offer = Offer::kSensorData;
  };
  Entity make_writer(const std::string& topic, const TopicType& type, Offer offer);
  Entity make_reader(const std::string& topic, const TopicType& type, int depth, bool is_of_kept);
  [[nodiscard]] dds_entity_t topic_of(const std::string& name, const TopicType& type);
  [[nodiscard]] std::string complaint_about(const dds_builtintopic_endpoint_t& stranger,
                                            bool is_writer) const;
  void note(dds_entity_t reader, bool are_writers, const Say& say);

  std::unique_ptr<Rosbridge> bridge_;  // null: DDS
  Entity domain_;
  Entity participant_;
  Entity publications_;                       // of strangers
  Entity subscriptions_;                      // of strangers
  std::multimap<std::string, Local> locals_;  // by topic, with rt/
  std::set<std::string> said_;
};

}  // namespace palpate::ros
