// SPDX-License-Identifier: Apache-2.0
#include "deploy/lockstep/lockstep_recorder.h"

#include <stdexcept>
#include <vector>

#include "common/core/version.h"
#include "common/link/codec/viewer_codec.h"
#include "common/telemetry/telemetry_publisher.h"
#include "physics_node/display/scene_display.h"

namespace palpate {
namespace {

constexpr std::size_t kIdealChannel = std::variant_size_v<TelemetryMessage>;

/// kIdealChannel follows the alternatives of TelemetryMessage.
std::vector<viewer::mcap::Channel> lockstep_channels() {
  std::vector<viewer::mcap::Channel> channels = viewer::recorded_channels();
  channels.push_back(viewer::ideal_channel());
  return channels;
}

}  // namespace

class LockstepRecorder::Impl final : public Sender<SceneState>, public Sender<MeshFrame> {
 public:
  Impl(const viewer::RecordOptions& options, const Session& session, const std::string& recorded_by)
      : writer_(options.file, options.may_overwrite, lockstep_channels()),
        display_(session, kLockstepPhysics, *this, *this) {
    writer_.add_metadata(viewer::kRunMetadata, viewer::run_metadata(session, recorded_by));
    const std::string all_nodes = version();
    writer_.add_metadata(
        viewer::kNodesMetadata,
        {{"device_node", all_nodes}, {"mofc_node", all_nodes}, {"physics_node", all_nodes}});
    ideal_.side = session.side().name;
    begin(device_, kLockstepDevice, session.side().name);
    begin(mofc_, kLockstepMofc, session.side().name);
    begin(physics_, kLockstepPhysics, session.side().name);
  }

  void listen_to(LockstepOptions& options) {
    options.on_device_tick = [this, before = options.on_device_tick](const DeviceTick& tick) {
      if (before) before(tick);
      device_.records.push_back(tick);
    };
    options.on_mofc_tick = [this](const MofcTick& tick) { mofc_.records.push_back(tick); };
    options.on_physics_tick = [this, before = options.on_physics_tick](const PhysicsTick& tick) {
      if (before) before(tick);
      physics_.records.push_back(tick);
      newest_.assign(1, tick);
    };
  }

  void pump(const Lockstep& lockstep, const TickRow& row, const IdealState& ideal) {
    const TimePoint now = row.device.sampled_at;
    if (row.ideal_force_on_hand_newton.allFinite()) {
      ideal_.records.push_back({.sampled_at = now,
                                .force_on_hand_newton = row.ideal_force_on_hand_newton,
                                .is_in_contact = row.is_truly_in_contact.value_or(false),
                                .comparison = row.to_ideal,
                                .ideal_tool_position_world_m = ideal.tool_position_world_m});
    }
    if (now < next_at_) return;
    next_at_ = now + kPublishInterval;
    write_all(lockstep, now);
  }

  void finish(const Lockstep& lockstep, TimePoint now) {
    write_all(lockstep, now);
    writer_.close();
    if (const auto error = writer_.take_error()) throw std::runtime_error(*error);
  }

  SendResult send(const SceneState& scene) noexcept override { return write(scenes_, scene); }
  SendResult send(const MeshFrame& frame) noexcept override { return write(meshes_, frame); }

 private:
  template <class Batch>
  static void begin(Batch& batch, std::uint64_t session_id, const std::string& side) {
    batch.header.session_id = session_id;
    batch.node_version = version();
    batch.side = side;
  }

  void write_all(const Lockstep& lockstep, TimePoint now) {
    now_ = now;
    display_.publish({.scene_subscriptions = 1, .mesh_subscriptions = 1, .has_mesh_watcher = true},
                     newest_, now);
    device_.counters = lockstep.device_counters();
    mofc_.counters = lockstep.mofc_counters();
    physics_.counters = lockstep.physics_counters();
    display_.count_into(physics_.counters);
    // first: a reader has it before the row that it belongs to is complete
    if (!ideal_.records.empty()) {
      writer_.write(kIdealChannel, now_ns(), encode_ideal(ideal_));
      ideal_.records.clear();
    }
    write_batch(device_codec_, device_);
    write_batch(mofc_codec_, mofc_);
    write_batch(physics_codec_, physics_);
  }

  template <class Batch>
  void write_batch(Codec<Batch>& codec, Batch& batch) {
    batch.header.sampled_at = now_;
    write(codec, batch);
    ++batch.header.sequence;
    batch.records.clear();
  }

  template <class T>
  SendResult write(Codec<T>& codec, const T& message) {
    static const std::size_t channel = TelemetryMessage(std::in_place_type<T>).index();
    writer_.write(channel, now_ns(), payload_of(codec, message));
    return SendResult::kSent;
  }

  [[nodiscard]] std::uint64_t now_ns() const {
    return static_cast<std::uint64_t>(now_.time_since_epoch().count());
  }

  viewer::McapWriter writer_;
  physics::SceneDisplay display_;
  TimePoint now_{};
  TimePoint next_at_{};
  DeviceBatch device_;
  MofcBatch mofc_;
  PhysicsBatch physics_;
  IdealForces ideal_;
  std::vector<PhysicsTick> newest_;  // none or one
  Codec<DeviceBatch> device_codec_;
  Codec<MofcBatch> mofc_codec_;
  Codec<PhysicsBatch> physics_codec_;
  Codec<SceneState> scenes_;
  Codec<MeshFrame> meshes_;
};

SceneState lockstep_scene(const Session& session) {
  struct Taker final : Sender<SceneState>, Sender<MeshFrame> {
    SceneState newest;
    SendResult send(const SceneState& scene) noexcept override {
      newest = scene;
      return SendResult::kSent;
    }
    SendResult send(const MeshFrame& /*frame*/) noexcept override { return SendResult::kNoPeer; }
  } taker;
  physics::SceneDisplay display(session, kLockstepPhysics, taker, taker);
  display.publish({.scene_subscriptions = 1}, {}, TimePoint{});
  return taker.newest;
}

LockstepRecorder::LockstepRecorder(const viewer::RecordOptions& options, const Session& session,
                                   const std::string& recorded_by)
    : impl_(std::make_unique<Impl>(options, session, recorded_by)) {}
LockstepRecorder::~LockstepRecorder() = default;
void LockstepRecorder::listen_to(LockstepOptions& options) { impl_->listen_to(options); }
void LockstepRecorder::pump(const Lockstep& lockstep, const TickRow& row, const IdealState& ideal) {
  impl_->pump(lockstep, row, ideal);
}
void LockstepRecorder::finish(const Lockstep& lockstep, TimePoint now) {
  impl_->finish(lockstep, now);
}

}  // namespace palpate
