// SPDX-License-Identifier: Apache-2.0
// hops_fuzz.cpp — any frame that a codec accepts, given to the node that receives it. What the node
// then sends is finite, is accepted by the codec of its receiver, and a force never exceeds the
// device's limit.
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/core/inbox.h"
#include "common/core/memory_link.h"
#include "common/link/codec/codec.h"
#include "mofc_node/mofc_node.h"
#include "physics_node/physics_node.h"
#include "physics_node/scene_engine.h"
#include "tests/support/device_node_bench.h"
#include "tests/support/scripted_device.h"

namespace {

using namespace palpate;
using namespace std::chrono_literals;

template <class T>
bool decoded(std::span<const std::byte> frame, T& message) {
  static Codec<T> codec;
  return codec.decode(frame, message) == DecodeError::kNone;
}

/// Requires that the receiver's codec accepts the message.
template <class T>
void require_accepted(const T& message) {
  static Codec<T> codec;
  std::vector<std::byte> frame(codec.encode(message));
  codec.write(frame.data());
  T received;
  PALPATE_REQUIRE(codec.decode(frame, received) == DecodeError::kNone);
}

template <class Record>
struct NoTicks final : TickSink<Record> {
  void keep(const Record&) noexcept override {}
};

/// Hop 1 and hop 3: a mofc_node whose device and physics are hostile. The states of the device have
/// increasing stamps; everything else is as it came.
class Mofc {
 public:
  ToolMotion tick(DeviceState state) {
    clock_.advance(1ms);
    state.header = {.session_id = kDevice, .sequence = sequence_++, .sampled_at = clock_.now()};
    const Duration shift = state.acting_until - state.header.sampled_at;
    if (shift < 0ms || shift > 1s) state.acting_until = state.header.sampled_at;
    const ForceCommand command =
        node_.answer({.value = state, .received_at = clock_.now(), .skipped_before = 0});
    node_.finish_turn();
    require_accepted(command);
    ToolMotion motion;
    TimePoint at;
    while (motions_.receive(motion, at)) require_accepted(motion);
    newest_ = {kDevice, state.header.sequence, state.header.sampled_at};
    return motion;
  }
  /// The Interaction as an answer to the newest state, about the store of this node.
  void receive(Interaction interaction, std::uint64_t store_id) {
    interaction.header.sequence = next_++;
    interaction.device_session_id = newest_.session_id;
    interaction.device_sequence = newest_.sequence;
    interaction.device_sampled_at = newest_.sampled_at;
    if (interaction.surface.store_id != 0) interaction.surface.store_id = store_id;
    interactions_.send(interaction);
  }

 private:
  static constexpr std::uint64_t kDevice = 1;

  static MofcConfig config() {
    MofcConfig config;
    config.stale_after = 150ms;
    config.fade = 50ms;
    return config;
  }

  ManualClock clock_;
  MemoryLink<ToolMotion> motions_{clock_};
  MemoryLink<Interaction> interactions_{clock_};
  Inbox<Interaction> in_{interactions_, clock_};
  NoTicks<MofcTick> ticks_;
  mofc::MofcNode node_{
      config(), {.lease = 2ms, .longest_lease = 10ms, .reply = 800us, .prompt = 500us},
      clock_,   motions_,
      in_,      ticks_,
      77};
  std::uint64_t sequence_ = 0;
  std::uint64_t next_ = 0;
  DeviceStamp newest_;
};

void hostile_physics(const Interaction& interaction) {
  Mofc mofc;
  DeviceState state;
  state.tool_position_world_m = interaction.tool_position_world_m;
  state.tool_orientation_world = interaction.tool_orientation_world;
  std::uint64_t store_id = mofc.tick(state).receipts.store_id;
  constexpr double kStepM = 1e-3;
  for (const Vector3& moved :
       {Vector3(0, 0, 0), Vector3(kStepM, 0, 0), Vector3(0, kStepM, 0), Vector3(0, 0, kStepM),
        Vector3(0, 0, -kStepM), Vector3(-0.1, 0.2, -0.3)}) {
    mofc.receive(interaction, store_id);
    state.tool_position_world_m = interaction.tool_position_world_m + moved;
    state.hand_position_m = moved;
    if (state.tool_position_world_m.lpNorm<Eigen::Infinity>() > 1e3) continue;
    store_id = mofc.tick(state).receipts.store_id;
  }
}

void hostile_device(const DeviceState& state) {
  Mofc mofc;
  for (int i = 0; i < 3; ++i) (void)mofc.tick(state);
}

/// Hop 2: a scene of each kind of analytic tissue.
void hostile_motion(const ToolMotion& motion) {
  static const SceneConfig kScene = [] {
    const KelvinVoigtMaterial material{.stiffness_newton_per_m = 500.0,
                                       .damping_newton_s_per_m = 5.0,
                                       .stiffening_newton_per_m3 = 1e6,
                                       .relaxing_stiffness_newton_per_m = 200.0,
                                       .relaxation_time_s = 0.2,
                                       .friction_coefficient = 0.3,
                                       .friction_stiffness_newton_per_m = 500.0};
    const KelvinVoigtMaterial power{.stiffness_newton_per_m = 500.0,
                                    .damping_newton_s_per_m = 5.0,
                                    .exponent = 1.5,
                                    .friction_stiffness_newton_per_m = 500.0,
                                    .puncture_newton = 3.0,
                                    .cutting_newton = 1.0};
    SceneConfig scene{
        .tip_radius_m = 0.002, .shaft_length_m = 0.1, .shaft_radius_m = 0.002, .tissues = {}};
    scene.tissues = {
        {.name = "floor", .geometry = HalfSpaceGeometry{}, .material = material},
        {.name = "ball", .geometry = SphereGeometry{.radius_m = 0.05}, .material = power},
        {.name = "block",
         .geometry = BoxGeometry{},
         .material = material,
         .motion = {.amplitude_m = {0, 0, 0.01}, .frequency_hz = 1.0}},
        {.name = "vessel", .geometry = CapsuleGeometry{.to_m = {0.1, 0, 0}}, .material = power}};
    return scene;
  }();
  ManualClock clock;
  MemoryLink<ToolMotion> motions{clock};
  MemoryLink<Interaction> interactions{clock};
  Inbox<ToolMotion> in{motions, clock};
  NoTicks<PhysicsTick> ticks;
  physics::SceneEngine engine(kScene, {}, InteractionUse::kLocal);
  physics::PhysicsNode node(engine, {}, InteractionUse::kLocal, clock, in, interactions, ticks, 3);
  ToolMotion next = motion;
  for (std::uint64_t i = 0; i < 6; ++i) {
    clock.advance(1ms);
    next.header.sequence = i;
    // what was sent is acknowledged in two ways: as claimed, and all of it
    if (i == 3) next.receipts = {.store_id = 1, .newest = 64, .received = ~std::uint64_t{0}};
    if (i == 4) next.tool_position_world_m = {0.01, 0.0, -0.001};
    motions.send(next);
    node.step({.index = i, .scheduled_at = clock.now(), .now = clock.now()});
    Interaction interaction;
    TimePoint at;
    while (interactions.receive(interaction, at)) require_accepted(interaction);
  }
}

/// Hop 4: a command of any force and lease.
void hostile_command(const ForceCommand& command) {
  DeviceConfig config = test::device_config();
  config.longest_lease = 10ms;
  config.slew_newton_per_s = 660.0;
  test::DeviceNodeBench<test::ScriptedDevice> bench(config);
  bench.answer_with(command.force_on_hand_newton, command.valid_for);
  Vector3 acting = Vector3::Zero();
  for (int i = 0; i < 5; ++i) {
    bench.tick();
    const Vector3& force = bench.ticks.back().force_on_hand_newton;
    constexpr double kRounding = 1e-9;
    PALPATE_REQUIRE(force.norm() <= config.peak_force_newton + kRounding);
    PALPATE_REQUIRE((force - acting).norm() <= acting.norm() + 0.66 + kRounding);
    acting = force;
  }
  for (const DeviceState& state : bench.states) require_accepted(state);
}

}  // namespace

/// The first byte of a frame selects its decoder.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto frame = std::as_bytes(std::span(data, size));
  if (frame.empty()) return 0;
  if (Interaction m; decoded(frame, m)) hostile_physics(m);
  if (DeviceState m; decoded(frame, m)) hostile_device(m);
  if (ToolMotion m; decoded(frame, m)) hostile_motion(m);
  if (ForceCommand m; decoded(frame, m)) hostile_command(m);
  return 0;
}
