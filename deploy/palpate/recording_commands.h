// recording_commands.h — `palpate info`, `palpate export`.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// What a recording holds and who made it. Reads all of it: a damaged chunk is told.
[[nodiscard]] nlohmann::ordered_json info_json(RecordingFile& recording);
[[nodiscard]] std::string info_text(RecordingFile& recording);

/// One row per device tick: columns of CsvWriter, nan where the recording does not know.
/// Throws SetupError or std::runtime_error if the table cannot be written.
void export_csv(RecordingFile& recording, const std::string& csv_file);

}  // namespace palpate
