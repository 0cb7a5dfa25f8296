// SPDX-License-Identifier: Apache-2.0
// report_data.h — what a report draws: the columns of a recording, reduced, and its events.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "viewer_node/recording/recording_file.h"
#include "viewer_node/recording/run_figures.h"

namespace palpate {

/// Something that happened during a run.
struct ReportEvent {
  double t_s = 0.0;   ///< since the first recorded tick
  std::string level;  ///< "info", "warn", "error" or "marker"
  std::string source;
  std::string text;
};

/// One recording, or one side of it, for a report.
struct ReportRun {
  RecordedRun run;
  std::vector<ReportEvent> events;  ///< in order of time
  nlohmann::json figures;           ///< for the script: see web/src/report.ts
};

/// Points of a figure over time: longer recordings are reduced to the smallest and the largest
/// value of equal parts, so that peaks stay.
inline constexpr std::size_t kMostReportPoints = 8000;

/// Reads the chosen side of the recording. @param on_progress  see report_html()
void read_report(RecordingFile& recording, ReportRun& report,
                 const std::function<void(double)>& on_progress);

/// Titles of the figures that read_report() gives, in order; one without series has nothing to
/// show.
[[nodiscard]] const std::vector<std::string>& report_titles();

}  // namespace palpate
