// SPDX-License-Identifier: Apache-2.0
// recorded_score.h — the score of the task in a recording.
#pragma once

#include <functional>

#include "common/task/score.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// Of the session that was recorded. Throws SetupError: it has no task, or cannot be read here.
/// @param on_progress  called with the share that is read, 0 … 1; may be empty
[[nodiscard]] TaskScore score_of(RecordingFile& recording,
                                 const std::function<void(double)>& on_progress = {});

/// Whether the recorded session has a task, as far as it can be read here.
[[nodiscard]] bool has_task(const RecordingFile& recording);

}  // namespace palpate
