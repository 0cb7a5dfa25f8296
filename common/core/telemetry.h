// telemetry.h — hop 5 as plain structs: one record per tick of each node, and counters since the
// start. Periodic threads only fill records and push them to a sink; batching, encoding and
// publishing happen elsewhere.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/core/messages.h"
#include "common/core/ports.h"
#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

/// What device_node lets the motors do.
enum class GuardState : std::uint8_t {
  kLimp = 0,      ///< nothing: no command yet, or silence longer than limp_after + fade
  kAnswered = 1,  ///< the answer to this tick
  kLeased = 2,    ///< the previous command, its lease still runs
  kFallback = 3,  ///< at most the device's own Coulomb friction
  kFading = 4,    ///< fallback on its way to zero
  kFault = 5,     ///< nothing: a latched fault, until it is reset
};
[[nodiscard]] const char* name(GuardState state);

/// Why device_node let go of the motors until somebody resets it.
enum class FaultReason : std::uint8_t {
  kNone = 0,
  kReadFailed = 1,        ///< the device gave no reading
  kReadingNotFinite = 2,  ///< it gave one with NaN or infinity in it
  kPositionJumped = 3,    ///< two readings that only a hand faster than v_fault could have made
  kWriteFailed = 4,       ///< the motors did not take their force
};
[[nodiscard]] const char* name(FaultReason reason);

/// What mofc_node makes of the physics.
enum class MofcState : std::uint8_t {
  kNoPhysics = 0,  ///< nothing heard yet, or silent and faded out: asks for nothing
  kFree = 1,       ///< fresh, no contact
  kContact = 2,    ///< fresh, contact
  kFading = 3,     ///< silent beyond stale_after
  kClutched = 4,   ///< hand and tool uncoupled: asks for nothing
};
[[nodiscard]] const char* name(MofcState state);

/// One device tick, row k of DESIGN's CSV on the device's side.
struct DeviceTick {
  std::uint64_t sequence = 0;  ///< of the DeviceState; none was sent in a tick of kFault
  TimePoint sampled_at{};      ///< t_k, device's clock
  TimePoint switched_at{};     ///< when this tick's force began to act
  Duration lateness{};         ///< begin of the tick after its appointment
  Duration reply_time{};       ///< from sending to the answer; meaningless unless answered
  Vector3 measured_hand_position_m = Vector3::Zero();  ///< D; the last one that was finite
  Vector3 measured_tool_position_world_m = Vector3::Zero();
  Quaternion measured_tool_orientation_world = Quaternion::Identity();  ///< W from T; likewise
  Vector3 force_on_hand_newton = Vector3::Zero();  ///< D, acting from switched_at on
  GuardState guard = GuardState::kLimp;
  bool is_answered = false;      ///< in this tick, in time
  bool is_peak_limited = false;  ///< reduced by the device's peak or slew limit
  bool is_clutched = false;

  /// Known to simulated devices only; NaN otherwise. The controller never sees these.
  Vector3 true_tool_position_world_m = Vector3::Constant(kNaN);
  Vector3 true_tool_velocity_world_m_per_s = Vector3::Constant(kNaN);
  double true_energy_joule = kNaN;          ///< DESIGN §2, at t_k
  double minimum_true_energy_joule = kNaN;  ///< over all inner steps so far
};

/// One answer of mofc_node.
struct MofcTick {
  std::uint64_t device_session_id = 0;
  std::uint64_t device_sequence = 0;                     ///< the DeviceState answered
  TimePoint device_sampled_at{};                         ///< device's clock
  Vector3 asked_force_on_hand_newton = Vector3::Zero();  ///< before fade and clamp, D
  Vector3 commanded_force_on_hand_newton = Vector3::Zero();
  Vector3 f_max_newton = Vector3::Constant(kNaN);  ///< NaN: no bound (controller none)
  double ledger_energy_joule = kNaN;               ///< E' of the controller; NaN: none kept
  Duration force_age{};  ///< device time since the DeviceState that the physics answered; 0 if none
  MofcState state = MofcState::kNoPhysics;
  bool is_clamped = false;
  bool is_in_contact = false;  ///< as physics last said
};

/// One physics step.
struct PhysicsTick {
  std::uint64_t sequence = 0;
  TimePoint stepped_at{};  ///< physics' clock
  std::uint64_t device_sequence = 0;
  Vector3 tool_position_world_m = Vector3::Zero();
  Vector3 force_on_tool_newton = Vector3::Zero();
  double stored_energy_joule = 0.0;
  std::uint32_t contact_count = 0;
  Duration compute_time{};
};

struct LoopCounters {
  std::uint64_t ticks = 0;          ///< turns begun
  std::uint64_t skipped_ticks = 0;  ///< appointments missed by overruns
  Duration worst_lateness{};
};

struct DeviceCounters {
  LoopCounters loop;
  LinkCounters force_command;
  std::uint64_t answered_ticks = 0;
  std::uint64_t leased_ticks = 0;
  std::uint64_t fallback_ticks = 0;  ///< fallback or fading
  std::uint64_t limp_ticks = 0;
  std::uint64_t peak_limited_ticks = 0;
  std::uint64_t fault_ticks = 0;    ///< with a latched fault
  std::uint64_t device_faults = 0;  ///< latched so far
  std::uint64_t fault_resets = 0;
  FaultReason last_fault = FaultReason::kNone;  ///< stays after its reset
  std::uint64_t non_finite_commands = 0;        ///< answers with NaN or infinity: no force
  double max_force_newton = 0.0;
  double minimum_true_energy_joule = kNaN;
};

struct MofcCounters {
  LinkCounters device_state;
  LinkCounters interaction;
  std::uint64_t ticks = 0;
  std::uint64_t contact_ticks = 0;
  std::uint64_t clamped_ticks = 0;
  std::uint64_t too_fast_ticks = 0;  ///< the hand was faster than mode guard assumes
  std::uint64_t stale_ticks = 0;
  std::uint64_t late_physics_ticks = 0;  ///< wait_for_physics ran out
  std::uint64_t ledger_resets = 0;       ///< new device session, or a gap in the echo
  std::uint64_t motions_dropped = 0;     ///< tool_motion not taken by the link
  std::uint64_t motions_suppressed = 0;  ///< not sent: within mofc.motion_deadband
  /// Running sums for the transparency of the session so far, over samples asked > 0.05 N:
  /// projected and capped (DESIGN §3), from the force the device really applied.
  double transparency_sum = 0.0;
  std::uint64_t transparency_samples = 0;
};

struct PhysicsCounters {
  LoopCounters loop;
  LinkCounters tool_motion;
  std::uint64_t contact_steps = 0;
  std::uint64_t tissues_skipped = 0;        ///< by the broad phase, summed over steps
  std::uint64_t tissues_visited = 0;        ///< the others, summed over steps
  std::uint64_t octree_cells_visited = 0;   ///< of clouds, summed over steps; 0 without clouds
  std::uint64_t octree_last_cell_hits = 0;  ///< nearest points found where the last one was
  std::uint64_t tissues_asleep = 0;   ///< that relax, at rest: not advanced, summed over steps
  std::uint64_t surfaces_shared = 0;  ///< tissues whose file an earlier tissue had loaded already
  std::uint64_t interactions_suppressed = 0;  ///< not sent: within physics.interaction_deadband
  std::uint64_t mesh_frames = 0;              ///< made for viewers; of all tools
  std::uint64_t meshes_skipped = 0;           ///< due, 30 a second, and not made: nobody looked on
  Duration worst_compute_time{};
};

/// What one publication of a node carries: the ticks since the last one, the counters since the
/// start.
template <class Record, class Counters>
struct TelemetryBatch {
  Header header;
  Counters counters;
  std::uint64_t records_lost = 0;   ///< did not fit the ring between tick and telemetry thread
  std::uint64_t peers_refused = 0;  ///< connections that failed for want of the right keys
  std::string node_version{};       ///< of the program
  std::string side{};               ///< of the session; "" where there is one device
  std::vector<Record> records;
};
using DeviceBatch = TelemetryBatch<DeviceTick, DeviceCounters>;
using MofcBatch = TelemetryBatch<MofcTick, MofcCounters>;
using PhysicsBatch = TelemetryBatch<PhysicsTick, PhysicsCounters>;

/// Where a periodic thread leaves its records. Never blocks, allocates or throws.
template <class Record>
class TickSink {
 public:
  virtual ~TickSink() = default;
  virtual void keep(const Record& record) noexcept = 0;
};

}  // namespace palpate
