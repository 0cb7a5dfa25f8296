// SPDX-License-Identifier: Apache-2.0
#include "physics_node/library/batch.h"

#include <utility>

namespace palpate::physics {
namespace {

// More than so many simulations are folded: ten megabytes each become three, for an elastic body of
// some thousand nodes, and a solution takes some half longer.
constexpr std::size_t kMostUnfolded = 64;

}  // namespace

Batch::Batch(std::shared_ptr<const SharedScene> shared, std::size_t scenes, std::size_t tools,
             std::size_t threads)
    : tools_(tools), is_folded_(scenes > kMostUnfolded), untouched_(shared, tools, is_folded_) {
  for (std::size_t i = 0; i < scenes; ++i) {
    simulations_.push_back(std::make_unique<Simulation>(shared, tools, is_folded_));
  }
  for (std::size_t i = 1; i < threads; ++i) {
    threads_.emplace_back([this](const std::stop_token& stop) { serve(stop); });
  }
}

Batch::~Batch() {
  for (std::jthread& thread : threads_) thread.request_stop();
}

void Batch::step(std::span<const Simulation::Target> tools, Duration dt, std::uint32_t parts,
                 std::span<ToolForce> forces) {
  {
    const std::scoped_lock lock(mutex_);
    order_ = {.tools = tools, .dt = dt, .parts = parts, .forces = forces};
    next_ = 0;
    busy_ = threads_.size();
    ++orders_;
  }
  ordered_.notify_all();
  work();
  std::unique_lock lock(mutex_);
  done_.wait(lock, [this] { return busy_ == 0; });
  if (failed_) std::rethrow_exception(std::exchange(failed_, nullptr));
}

void Batch::serve(const std::stop_token& stop) {
  std::uint64_t served = 0;
  std::unique_lock lock(mutex_);
  while (ordered_.wait(lock, stop, [&] { return orders_ != served; })) {
    served = orders_;
    lock.unlock();
    work();
    lock.lock();
    if (--busy_ == 0) done_.notify_one();
  }
}

void Batch::work() {
  for (std::size_t i = next_++; i < simulations_.size(); i = next_++) {
    try {
      simulations_[i]->step(order_.tools.subspan(i * tools_, tools_), order_.dt, order_.parts,
                            order_.forces.subspan(i * tools_, tools_));
    } catch (...) {
      const std::scoped_lock lock(mutex_);
      if (!failed_) failed_ = std::current_exception();
    }
  }
}

void Batch::reset(std::size_t index, TimePoint time) {
  simulations_[index]->continue_as(untouched_);
  simulations_[index]->begin_at(time);
}

}  // namespace palpate::physics
