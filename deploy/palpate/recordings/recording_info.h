// SPDX-License-Identifier: Apache-2.0
// recording_info.h — what a recording contains, and its ticks as a table.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "viewer_node/recording/recording_file.h"

namespace palpate {

/// Contents and origin of a recording. Reads the whole file, so damaged chunks are reported.
[[nodiscard]] nlohmann::ordered_json info_json(RecordingFile& recording);
[[nodiscard]] std::string info_text(RecordingFile& recording);

/// One row per device tick with the columns of CsvWriter; nan where the recording has no value.
/// The file appears when it is complete. Throws SetupError if it cannot be created or exists and
/// `may_overwrite` is false, std::runtime_error if writing fails, ReaderHasLeft.
/// @param on_progress  called for every row with the share that is read, 0 … 1; may be empty
void export_csv(RecordingFile& recording, const std::string& csv_file, bool may_overwrite = false,
                const std::function<void(double)>& on_progress = {});

}  // namespace palpate
