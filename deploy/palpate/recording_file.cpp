#include "deploy/palpate/recording_file.h"

#include <optional>
#include <string_view>
#include <utility>

#include "common/core/check.h"
#include "viewer_node/recording.h"
#include "viewer_node/telemetry_mirror.h"

namespace palpate {
namespace {

constexpr double kPathStep_s = 0.01;

}  // namespace

RecordingFile::RecordingFile(const std::string& path)
    : mcap_(path), about_(mcap_.metadata(viewer::kRunMetadata)) {
  const auto channels = viewer::recorded_channels();
  for (const viewer::McapReader::Topic& topic : mcap_.topics()) {
    for (std::size_t kind = 0; kind < channels.size(); ++kind) {
      if (topic.topic == channels[kind].topic && topic.schema_name == channels[kind].schema_name) {
        kinds_[topic.id] = kind;
      }
    }
  }
  if (kinds_.empty()) {
    throw SetupError("recording " + path +
                     ": has no topic of Palpate; give a file that --record wrote");
  }
}

std::string RecordingFile::about(const std::string& key) const {
  const auto it = about_.find(key);
  return it != about_.end() ? it->second : "";
}

double RecordingFile::length_s() const {
  return static_cast<double>(mcap_.end_ns() - mcap_.begin_ns()) * 1e-9;
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
    const auto kind = kinds_.find(message->channel_id);
    if (kind == kinds_.end()) continue;
    item_.log_time_ns = message->log_time_ns;
    bool is_good = false;
    switch (kind->second) {
      case 0:
        is_good = decode<DeviceBatch>(message->payload);
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
    if (is_good) return &item_;
    ++refused_;
  }
  return nullptr;
}

void for_each_row(RecordingFile& recording,
                  const std::function<void(const viewer::TickRow&)>& on_row) {
  viewer::TelemetryMirror mirror;
  mirror.on_row = on_row;
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

RecordedPath hand_path_of(RecordingFile& recording) {
  RecordedPath path;
  std::optional<TimePoint> begin;
  Vector3 sum_m = Vector3::Zero();
  double sum_s = 0.0;
  int count = 0;
  const auto end_step = [&] {
    if (count == 0) return;
    path.samples.push_back({.t_s = sum_s / count, .position_m = sum_m / count});
    sum_m.setZero();
    sum_s = 0.0;
    count = 0;
  };

  std::int64_t step = 0;
  double last_s = -1.0;
  for_each_row(recording, [&](const viewer::TickRow& row) {
    if (!begin) begin = row.device.sampled_at;
    const double t_s = to_seconds(row.device.sampled_at - *begin);
    if (t_s <= last_s) return;  // a device of another clock
    last_s = t_s;
    const auto its_step = static_cast<std::int64_t>(t_s / kPathStep_s);
    if (its_step != step) end_step();
    step = its_step;
    sum_m += row.device.measured_hand_position_m;
    sum_s += t_s;
    ++count;
  });
  end_step();
  if (path.samples.empty()) {
    throw SetupError("recording " + recording.mcap().path() + ": holds no motion of a hand");
  }
  return path;
}

}  // namespace palpate
