// SPDX-License-Identifier: Apache-2.0
// web_audience.h — many WebSocket clients in one thread, as pages behind a network: each subscribes
// to what a page shows and reads as fast as it can.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace palpate::bench {

class WebAudience {
 public:
  /// Connects the clients one after another, on a thread of its own.
  WebAudience(std::uint16_t port, std::size_t clients);
  ~WebAudience();
  WebAudience(const WebAudience&) = delete;
  WebAudience& operator=(const WebAudience&) = delete;

  /// All clients leave at once and connect at once, as after a failure of the network: each tries
  /// again like a page that does not get in, after ¼ s, ½ s, … 2 s with jitter. with_scene() begins
  /// anew. Returns when all have left.
  void reconnect();

  /// Clients that have received the scene, and those whose connection has failed or ended by
  /// itself; attempts of reconnect() that did not get in.
  [[nodiscard]] std::size_t with_scene() const { return with_scene_; }
  [[nodiscard]] std::size_t lost() const { return lost_; }
  [[nodiscard]] std::size_t retries() const { return retries_; }

  /// Since the start; of all clients.
  [[nodiscard]] std::uint64_t bytes() const { return bytes_; }
  [[nodiscard]] std::uint64_t messages() const { return messages_; }
  [[nodiscard]] std::uint64_t mesh_bytes() const { return mesh_bytes_; }
  /// Meshes of each client since the start.
  [[nodiscard]] std::vector<std::uint64_t> meshes() const;
  /// Processor time of the thread, in s.
  [[nodiscard]] double processor_s() const;

 private:
  class Impl;
  friend class WebAudienceClient;
  std::atomic<std::size_t> with_scene_{0};
  std::atomic<std::size_t> lost_{0};
  std::atomic<std::size_t> retries_{0};
  std::atomic<std::uint64_t> bytes_{0};
  std::atomic<std::uint64_t> messages_{0};
  std::atomic<std::uint64_t> mesh_bytes_{0};
  std::unique_ptr<std::atomic<std::uint64_t>[]> meshes_;
  std::size_t clients_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate::bench
