// SPDX-License-Identifier: Apache-2.0
// run_messages.h — what the program that runs a session tells the viewers of its machine (hop 5),
// and what they ask of it (hop 7), as plain structs. Wire form: run.proto in proto/palpate/v1. Not
// for the haptic loop: these structs allocate.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/core/messages.h"

namespace palpate {

/// A moment that somebody marked in a run.
struct Marker {
  /// Values as in run.proto.
  enum class Kind : std::uint8_t {
    kNote = 0,       ///< while a task runs: a find, or that the resistance is lost
    kTaskStart = 1,  ///< the first of a run counts
    kTaskStop = 2,
  };
  static constexpr std::size_t kMostTextBytes = 200;
  static constexpr std::size_t kMostOriginBytes = 64;

  std::uint64_t at_ns = 0;  ///< wall clock, since 1970
  std::string text{};       ///< UTF-8 without control characters
  std::string origin{};     ///< "terminal", "page"
  Kind kind = Kind::kNote;
  /// The newest tick of the device when it was set, of sessions without sides; 0, 0: none.
  std::uint64_t device_session_id = 0;
  std::uint64_t device_sequence = 0;

  bool operator==(const Marker&) const = default;
};

/// State of `palpate replay`.
struct ReplayState {
  std::string file;
  double position_s = 0.0;  ///< since the beginning of the recording
  double length_s = 0.0;
  double speed_ratio = 1.0;  ///< multiple of real time, also while paused
  bool is_paused = false;
  std::uint64_t begin_ns = 0;  ///< wall clock at the beginning of the recording
  /// That began: the first, one at each move, and others in the recording.
  std::uint64_t runs = 1;

  bool operator==(const ReplayState&) const = default;
};

/// Hop 5: the state of `palpate launch` or `palpate replay`.
struct RunState {
  static constexpr std::size_t kMostMarkers = 200;

  Header header;
  std::vector<Marker> markers;        ///< oldest first, the newest kMostMarkers
  std::optional<ReplayState> replay;  ///< empty: a run, not a replay
};

/// Hop 7: a viewer's request. Empty fields change nothing.
struct RunRequest {
  static constexpr double kLongest_s = 1e9;
  static constexpr double kSlowest_ratio = 0.001;
  static constexpr double kFastest_ratio = 1000.0;

  Header header;
  std::optional<std::string> marker;               ///< set one now; empty text: "marker 1", …
  std::optional<double> seek_s;                    ///< of a replay
  std::optional<bool> is_paused;                   ///< of a replay
  std::optional<double> speed_ratio;               ///< of a replay
  std::optional<bool> is_recording;                ///< of viewer_node, which does not forward it
  Marker::Kind marker_kind = Marker::Kind::kNote;  ///< of `marker`

  /// Whether anything but `is_recording` is asked for.
  [[nodiscard]] bool is_for_run() const { return marker || seek_s || is_paused || speed_ratio; }
};

/// How far the task of a session is, for a page. It tells nothing about places before the end.
struct TaskState {
  enum class Phase : std::uint8_t { kWaiting = 0, kRunning = 1, kEnded = 2 };
  enum class Kind : std::uint8_t {
    kFree = 0,
    kPalpation = 1,  ///< a note is a find
    kNeedle = 2,     ///< a note says that the resistance is lost
    kTraction = 3,   ///< a note says nothing
  };
  /// Where held tissue is to be brought, and how far that is.
  struct Traction {
    Vector3 target_m = Vector3::Zero();  ///< of the centre of the tip, W
    double tolerance_m = 0.0;
    double hold_s = 0.0;  ///< for so long without a break
    double held_s = 0.0;  ///< the longest so far
    bool is_holding = false;
    bool is_at_target = false;  ///< and holds it

    bool operator==(const Traction&) const = default;
  };

  Phase phase = Phase::kWaiting;
  std::string briefing{};
  Kind kind = Kind::kFree;
  double elapsed_s = 0.0;
  double time_s = 0.0;  ///< limit; 0: none
  std::uint32_t marks = 0;
  std::vector<std::string> findings{};                         ///< after the end
  std::vector<std::pair<std::string, std::string>> figures{};  ///< after the end: label, value
  std::optional<Traction> traction{};
  bool is_started_by_person = false;  ///< else it begins with the first tick

  bool operator==(const TaskState&) const = default;
};

/// What a task shows after its end: what of the surface was searched, where lesions are, and the
/// force over its time. Before: the places alone.
struct TaskMap {
  static constexpr std::size_t kMostPlaces = 5000;

  struct Lesion {
    std::string name{};
    Vector3 center_m = Vector3::Zero();  ///< W
    double radius_m = 0.0;
    bool is_found = false;
  };

  std::vector<std::array<float, 3>> places_m;  ///< on the surface at rest; W
  std::vector<std::uint8_t> is_searched;       ///< of each place, 0 or 1; empty before the end
  std::vector<Lesion> lesions;
  double slot_s = 0.0;             ///< of most_newton
  std::vector<float> most_newton;  ///< largest force in each slot; NaN: not received
  std::vector<double> marks_s;     ///< since the start
  double limit_newton = 0.0;       ///< of the task; 0: none
};

/// The markers of a run, for its RunState.
class MarkerLog {
 public:
  /// Appends a marker at this time or just after the previous one, and forgets the oldest beyond
  /// RunState::kMostMarkers. @param marker  an empty text: "marker 1", …, or what its kind says
  void add(Marker marker) {
    if (!newest_.empty()) marker.at_ns = std::max(marker.at_ns, newest_.back().at_ns + 1);
    if (marker.kind == Marker::Kind::kNote) ++count_;
    if (marker.text.empty()) marker.text = default_text(marker.kind);
    newest_.push_back(std::move(marker));
    if (newest_.size() > RunState::kMostMarkers) newest_.erase(newest_.begin());
  }
  [[nodiscard]] const std::vector<Marker>& newest() const { return newest_; }

 private:
  [[nodiscard]] std::string default_text(Marker::Kind kind) const {
    if (kind == Marker::Kind::kTaskStart) return "task started";
    if (kind == Marker::Kind::kTaskStop) return "task stopped";
    return "marker " + std::to_string(count_);
  }

  std::vector<Marker> newest_;
  std::uint64_t count_ = 0;
};

}  // namespace palpate
