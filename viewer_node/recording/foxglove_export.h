// SPDX-License-Identifier: Apache-2.0
// foxglove_export.h — a recording for Foxglove, Lichtblick and Rerun: the channels of the live
// WebSocket that need no knowledge of Palpate's messages.
#pragma once

#include <functional>
#include <string>

#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// Writes, of every side: /telemetry (palpate.v1.Telemetry: scalars of every tick), /scene
/// (foxglove.SceneUpdate: tool and forces) and /tf, 30 times a second; of all: /tissue/points
/// (foxglove.PointCloud), at most 10 times a second and while tissue moves, and /log
/// (foxglove.Log: events of the nodes, markers). The file appears when it is complete. Throws
/// SetupError, std::runtime_error if writing fails.
/// @param on_progress  called with the share that is read, 0 … 1; may be empty
void export_foxglove(RecordingFile& recording, const std::string& file, bool may_overwrite,
                     const std::function<void(double)>& on_progress = {});

}  // namespace palpate
