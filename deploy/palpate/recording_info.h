// recording_info.h — what a recording contains, and its ticks as a table.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// Contents and origin of a recording. Reads the whole file, so damaged chunks are reported.
[[nodiscard]] nlohmann::ordered_json info_json(RecordingFile& recording);
[[nodiscard]] std::string info_text(RecordingFile& recording);

/// One row per device tick with the columns of CsvWriter; nan where the recording has no value.
/// Throws SetupError if the file cannot be created, std::runtime_error if writing fails.
void export_csv(RecordingFile& recording, const std::string& csv_file);

}  // namespace palpate
