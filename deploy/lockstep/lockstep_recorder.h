// lockstep_recorder.h — a lockstep run as a recording: the batches that its nodes would have
// published, on virtual time. The same session gives the same file, to the bit.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "common/session/session.h"
#include "deploy/lockstep/lockstep.h"
#include "viewer_node/recording/recording.h"

namespace palpate {

class LockstepRecorder {
 public:
  /// Throws SetupError if the file cannot be made. @param session  must outlive it
  LockstepRecorder(const viewer::RecordOptions& options, const Session& session,
                   const std::string& recorded_by);
  ~LockstepRecorder();
  LockstepRecorder(const LockstepRecorder&) = delete;
  LockstepRecorder& operator=(const LockstepRecorder&) = delete;

  /// Sets the callbacks of a run to come.
  void listen_to(LockstepOptions& options);
  /// Writes a batch of every node each 20 ms of the run.
  /// @param now  counted from the start, never less than before
  void pump(const Lockstep& lockstep, TimePoint now);
  /// Writes what is left and closes. Throws std::runtime_error if anything could not be written.
  void finish(const Lockstep& lockstep, TimePoint now);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace palpate
