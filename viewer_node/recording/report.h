// SPDX-License-Identifier: Apache-2.0
// report.h — `palpate report`: the figures of one recording, or of two side by side, as one HTML
// file. It contains its script and its data, and loads nothing.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// What is said of one recording below its verdict: sentences, and a table.
struct ReportSection {
  std::string title;  ///< of the first section that has one; empty: there is nothing to say
  std::vector<std::string> sentences{};
  std::vector<std::pair<std::string, std::string>> figures{};
};

/// A table, the events, and figures to zoom and to read: position, force before and after the clamp
/// and, where it is recorded, the ideal one, energy, transparency, latency. A damaged recording is
/// said to be damaged. Without npm at build time there are no figures.
/// @param on_progress  called with the share that is read, 0 … 1; may be empty
/// @param sections     of each recording; empty: none has one
[[nodiscard]] std::string report_html(const std::vector<std::unique_ptr<RecordingFile>>& recordings,
                                      const std::function<void(double)>& on_progress = {},
                                      const std::vector<ReportSection>& sections = {});

}  // namespace palpate
