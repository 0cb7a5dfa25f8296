// SPDX-License-Identifier: Apache-2.0
// thinned_telemetry.h — /device, /mofc and /physics for an audience: a few batches a second with
// some of the ticks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/link/codec/codec.h"
#include "common/session/session.h"
#include "viewer_node/live/channels.h"
#include "viewer_node/server/web_server.h"

namespace palpate::viewer {

class ThinnedTelemetry {
 public:
  /// References must outlive it. @param interval  between two batches of a node
  ThinnedTelemetry(const Session& session, WebServer& server, Duration interval);

  /// @param side  index in session.sides
  void take(std::size_t side, const DeviceBatch& batch) { keep(device_[side], batch); }
  void take(std::size_t side, const MofcBatch& batch) { keep(mofc_[side], batch); }
  void take(std::size_t side, const PhysicsBatch& batch) { keep(physics_[side], batch); }
  /// Publishes what is due.
  void pump(TimePoint now);

 private:
  template <class Batch>
  struct Node {
    std::size_t channel = 0;
    std::uint64_t stride = 1;  // every so many ticks one is kept
    std::optional<Batch> next{};
    std::uint64_t sent = 0;  // batches of this session of the node
    Codec<Batch> codec{};
  };
  template <class Batch>
  void keep(Node<Batch>& node, const Batch& batch);
  template <class Batch>
  void publish(Node<Batch>& node);

  WebServer& server_;
  Duration interval_;
  TimePoint next_at_{};
  std::vector<Node<DeviceBatch>> device_;
  std::vector<Node<MofcBatch>> mofc_;
  std::vector<Node<PhysicsBatch>> physics_;
};

}  // namespace palpate::viewer
