// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/ros_export.h"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/core/messages.h"
#include "viewer_node/recording/mcap_writer.h"
#include "viewer_node/recording/recording.h"

namespace palpate::viewer::ros {
namespace {

/// Numbers are aligned to their size, counted from the end of the encapsulation header.
class Cdr {
 public:
  Cdr() : bytes_("\x00\x01\x00\x00", kHead) {}

  Cdr& number(std::uint32_t value) { return aligned(value); }
  Cdr& number(double value) { return aligned(std::bit_cast<std::uint64_t>(value)); }
  Cdr& text(std::string_view text) {
    number(static_cast<std::uint32_t>(text.size() + 1));
    bytes_ += text;
    bytes_ += '\0';
    return *this;
  }
  Cdr& vector(const Vector3& v) { return number(v.x()).number(v.y()).number(v.z()); }
  Cdr& header(const Header& header) {
    constexpr std::uint64_t kSecond = 1'000'000'000;
    return number(static_cast<std::uint32_t>(header.wall_ns / kSecond))
        .number(static_cast<std::uint32_t>(header.wall_ns % kSecond))
        .text(header.frame_id);
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  static constexpr std::size_t kHead = 4;

  template <class Unsigned>
  Cdr& aligned(Unsigned value) {
    while ((bytes_.size() - kHead) % sizeof(Unsigned) != 0) bytes_ += '\0';
    mcap::Bytes(bytes_).number(value);
    return *this;
  }
  std::string bytes_;
};

}  // namespace

std::string pose_stamped(const Header& header, const Vector3& position_m,
                         const Quaternion& orientation) {
  return Cdr()
      .header(header)
      .vector(position_m)
      .vector(orientation.vec())
      .number(orientation.w())
      .bytes();
}

std::string wrench_stamped(const Header& header, const Vector3& force_newton,
                           const Vector3& torque_newton_m) {
  return Cdr().header(header).vector(force_newton).vector(torque_newton_m).bytes();
}

}  // namespace palpate::viewer::ros

namespace palpate {
namespace {

namespace ros = viewer::ros;

// Channels of a side.
constexpr std::size_t kPose = 0;
constexpr std::size_t kCommanded = 1;
constexpr std::size_t kApplied = 2;
constexpr std::size_t kPerSide = 3;

std::vector<viewer::mcap::Channel> channels_of(const std::vector<std::string>& sides) {
  std::vector<viewer::mcap::Channel> channels;
  for (const std::string& side : sides) {
    const std::string prefix = side.empty() ? "/" : "/" + side + "/";
    for (const auto& [topic, schema] :
         {std::pair("measured_cp", ros::kPoseStamped), std::pair("servo_cf", ros::kWrenchStamped),
          std::pair("measured_cf", ros::kWrenchStamped)}) {
      channels.push_back({.topic = prefix + topic,
                          .schema_name = std::string(schema.name),
                          .schema = std::string(schema.definition),
                          .encoding = "cdr",
                          .schema_encoding = "ros2msg"});
    }
  }
  return channels;
}

class RosExport {
 public:
  RosExport(RecordingFile& recording, const std::string& file, bool may_overwrite)
      : recording_(recording),
        sides_(recording.sides()),
        writer_(file, may_overwrite, channels_of(sides_), OutputFile::Kind::kWhole) {
    writer_.add_metadata(viewer::kRunMetadata, recording.mcap().metadata(viewer::kRunMetadata));
  }

  void run(const std::function<void(double)>& on_progress) {
    recording_.seek(0);
    while (const RecordingFile::Item* item = recording_.next()) {
      std::visit([&](const auto& message) { take(message); }, item->message);
      if (on_progress) on_progress(recording_.passed_ratio());
    }
    writer_.close();
    if (const auto error = writer_.take_error()) throw std::runtime_error(*error);
  }

 private:
  template <class T>
  void take(const T& /*message*/) {}

  void take(const DeviceBatch& batch) {
    for (const DeviceTick& tick : batch.records) {
      const auto at_ns = recording_.log_time_of(batch.header.session_id, tick.sampled_at);
      if (!at_ns) continue;
      write(batch.side, kPose, *at_ns,
            ros::pose_stamped({*at_ns, "world"}, tick.measured_tool_position_world_m,
                              tick.measured_tool_orientation_world));
      write_force(batch.side, kApplied, *at_ns, tick.force_on_hand_newton);
    }
  }
  void take(const MofcBatch& batch) {
    for (const MofcTick& tick : batch.records) {
      const auto at_ns = recording_.log_time_of(tick.device_session_id, tick.device_sampled_at);
      if (!at_ns) continue;
      write_force(batch.side, kCommanded, *at_ns, tick.commanded_force_on_hand_newton);
    }
  }

  void write_force(const std::string& side, std::size_t channel, std::uint64_t at_ns,
                   const Vector3& force_newton) {
    const std::string frame = side.empty() ? "device_base" : side + "_device_base";
    write(side, channel, at_ns, ros::wrench_stamped({at_ns, frame}, force_newton, Vector3::Zero()));
  }
  void write(const std::string& side, std::size_t channel, std::uint64_t at_ns,
             const std::string& payload) {
    const auto found = std::find(sides_.begin(), sides_.end(), side);
    if (found == sides_.end()) return;
    const auto index = static_cast<std::size_t>(found - sides_.begin());
    writer_.write(index * kPerSide + channel, at_ns, payload);
  }

  RecordingFile& recording_;
  std::vector<std::string> sides_;
  viewer::McapWriter writer_;
};

}  // namespace

void export_ros(RecordingFile& recording, const std::string& file, bool may_overwrite,
                const std::function<void(double)>& on_progress) {
  RosExport(recording, file, may_overwrite).run(on_progress);
}

}  // namespace palpate
