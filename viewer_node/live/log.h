// SPDX-License-Identifier: Apache-2.0
// web_log.h — /log: the events of the nodes, for web clients, also for those that connect later.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <list>
#include <string>

#include "common/link/codec/viewer_codec.h"
#include "common/session/session.h"
#include "common/telemetry/remote_events.h"
#include "viewer_node/server/web_server.h"

namespace palpate::viewer {

class WebLog {
 public:
  /// `server` must outlive it.
  WebLog(const Session& session, WebServer& server);
  WebLog(const WebLog&) = delete;
  WebLog& operator=(const WebLog&) = delete;

  /// Of the newest lines, which a new subscriber gets.
  static constexpr std::size_t kMostKept = 512;

  /// Publishes one line and keeps it. @param node  its source
  void write(LogLevel level, const std::string& node, const std::string& message);

  // Publish the events of a node, derived from its batches. @param side  index in session.sides
  void note(std::size_t side, const DeviceBatch& batch, TimePoint now);
  void note(std::size_t side, const MofcBatch& batch, TimePoint now);
  void note(std::size_t side, const PhysicsBatch& batch, TimePoint now);
  /// Ends episodes. Call it a few times a second.
  void pump(TimePoint now);

  /// Sends a new subscriber of /log what was kept.
  void send_history_to(std::uint64_t client);

 private:
  /// The times in which the clamp reduces the force, from its counter of ticks.
  struct ClampEpisode {
    std::uint64_t session_id = 0;
    std::uint64_t ticks = 0;         // counted so far
    std::uint64_t ticks_before = 0;  // at the beginning of the episode
    bool is_under_way = false;
    TimePoint grew_at{};
  };
  struct Line {
    std::uint64_t at_ns = 0;
    Payload payload;
  };
  struct Side {
    Side(WebLog& log, const std::string& name);
    RemoteEvents<DeviceTick, DeviceCounters> device;
    RemoteEvents<MofcTick, MofcCounters> mofc;
    RemoteEvents<PhysicsTick, PhysicsCounters> physics;
    std::string mofc_name;
    ClampEpisode clamp;
  };
  [[nodiscard]] OnEventLine line_writer(const std::string& node);

  WebServer& server_;
  std::list<Side> sides_;
  std::deque<Line> kept_;
};

}  // namespace palpate::viewer
