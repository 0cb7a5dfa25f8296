// report.h — `palpate report`: the figures of a recording as one HTML file with SVG plots. It loads
// no other resource and runs no script.
#pragma once

#include <string>

#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// Position, force before and after the clamp, energy, transparency, latency, and a table.
[[nodiscard]] std::string report_html(RecordingFile& recording);

/// Throws std::runtime_error if the file cannot be written.
void write_report(RecordingFile& recording, const std::string& file);

}  // namespace palpate
