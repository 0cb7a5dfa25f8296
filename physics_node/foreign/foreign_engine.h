// SPDX-License-Identifier: Apache-2.0
// foreign_engine.h — an engine from elsewhere (physics.h) as PhysicsNode calls it: conversion,
// checks, contact models for what it only tells as a force, and its surfaces for the viewers.
#pragma once

#include <array>
#include <exception>
#include <memory>
#include <mutex>
#include <vector>

#include "physics_node/engine.h"
#include "physics_node/foreign/contact_estimator.h"
#include "physics_node/sdk/physics.h"

namespace palpate::physics {

/// The newest vertices of each surface of an engine, between its thread and that of the viewers.
class MovedSurfaces {
 public:
  /// Asked for after each frame while somebody watches; by the viewers' thread.
  void request() {
    const std::scoped_lock lock(mutex_);
    is_wanted_ = true;
  }
  /// Takes what has moved if it is wanted; by the engine's thread. What viewers hold up waits.
  void collect(sdk::Engine& engine);
  /// Exchanges the vertices of a surface with those given; false if it has not moved since.
  bool take(std::size_t surface, std::vector<float>& vertices_m);
  /// At rest, and how many there are; before the threads start.
  void reset(const std::vector<sdk::Surface>& surfaces);

 private:
  struct Moved {
    std::vector<float> vertices_m;  // the engine's
    std::vector<float> newest_m;    // for viewers
    bool is_new = false;
  };
  std::mutex mutex_;
  bool is_wanted_ = false;
  std::vector<Moved> surfaces_;
};

class ForeignEngine final : public Engine {
 public:
  /// @param has_estimate  false: no contact models, mofc_node holds the force
  /// @param surfaces      of this engine; null: those of another one are shown
  ForeignEngine(std::unique_ptr<sdk::Engine> engine, bool has_estimate,
                std::shared_ptr<MovedSurfaces> surfaces = {});

  /// What the engine throws is kept for rethrow(), as is the refusal of an answer out of range.
  bool step(const ToolMotion& motion, bool is_new, TimePoint now,
            Interaction& answer) noexcept override;
  void rethrow() override;

 private:
  struct Estimated {
    std::uint32_t tissue = 0;
    ContactEstimator estimator;
  };
  /// What the answer tells of one tissue that has no stiffness.
  struct Group {
    std::uint32_t tissue = 0;
    Observation seen;
  };

  void fill(const sdk::Answer& answer, const ToolMotion& motion, Interaction& out);
  [[nodiscard]] std::vector<Group> groups_of(const sdk::Answer& answer,
                                             const ToolMotion& motion) const;
  void estimate(const sdk::Answer& answer, const ToolMotion& motion,
                std::vector<Contact>& contacts);
  /// What force_at() says of the tissue of an engine that tells only forces.
  void look(Estimated& tissue, Observation& seen);

  std::unique_ptr<sdk::Engine> engine_;
  bool has_estimate_;
  std::shared_ptr<MovedSurfaces> surfaces_;
  std::vector<Estimated> estimated_;
  std::exception_ptr error_;
};

}  // namespace palpate::physics
