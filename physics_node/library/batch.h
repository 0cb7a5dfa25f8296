// SPDX-License-Identifier: Apache-2.0
// batch.h — many simulations of one scene, over threads.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "physics_node/library/simulation.h"

namespace palpate::physics {

/// What a simulation does depends on its own tools alone, not on the others nor on the threads. One
/// thread calls it.
class Batch {
 public:
  /// @param scenes, tools, threads  ≥ 1; the caller's thread is one of them
  Batch(std::shared_ptr<const SharedScene> shared, std::size_t scenes, std::size_t tools,
        std::size_t threads);
  ~Batch();
  Batch(const Batch&) = delete;
  Batch& operator=(const Batch&) = delete;

  /// All simulations make this step. If one throws, the others go on, and the first exception is
  /// thrown at the end.
  /// @param tools, forces  those of the first simulation, then of the next
  /// @see Simulation::step
  void step(std::span<const Simulation::Target> tools, Duration dt, std::uint32_t parts,
            std::span<ToolForce> forces);

  /// @pre  index < size()
  [[nodiscard]] Simulation& at(std::size_t index) { return *simulations_[index]; }
  [[nodiscard]] const Simulation& at(std::size_t index) const { return *simulations_[index]; }
  [[nodiscard]] std::size_t size() const noexcept { return simulations_.size(); }
  [[nodiscard]] std::size_t tools() const noexcept { return tools_; }
  [[nodiscard]] bool is_folded() const noexcept { return is_folded_; }
  /// Of a scene that was never touched, as at the start. Milliseconds.
  void reset(std::size_t index, TimePoint time);

 private:
  struct Order {
    std::span<const Simulation::Target> tools{};
    Duration dt{};
    std::uint32_t parts = 1;
    std::span<ToolForce> forces{};
  };
  void serve(const std::stop_token& stop);
  void work();

  std::size_t tools_;
  bool is_folded_;
  std::vector<std::unique_ptr<Simulation>> simulations_;
  Simulation untouched_;
  Order order_;
  std::atomic<std::size_t> next_{0};  // simulation that nobody has begun
  std::mutex mutex_;
  std::condition_variable_any ordered_;
  std::condition_variable_any done_;
  std::uint64_t orders_ = 0;
  std::size_t busy_ = 0;  // threads, of the last order
  std::exception_ptr failed_;
  std::vector<std::jthread> threads_;
};

}  // namespace palpate::physics
