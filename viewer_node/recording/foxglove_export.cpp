// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/foxglove_export.h"

#include <list>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/link/codec/viewer_codec.h"
#include "common/telemetry/remote_events.h"
#include "viewer_node/feed/scene_mirror.h"
#include "viewer_node/feed/telemetry_mirror.h"
#include "viewer_node/recording/mcap_writer.h"
#include "viewer_node/recording/recording.h"

namespace palpate {
namespace {

constexpr std::uint64_t kToolInterval_ns = 33'333'333;
constexpr std::uint64_t kPointsInterval_ns = 100'000'000;
constexpr std::uint64_t kSurfacesInterval_ns = 500'000'000;  // they are large

// Channels of all sides; those of a side follow.
constexpr std::size_t kPoints = 0;
constexpr std::size_t kLog = 1;
constexpr std::size_t kShared = 2;
// Of a side.
constexpr std::size_t kTelemetry = 0;
constexpr std::size_t kTool = 1;
constexpr std::size_t kTransforms = 2;
constexpr std::size_t kPerSide = 3;

std::vector<viewer::mcap::Channel> channels_of(const std::vector<std::string>& sides) {
  const auto channel = [](const std::string& topic, const char* schema) {
    return viewer::mcap::Channel{topic, schema, schema_of(schema)};
  };
  std::vector<viewer::mcap::Channel> channels{channel("/tissue/points", "foxglove.PointCloud"),
                                              channel("/log", "foxglove.Log")};
  for (const std::string& side : sides) {
    const std::string prefix = side.empty() ? "" : "/" + side;
    channels.push_back(channel(prefix + "/telemetry", "palpate.v1.Telemetry"));
    channels.push_back(channel(prefix + "/scene", "foxglove.SceneUpdate"));
    channels.push_back(channel(prefix + "/tf", "foxglove.FrameTransforms"));
  }
  return channels;
}

class FoxgloveExport {
 public:
  FoxgloveExport(RecordingFile& recording, const std::string& file, bool may_overwrite)
      : recording_(recording),
        names_(recording.sides()),
        markers_(recording.markers()),
        writer_(file, may_overwrite, channels_of(names_), OutputFile::Kind::kWhole) {
    for (const char* name : {viewer::kRunMetadata, viewer::kNodesMetadata, viewer::kLossMetadata}) {
      writer_.add_metadata(name, recording.mcap().metadata(name));
    }
    for (std::size_t i = 0; i < names_.size(); ++i) sides_.emplace_back(*this, i);
  }

  void run(const std::function<void(double)>& on_progress) {
    recording_.seek(0);
    while (const RecordingFile::Item* item = recording_.next()) {
      now_ns_ = item->log_time_ns;
      write_markers();
      std::visit([&](const auto& message) { take(message); }, item->message);
      if (on_progress) on_progress(recording_.passed_ratio());
    }
    for (Side& side : sides_) side.mirror.flush_rows();
    // of a wall clock that was set back, or of the last moment
    now_ns_ = ~std::uint64_t{0};
    write_markers();
    writer_.close();
    if (const auto error = writer_.take_error()) throw std::runtime_error(*error);
  }

 private:
  struct Side {
    Side(FoxgloveExport& to, std::size_t index)
        : first_channel(kShared + index * kPerSide),
          device(to.line_writer(index, "device_node")),
          mofc(to.line_writer(index, "mofc_node")),
          physics(to.line_writer(index, "physics_node")) {
      mirror.on_row = [&to, this](const TickRow& row) { to.write(*this, row); };
    }
    Side(const Side&) = delete;
    Side& operator=(const Side&) = delete;

    std::size_t first_channel;
    viewer::TelemetryMirror mirror;
    std::uint64_t next_tool_ns = 0;
    RemoteEvents<DeviceTick, DeviceCounters> device;
    RemoteEvents<MofcTick, MofcCounters> mofc;
    RemoteEvents<PhysicsTick, PhysicsCounters> physics;
  };

  [[nodiscard]] TimePoint now() const {
    return TimePoint(Duration(static_cast<std::int64_t>(now_ns_)));
  }
  Side* side_of(const std::string& name) {
    std::size_t index = 0;
    for (Side& side : sides_) {
      if (names_[index++] == name) return &side;
    }
    return nullptr;
  }

  void take(const DeviceBatch& batch) {
    Side* const side = side_of(batch.side);
    if (side == nullptr) return;
    side->device.note(batch, now());
    side->mirror.take(batch, now());
  }
  void take(const MofcBatch& batch) {
    if (Side* const side = side_of(batch.side)) {
      side->mofc.note(batch, now());
      side->mirror.take(batch, now());
    }
  }
  void take(const PhysicsBatch& batch) {
    if (Side* const side = side_of(batch.side)) {
      side->physics.note(batch, now());
      side->mirror.take(batch, now());
    }
  }
  void take(const SceneState& scene) { are_points_due_ |= scene_.take(scene); }
  void take(const MeshFrame& frame) { are_points_due_ |= scene_.take(frame); }
  void take(const RunState&) {}

  void write(Side& side, const TickRow& row) {
    const auto log_time_ns = recording_.log_time_of(row.device_session_id, row.device.sampled_at);
    if (!log_time_ns) return;
    const std::uint64_t at_ns = *log_time_ns;
    const MofcCounters& mofc = side.mirror.mofc_counters();
    put(side.first_channel + kTelemetry, at_ns,
        encode_telemetry(at_ns, row.device, row.mofc, mofc.transparency()));
    if (is_early(at_ns, side.next_tool_ns, kToolInterval_ns)) return;
    side.next_tool_ns = at_ns + kToolInterval_ns;
    static const SceneState kUnknownScene;
    const SceneState& scene = scene_.scene() ? *scene_.scene() : kUnknownScene;
    const Vector3 requested_newton =
        row.mofc ? row.mofc->requested_force_on_hand_newton : Vector3(Vector3::Zero());
    put(side.first_channel + kTool, at_ns, encode_tool(at_ns, row.device, scene, requested_newton));
    const std::size_t index = (side.first_channel - kShared) / kPerSide;
    put(side.first_channel + kTransforms, at_ns,
        encode_transforms(at_ns, with_side(names_[index], "tool"), row.device));
    write_tissue(at_ns);
  }

  /// False as well if the clock was set back.
  static bool is_early(std::uint64_t at_ns, std::uint64_t next_ns, std::uint64_t interval_ns) {
    return at_ns < next_ns && next_ns - at_ns <= interval_ns;
  }

  void write_tissue(std::uint64_t at_ns) {
    if (!scene_.scene()) return;
    const bool has_points =
        are_points_due_ && !is_early(at_ns, next_points_ns_, kPointsInterval_ns);
    are_surfaces_due_ |= has_points;
    const bool has_surfaces =
        are_surfaces_due_ && !is_early(at_ns, next_surfaces_ns_, kSurfacesInterval_ns);
    if (!has_points && !has_surfaces) return;
    std::vector<std::vector<float>> parts;
    for (std::size_t tissue = 0; tissue < scene_.scene()->tissues.size(); ++tissue) {
      parts.push_back(scene_.vertices_m(tissue));
    }
    if (has_points) {
      are_points_due_ = false;
      next_points_ns_ = at_ns + kPointsInterval_ns;
      put(kPoints, at_ns, encode_point_cloud(at_ns, parts));
    }
    if (has_surfaces) {
      are_surfaces_due_ = false;
      next_surfaces_ns_ = at_ns + kSurfacesInterval_ns;
      put(kShared + kTool, at_ns, encode_tissues(at_ns, *scene_.scene(), parts));
    }
  }

  void write_markers() {
    for (; next_marker_ < markers_.size() && markers_[next_marker_].at_ns <= now_ns_;
         ++next_marker_) {
      const Marker& marker = markers_[next_marker_];
      put(kLog, marker.at_ns,
          encode_log(marker.at_ns, LogLevel::kInfo, "run",
                     "event=marker origin=" + marker.origin + " text=\"" + marker.text + "\""));
    }
  }

  OnEventLine line_writer(std::size_t index, const char* node) {
    return [this, name = with_side(names_[index], node)](spdlog::level::level_enum level,
                                                         const std::string& text) {
      const LogLevel shown = level >= spdlog::level::err    ? LogLevel::kError
                             : level == spdlog::level::warn ? LogLevel::kWarning
                                                            : LogLevel::kInfo;
      put(kLog, now_ns_, encode_log(now_ns_, shown, name, text));
    };
  }

  void put(std::size_t channel, std::uint64_t at_ns, const std::string& payload) {
    writer_.write(channel, at_ns, payload);
  }

  RecordingFile& recording_;
  std::vector<std::string> names_;
  std::vector<Marker> markers_;
  std::size_t next_marker_ = 0;
  viewer::McapWriter writer_;
  std::list<Side> sides_;
  viewer::SceneMirror scene_;
  bool are_points_due_ = false;
  bool are_surfaces_due_ = false;
  std::uint64_t next_points_ns_ = 0;
  std::uint64_t next_surfaces_ns_ = 0;
  std::uint64_t now_ns_ = 0;
};

}  // namespace

void export_foxglove(RecordingFile& recording, const std::string& file, bool may_overwrite,
                     const std::function<void(double)>& on_progress) {
  FoxgloveExport(recording, file, may_overwrite).run(on_progress);
}

}  // namespace palpate
