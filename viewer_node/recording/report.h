// report.h — `palpate report`: the figures of a recording as one HTML file with SVG plots. It loads
// no other resource and runs no script.
#pragma once

#include <functional>
#include <string>

#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// Position, force before and after the clamp, energy, transparency, latency, and a table.
/// @param on_progress  called for every tick with the share that is read, 0 … 1; may be empty
[[nodiscard]] std::string report_html(RecordingFile& recording,
                                      const std::function<void(double)>& on_progress = {});

}  // namespace palpate
