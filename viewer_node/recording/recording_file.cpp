// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/recording_file.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>
#include <filesystem>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/session/session_file.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/recording/recording.h"

namespace palpate {
namespace {

constexpr Duration kPathStep = std::chrono::milliseconds(10);
/// Ideal forces are kept for the rows that wait for their other half.
constexpr Duration kIdealKept = 2 * viewer::kJoinWait;

}  // namespace

RecordingFile::RecordingFile(const std::string& path)
    : mcap_(path), about_(mcap_.metadata(viewer::kRunMetadata)) {
  const auto channels = viewer::recorded_channels();
  const viewer::mcap::Channel ideal = viewer::ideal_channel();
  for (const viewer::McapReader::Topic& topic : mcap_.topics()) {
    if (topic.topic == ideal.topic && topic.schema_name == ideal.schema_name) {
      ideal_channel_ = topic.id;
    }
    for (std::size_t kind = 0; kind < channels.size(); ++kind) {
      if (topic.topic == channels[kind].topic && topic.schema_name == channels[kind].schema_name) {
        if (kind == TelemetryMessage(std::in_place_type<RunState>).index()) {
          marker_channel_ = topic.id;
        } else {
          kinds_[topic.id] = kind;
        }
      }
    }
  }
  if (kinds_.empty()) {
    throw SetupError("recording " + path +
                     ": has no topic of Palpate; give a file written by --record");
  }
}

std::string RecordingFile::about(const std::string& key) const {
  const auto it = about_.find(key);
  return it != about_.end() ? it->second : "";
}

std::vector<std::string> RecordingFile::sides() const {
  std::vector<std::string> sides(1);
  for (const char letter : about("sides")) {
    if (letter == ',') {
      sides.emplace_back();
    } else {
      sides.back() += letter;
    }
  }
  return sides;
}

std::string RecordingFile::name() const {
  return about("session_name") + (side_.value_or("").empty() ? "" : ", " + *side_);
}

const std::vector<Marker>& RecordingFile::markers() {
  if (markers_) return *markers_;
  markers_.emplace();
  if (!marker_channel_) return *markers_;
  mcap_.seek(0);
  while (const auto message = mcap_.next()) {
    if (message->channel_id != *marker_channel_) continue;
    auto marker = decode_marker(message->payload);
    if (marker && markers_->size() < RunState::kMostMarkers) markers_->push_back(*marker);
  }
  mcap_.seek(0);
  return *markers_;
}

std::string RecordingFile::damage() const {
  std::string text;
  const auto add = [&](const std::string& what) { text += (text.empty() ? "" : ", ") + what; };
  if (mcap_.damaged_chunks() > 0) add(fmt::format("{} damaged chunks", mcap_.damaged_chunks()));
  if (refused_ > 0) add(fmt::format("{} unreadable messages", refused_));
  if (mcap_.unreadable_bytes() > 0) {
    add(fmt::format("{} unreadable bytes", mcap_.unreadable_bytes()));
  }
  if (!mcap_.is_whole()) add("its end: the file was not closed");
  return text;
}

double RecordingFile::length_s() const {
  return static_cast<double>(mcap_.end_ns() - mcap_.begin_ns()) * 1e-9;
}

double RecordingFile::passed_ratio() const {
  const double passed_s = static_cast<double>(item_.log_time_ns - mcap_.begin_ns()) * 1e-9;
  return item_.log_time_ns > mcap_.begin_ns() ? passed_s / length_s() : 0.0;
}

void RecordingFile::choose_side(const std::string& side) {
  const std::string names = about("sides");
  const bool has_one = names.find(',') == std::string::npos;
  side_ = side.empty() && has_one ? names : side;
  const bool is_there = ("," + names + ",").find("," + *side_ + ",") != std::string::npos;
  if (is_there && side_->find(',') == std::string::npos) return;
  throw SetupError(
      "recording " + mcap_.path() +
      (names.empty() ? ": has one device; omit --side" : ": give --side with one of " + names));
}

bool RecordingFile::is_of_chosen_side() const {
  return !side_ || std::visit(
                       [&](const auto& message) {
                         if constexpr (requires { message.side; }) {
                           return message.side == *side_;
                         } else {
                           return true;
                         }
                       },
                       item_.message);
}

void RecordingFile::note_clock(const DeviceBatch& batch) {
  if (batch.records.empty()) return;
  const auto newest = batch.records.back().sampled_at.time_since_epoch().count();
  // modular arithmetic: the clock of a device may be ahead of that of a lockstep recording
  clock_offset_ns_.try_emplace(batch.header.session_id,
                               item_.log_time_ns - static_cast<std::uint64_t>(newest));
}

void RecordingFile::take_ideal(std::string_view payload) {
  const auto ideal = decode_ideal(payload);
  if (!ideal) {
    ++refused_;
    return;
  }
  ++ideal_messages_;
  if (ideal->records.empty() || (side_ && ideal->side != *side_)) return;
  ideal_.erase(ideal_.begin(), ideal_.lower_bound(ideal->records.front().sampled_at - kIdealKept));
  for (const IdealForce& force : ideal->records) ideal_.insert_or_assign(force.sampled_at, force);
}

void RecordingFile::complete(TickRow& row) const {
  const auto ideal = ideal_.find(row.device.sampled_at);
  if (ideal == ideal_.end()) return;
  row.ideal_force_on_hand_newton = ideal->second.force_on_hand_newton;
  row.is_truly_in_contact = ideal->second.is_in_contact;
  row.to_ideal = ideal->second.comparison;
}

IdealState RecordingFile::ideal_of(const TickRow& row) const {
  const auto ideal = ideal_.find(row.device.sampled_at);
  if (ideal == ideal_.end()) return {};
  return {.tool_position_world_m = ideal->second.ideal_tool_position_world_m};
}

std::optional<std::uint64_t> RecordingFile::log_time_of(std::uint64_t device_session_id,
                                                        TimePoint at) const {
  const auto offset = clock_offset_ns_.find(device_session_id);
  if (offset == clock_offset_ns_.end()) return std::nullopt;
  return offset->second + static_cast<std::uint64_t>(at.time_since_epoch().count());
}

template <class T>
bool RecordingFile::decode(std::string_view payload) {
  frame_.assign(1, static_cast<char>(kKindOf<T>));
  frame_ += payload;
  if (!std::holds_alternative<T>(item_.message)) item_.message.emplace<T>();
  return Codec<T>().decode(std::as_bytes(std::span(frame_)), std::get<T>(item_.message)) ==
         DecodeError::kNone;
}

const RecordingFile::Item* RecordingFile::next() {
  while (const auto message = mcap_.next()) {
    if (ideal_channel_ == message->channel_id) take_ideal(message->payload);
    const auto kind = kinds_.find(message->channel_id);
    if (kind == kinds_.end()) continue;
    item_.log_time_ns = message->log_time_ns;
    bool is_good = false;
    switch (kind->second) {
      case 0:
        is_good = decode<DeviceBatch>(message->payload);
        if (is_good) note_clock(std::get<DeviceBatch>(item_.message));
        break;
      case 1:
        is_good = decode<MofcBatch>(message->payload);
        break;
      case 2:
        is_good = decode<PhysicsBatch>(message->payload);
        break;
      case 3:
        is_good = decode<SceneState>(message->payload);
        break;
      default:
        is_good = decode<MeshFrame>(message->payload);
        break;
    }
    if (!is_good) {
      ++refused_;
    } else if (is_of_chosen_side()) {
      return &item_;
    }
  }
  return nullptr;
}

void for_each_row(RecordingFile& recording, const std::function<void(const TickRow&)>& on_row) {
  viewer::TelemetryMirror mirror;
  mirror.on_row = [&](TickRow row) {
    recording.complete(row);
    on_row(row);
  };
  recording.seek(0);
  while (const RecordingFile::Item* item = recording.next()) {
    const TimePoint at{Duration(static_cast<std::int64_t>(item->log_time_ns))};
    std::visit(
        [&](const auto& message) {
          if constexpr (requires { mirror.take(message, at); }) mirror.take(message, at);
        },
        item->message);
  }
  mirror.flush_rows();
}

std::filesystem::path folder_of_session(const RecordingFile& recording) {
  std::error_code ignored;  // a recording may not tell
  return std::filesystem::absolute(recording.about("session_file"), ignored).parent_path();
}

bool is_of_lockstep(const RecordingFile& recording) {
  const std::string by = recording.about("recorded_by");
  return by.starts_with("palpate loopback") || by.starts_with("palpate sweep");
}

Session recorded_session(const RecordingFile& recording,
                         const std::vector<std::string>& overrides) {
  Session session = parse_session(recording.about("session"), recording.mcap().path(), overrides,
                                  folder_of_session(recording));
  if (session.task && is_of_lockstep(recording)) session.task->is_started_by_person = false;
  return session;
}

namespace {

/// Means over one step of the path.
struct HandStep {
  double t_s = 0.0;
  Vector3 position_m = Vector3::Zero();
  Vector3 force_newton = Vector3::Zero();
};

std::vector<HandStep> hand_steps_of(RecordingFile& recording) {
  std::vector<HandStep> steps;
  std::optional<TimePoint> begin;
  std::int64_t step = -1;
  Duration last{-1};
  double count = 0.0;
  const auto end_step = [&] {
    if (count == 0.0) return;
    steps.back().t_s /= count;
    steps.back().position_m /= count;
    steps.back().force_newton /= count;
    count = 0.0;
  };
  for_each_row(recording, [&](const TickRow& row) {
    if (!begin) begin = row.device.sampled_at;
    const Duration t = row.device.sampled_at - *begin;
    if (t <= last) return;  // a restarted device with another clock
    last = t;
    if (t / kPathStep != step) {
      end_step();
      step = t / kPathStep;
      steps.emplace_back();
    }
    steps.back().t_s += to_seconds(t);
    steps.back().position_m += row.device.measured_hand_position_m;
    steps.back().force_newton += row.device.force_on_hand_newton;
    ++count;
  });
  end_step();
  return steps;
}

}  // namespace

RecordedPath hand_path_of(RecordingFile& recording, const HandConfig& hand) {
  if (!(hand.stiffness_newton_per_m > 0.0)) {
    throw SetupError(
        fmt::format("hand.stiffness_newton_per_m is {:g}: a recorded motion needs a hand with "
                    "stiffness > 0; set it, for example hand.stiffness_newton_per_m=150",
                    hand.stiffness_newton_per_m));
  }
  const std::vector<HandStep> steps = hand_steps_of(recording);
  if (steps.empty()) {
    throw SetupError("recording " + recording.mcap().path() + ": contains no motion of a hand");
  }
  RecordedPath path;
  Vector3 lead_m = Vector3::Zero();  // xᵢ − x
  for (std::size_t i = 0; i < steps.size(); ++i) {
    Vector3 acceleration = Vector3::Zero();
    if (i > 0 && i + 1 < steps.size()) {
      const HandStep& before = steps[i - 1];
      const HandStep& after = steps[i + 1];
      const Vector3 velocity_in =
          (steps[i].position_m - before.position_m) / (steps[i].t_s - before.t_s);
      const Vector3 velocity_out =
          (after.position_m - steps[i].position_m) / (after.t_s - steps[i].t_s);
      acceleration = 2.0 * (velocity_out - velocity_in) / (after.t_s - before.t_s);
    }
    // the equation of hand_path_of() for the lead: a low pass of the static lead, time constant b/k
    const Vector3 at_rest_m =
        (hand.mass_kg * acceleration - steps[i].force_newton) / hand.stiffness_newton_per_m;
    const double elapsed_s = i > 0 ? steps[i].t_s - steps[i - 1].t_s : 0.0;
    const double share =
        i > 0 && hand.damping_newton_s_per_m > 0.0
            ? -std::expm1(-elapsed_s * hand.stiffness_newton_per_m / hand.damping_newton_s_per_m)
            : 1.0;
    lead_m += share * (at_rest_m - lead_m);
    path.samples.push_back({.t_s = steps[i].t_s, .position_m = steps[i].position_m + lead_m});
  }
  return path;
}

}  // namespace palpate
