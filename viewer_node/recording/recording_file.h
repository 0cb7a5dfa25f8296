// recording_file.h — a recording as the messages it was made of.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include "common/session/session.h"
#include "common/telemetry/telemetry_message.h"
#include "common/telemetry/csv_writer.h"
#include "viewer_node/recording/mcap_reader.h"

namespace palpate {

class RecordingFile {
 public:
  struct Item {
    std::uint64_t log_time_ns = 0;
    TelemetryMessage message;
  };

  /// Throws SetupError: no such file, no MCAP file.
  explicit RecordingFile(const std::string& path);

  /// The next message, valid until the next call; null at the end. Other topics are passed over;
  /// what the codec refuses is too, and counted.
  [[nodiscard]] const Item* next();
  [[nodiscard]] std::uint64_t refused() const { return refused_; }
  /// From now on batches of this side only; "" if there is no choice. Throws SetupError, naming the
  /// sides there are, if it is none of them.
  void choose_side(const std::string& side);
  /// Back to the first message at or after this time.
  void seek(std::uint64_t log_time_ns) { mcap_.seek(log_time_ns); }

  [[nodiscard]] const viewer::McapReader& mcap() const { return mcap_; }
  /// Of the recording program, see kRunMetadata; "" where it says nothing.
  [[nodiscard]] std::string about(const std::string& key) const;
  /// Of the session, and of the side chosen: "two_hands, left".
  [[nodiscard]] std::string name() const;
  [[nodiscard]] double length_s() const;

 private:
  [[nodiscard]] bool is_of_chosen_side() const;
  template <class T>
  [[nodiscard]] bool decode(std::string_view payload);

  viewer::McapReader mcap_;
  viewer::mcap::Strings about_;
  std::optional<std::string> side_;             // none: all
  std::map<std::uint16_t, std::size_t> kinds_;  // channel → alternative of TelemetryMessage
  std::string frame_;
  Item item_;
  std::uint64_t refused_ = 0;
};

/// Every device tick of a recording, in order, with mofc's half where it is there.
void for_each_row(RecordingFile& recording,
                  const std::function<void(const TickRow&)>& on_row);

/// Where the recorded hand meant to go, D, each 10 ms from its first tick on: the path that `hand`,
/// a mass m with a spring k and a damper b to the intended point xᵢ, must have been led along to
/// move as x was measured while the device pushed with F:
///
///   m x″ = k (xᵢ − x) + b (x′ᵢ − x′) + F
///
/// x and F are means over 10 ms, so that the steps of the encoder leave no trace. The device's own
/// mass and friction are not known for every device and left out. Throws SetupError if there is no
/// motion.
[[nodiscard]] RecordedPath hand_path_of(RecordingFile& recording, const HandConfig& hand);

}  // namespace palpate
