// web_log.h — /log: the events of the nodes, for web clients.
#pragma once

#include <cstddef>
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

  /// Publishes one line. @param node  its source
  void write(LogLevel level, const std::string& node, const std::string& message);

  // Publish the events of a node, derived from its batches. @param side  index in session.sides
  void note(std::size_t side, const DeviceBatch& batch, TimePoint now);
  void note(std::size_t side, const MofcBatch& batch, TimePoint now);
  void note(std::size_t side, const PhysicsBatch& batch, TimePoint now);

 private:
  struct Side {
    Side(WebLog& log, const std::string& name);
    RemoteEvents<DeviceTick, DeviceCounters> device;
    RemoteEvents<MofcTick, MofcCounters> mofc;
    RemoteEvents<PhysicsTick, PhysicsCounters> physics;
  };
  [[nodiscard]] OnEventLine line_writer(const std::string& node);

  WebServer& server_;
  std::list<Side> sides_;
};

}  // namespace palpate::viewer
