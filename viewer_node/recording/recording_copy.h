// SPDX-License-Identifier: Apache-2.0
// recording_copy.h — a part of one recording, or several together, as a new recording:
// `palpate cut`, `recover` and `merge`. The messages stay as they are, byte by byte.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "viewer_node/recording/mcap_reader.h"

namespace palpate::viewer {

/// Metadata of this name in a copy: what was done ("cut", "recover", "merge"), from_s and to_s,
/// breaks_off ("1": the end of the run is not in it),
/// topics, seams (log times in ns from which on another run is recorded), damaged_chunks,
/// unreadable_messages and unreadable_bytes of the sources, and their files.
inline constexpr const char* kCopyMetadata = "palpate_copy";

/// Log times in ns from which on a recording holds another run; empty: it holds one.
[[nodiscard]] std::vector<std::uint64_t> seams_of(const McapReader& recording);

/// The end of what was recorded is missing: the file was not closed, or it is a copy of a part.
[[nodiscard]] bool breaks_off(const McapReader& recording);

struct CopyOptions {
  std::string command{};  ///< for kCopyMetadata
  std::string file{};
  bool may_overwrite = false;
  double from_s = 0.0;  ///< since the beginning of the recording
  double to_s = std::numeric_limits<double>::infinity();
  std::vector<std::string> topics{};  ///< empty: all. "/mesh" is also that of every side
  /// Each recording begins when the previous one ends. Otherwise all keep their times.
  bool is_sequence = false;
  /// Leaves out messages of Palpate that cannot be decoded.
  bool is_recovery = false;
};

struct CopyResult {
  std::uint64_t messages = 0;
  std::uint64_t duplicates = 0;  ///< messages that two recordings contain; written once, unless
                                 ///< one recording follows the other
  std::uint64_t damaged_chunks = 0;
  std::uint64_t unreadable_messages = 0;  ///< left out by a recovery
  std::uint64_t unreadable_bytes = 0;     ///< of the sources, outside chunks

  /// What is left out: "1 damaged chunks, 40 unreadable bytes"; empty: nothing.
  [[nodiscard]] std::string loss() const;
};

/// Copies the messages of all sources in order of time. A copy that begins later than its source
/// starts with the scene and the meshes of that moment. The file appears when it is complete.
///
/// Throws SetupError: no such topic, nothing in that time, recordings of different sessions, or of
/// two runs at the same time; std::runtime_error if writing fails.
/// @param on_progress  called with the share that is copied, 0 … 1; may be empty
CopyResult copy_recordings(const std::vector<std::unique_ptr<McapReader>>& sources,
                           const CopyOptions& options,
                           const std::function<void(double)>& on_progress = {});

}  // namespace palpate::viewer
