// SPDX-License-Identifier: Apache-2.0
// recording_file.h — reads a recording as messages of hop 5.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/link/codec/viewer_codec.h"
#include "common/session/session.h"
#include "common/telemetry/csv_writer.h"
#include "common/telemetry/telemetry_message.h"
#include "viewer_node/recording/mcap_reader.h"

namespace palpate {

class RecordingFile {
 public:
  struct Item {
    std::uint64_t log_time_ns = 0;
    TelemetryMessage message;
  };

  /// Throws SetupError: no such file, not an MCAP file, no topic of Palpate.
  explicit RecordingFile(const std::string& path);

  /// The next message, valid until the next call; null at the end. Skips other topics;
  /// skips and counts messages that the codec rejects.
  [[nodiscard]] const Item* next();
  [[nodiscard]] std::uint64_t refused() const { return refused_; }
  /// From now on reads batches of this side only; "" for a recording of one device. Throws
  /// SetupError, naming the recorded sides, for any other name.
  void choose_side(const std::string& side);
  /// Log time of an instant on the clock of a device, given the first batch of this session that
  /// next() has read; empty before that batch.
  [[nodiscard]] std::optional<std::uint64_t> log_time_of(std::uint64_t device_session_id,
                                                         TimePoint at) const;
  /// Adds to a row the ideal force and the true contact, if they are recorded: loopback only.
  void complete(TickRow& row) const;
  /// The ideal run at a row; NaN where it is not recorded, as its force never is.
  [[nodiscard]] IdealState ideal_of(const TickRow& row) const;
  [[nodiscard]] std::uint64_t ideal_messages() const { return ideal_messages_; }
  /// What is missing of the recording, as far as it has been read: "2 damaged chunks, its end";
  /// empty: nothing.
  [[nodiscard]] std::string damage() const;
  /// Continues with the first message at or after this time.
  void seek(std::uint64_t log_time_ns) {
    if (log_time_ns == 0) refused_ = ideal_messages_ = 0;  // counted once, however often it is read
    ideal_.clear();
    mcap_.seek(log_time_ns);
  }

  /// Reads the whole file the first time; next() then starts at its beginning.
  [[nodiscard]] const std::vector<Marker>& markers();

  [[nodiscard]] const viewer::McapReader& mcap() const { return mcap_; }
  /// Metadata of the recording program, see kRunMetadata; "" if missing.
  [[nodiscard]] std::string about(const std::string& key) const;
  /// Names of the recorded sides; "" for one device.
  [[nodiscard]] std::vector<std::string> sides() const;
  /// The chosen one; "" where there is one device or none is chosen.
  [[nodiscard]] std::string side() const { return side_.value_or(""); }
  /// Names of the session and of the chosen side: "two_hands, left".
  [[nodiscard]] std::string name() const;
  [[nodiscard]] double length_s() const;
  /// Share of the recording that next() has passed, 0 … 1.
  [[nodiscard]] double passed_ratio() const;

 private:
  [[nodiscard]] bool is_of_chosen_side() const;
  void note_clock(const DeviceBatch& batch);
  void take_ideal(std::string_view payload);
  template <class T>
  [[nodiscard]] bool decode(std::string_view payload);

  viewer::McapReader mcap_;
  viewer::mcap::Strings about_;
  std::optional<std::string> side_;             // none: all
  std::map<std::uint16_t, std::size_t> kinds_;  // channel → alternative of TelemetryMessage
  std::optional<std::uint16_t> marker_channel_;
  std::optional<std::uint16_t> ideal_channel_;
  std::optional<std::vector<Marker>> markers_;  // once they are read
  std::string frame_;
  Item item_;
  std::map<std::uint64_t, std::uint64_t> clock_offset_ns_;  // by device session: to log time
  std::map<TimePoint, IdealForce> ideal_;                   // of the ticks read last
  std::uint64_t ideal_messages_ = 0;
  std::uint64_t refused_ = 0;
};

/// Calls `on_row` for every device tick of a recording, in order, with mofc's half if recorded.
void for_each_row(RecordingFile& recording, const std::function<void(const TickRow&)>& on_row);

/// Of the session that was recorded, on the machine that recorded it; empty if it is not told.
[[nodiscard]] std::filesystem::path folder_of_session(const RecordingFile& recording);

/// Of a run on virtual time, `palpate loopback` or `palpate sweep`: no person was there.
[[nodiscard]] bool is_of_lockstep(const RecordingFile& recording);

/// The session that was recorded, with its overrides and these; a task that nobody could start
/// begins with the run. Throws SetupError: a file that it names is not where it was.
[[nodiscard]] Session recorded_session(const RecordingFile& recording,
                                       const std::vector<std::string>& overrides = {});

/// The intended path of the recorded hand, D, every 10 ms from its first tick on. `hand` is a mass
/// m with a spring k and a damper b to the intended point xᵢ; the path is the one that makes it
/// move along the measured x under the device's force F:
///
///   m x″ = k (xᵢ − x) + b (x′ᵢ − x′) + F
///
/// x and F are means over 10 ms, which removes the encoder's quantisation. The device's own
/// mass and friction are unknown for some devices and neglected. Throws SetupError if the recording
/// holds no motion or the hand's stiffness is 0.
[[nodiscard]] RecordedPath hand_path_of(RecordingFile& recording, const HandConfig& hand);

}  // namespace palpate
