// SPDX-License-Identifier: Apache-2.0
// lockstep_recorder.h — records a lockstep run: the batches that the nodes would publish, on
// virtual time. The same session gives the same file, bit for bit.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "common/core/scene_messages.h"
#include "common/session/session.h"
#include "deploy/lockstep/lockstep.h"
#include "viewer_node/recording/recording.h"

namespace palpate {

/// The scene of the session as a recording of it begins with. Throws SetupError if a file of it
/// cannot be used.
[[nodiscard]] SceneState lockstep_scene(const Session& session);

class LockstepRecorder {
 public:
  /// Throws SetupError if the file cannot be created.
  /// @param session  must outlive the recorder
  LockstepRecorder(const viewer::RecordOptions& options, const Session& session,
                   const std::string& recorded_by);
  ~LockstepRecorder();
  LockstepRecorder(const LockstepRecorder&) = delete;
  LockstepRecorder& operator=(const LockstepRecorder&) = delete;

  /// Sets the callbacks of the run; on_physics_tick keeps its own. Call it before the run is
  /// constructed.
  void listen_to(LockstepOptions& options);
  /// Writes a batch of every node for each 20 ms of the run, and the ideal force if there is one.
  /// Call it for every row.
  void pump(const Lockstep& lockstep, const TickRow& row, const IdealState& ideal);
  /// Writes the rest and closes the file. Throws std::runtime_error if anything was not written.
  void finish(const Lockstep& lockstep, TimePoint now);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate
