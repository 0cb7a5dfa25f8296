// SPDX-License-Identifier: Apache-2.0
// report.h — `palpate report`: the figures of one recording, or of two side by side, as one HTML
// file. It contains its script and its data, and loads nothing.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// A table, the events, and figures to zoom and to read: position, force before and after the clamp
/// and, where it is recorded, the ideal one, energy, transparency, latency. A damaged recording is
/// said to be damaged. Without npm at build time there are no figures.
/// @param on_progress  called with the share that is read, 0 … 1; may be empty
[[nodiscard]] std::string report_html(const std::vector<std::unique_ptr<RecordingFile>>& recordings,
                                      const std::function<void(double)>& on_progress = {});

}  // namespace palpate
