// SPDX-License-Identifier: Apache-2.0
// rosbridge.h — a client of a rosbridge server (protocol 2, JSON over WebSocket): topics of ROS 2
// for networks that DDS does not cross. What is in the messages it does not know.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace palpate::ros {

/// The newest messages of one topic. By any thread.
class Inbox {
 public:
  static constexpr std::size_t kDepth = 8;

  struct Message {
    std::shared_ptr<const nlohmann::json> fields;  ///< an object
    std::int64_t received_ns = 0;                  ///< wall time
  };
  void put(Message message);
  /// What has come since the last call, oldest first.
  [[nodiscard]] std::vector<Message> take();

 private:
  std::mutex mutex_;
  std::deque<Message> messages_;
};

/// A connection that is opened anew until the end; its own thread. Its functions may be called by
/// several threads.
class Rosbridge {
 public:
  /// What a server takes at most, unless its max_message_size is raised.
  static constexpr std::size_t kLargestBytes = 9'000'000;

  /// @param address  HOST or HOST:PORT, with ws:// before it or not; port 9090 is that of rosbridge
  /// @throws SetupError  it is none
  explicit Rosbridge(const std::string& address);
  ~Rosbridge();
  Rosbridge(const Rosbridge&) = delete;
  Rosbridge& operator=(const Rosbridge&) = delete;

  /// @param topic  absolute: /palpate/measured_cp   @param type  geometry_msgs/msg/PoseStamped
  /// @param is_kept  the newest message is for those that come later, too
  void advertise(const std::string& topic, const std::string& type, bool is_kept);
  [[nodiscard]] std::shared_ptr<Inbox> subscribe(const std::string& topic, const std::string& type);

  /// @param json  the fields of the message
  /// @return false: left out, because it is too large or the server does not keep up. Where there
  /// is
  ///         no server, nobody listens, and that is true.
  bool publish(const std::string& topic, const std::string& json);

  [[nodiscard]] bool is_connected() const;
  /// So far.
  [[nodiscard]] std::uint32_t connections() const;
  /// What a person should know: the connection begins or ends, what the server complains of.
  [[nodiscard]] std::vector<std::string> take_lines();

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::ros
