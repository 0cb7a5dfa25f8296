// session.h — one deployment as plain structs, validated and with every default filled in.
// The file's schema, with units, ranges and defaults: proto/palpate/v1/session.proto.
// Loading: common/runtime/session_file.h. A node is handed only its own part.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "common/core/clock.h"
#include "common/core/fault_line.h"
#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

/// ZeroMQ endpoints: ipc://, tcp:// or inproc://. The node named first binds.
struct LinksConfig {
  std::string exchange;           ///< mofc ← device, hops 1 and 4
  std::string tool_motion;        ///< physics ← mofc, hop 2
  std::string interaction;        ///< physics → mofc, hop 3
  std::string device_telemetry;   ///< device → viewers, hop 5
  std::string mofc_telemetry;     ///< mofc → viewers, hop 5
  std::string physics_telemetry;  ///< physics → viewers, hop 5
  std::string hand_target;        ///< device ← viewers, hop 6
};

/// SCHED_FIFO for the tick threads; taken when permitted, reported, never required.
struct RealtimeConfig {
  int priority = 80;  ///< 1 … 99; 0: ordinary scheduling
  int cpu = 0;        ///< the one processor that device_node and mofc_node share; −1: no pinning
  WaitStrategy wait = WaitStrategy::kHybrid;
};

struct WorkspaceConfig {
  double scale_ratio = 1.0;            ///< tool displacement / hand displacement
  double force_ratio = 1.0;            ///< force on hand / force on tool
  Vector3 offset_m = Vector3::Zero();  ///< tool position in W when the hand is at D's origin
  std::optional<std::uint32_t> clutch_button;
};

/// Friction that acts on each axis of D by itself: f_d,i v_i + f_co,i sgn(v_i).
struct FrictionPerAxis {
  Vector3 viscous_newton_s_per_m = Vector3::Zero();  ///< f_d,i
  Vector3 coulomb_newton = Vector3::Zero();          ///< f_co,i
};

/// What the ledger may count on: lower bounds over the workspace (CONTROLLERS §1.3).
struct DeviceProfile {
  double viscous_newton_s_per_m = 0.1;   ///< f_d of the isotropic friction f_d v + f_co v/|v|
  double coulomb_newton = 0.1;           ///< f_co; at most the smallest f_co,i
  double position_resolution_m = 55e-6;  ///< q, per axis
  std::optional<FrictionPerAxis> per_axis = {};
};

/// The true values of a simulated device; the controller sees only the profile.
struct SimulatedDeviceConfig {
  double mass_kg = 0.045;
  double viscous_newton_s_per_m = 0.1;
  double coulomb_newton = 0.1;
  std::optional<FrictionPerAxis> per_axis = {};  ///< instead of the two above, which are isotropic
  double position_resolution_m = 55e-6;          ///< 0: exact
  double peak_force_newton = 3.3;
  Duration inner_step = std::chrono::microseconds(50);  ///< upper bound
};

struct DeviceConfig {
  double rate_hz = 1000.0;
  Duration reply{};                ///< deadline for the answer, from the reading
  Duration lease{};                ///< T_hold: valid_for of a command; ≤ 3 periods
  Duration limp_after{};           ///< silence after which the fallback fades
  Duration fade{};                 ///< length of that fade
  Duration start_ramp{};           ///< limp start: the force grows from nothing over this time
  double peak_force_newton = 3.3;  ///< of this session; the device's own limit holds too
  double slew_newton_per_s = 0.0;  ///< limit on growing force; 0: none
  double v_fault_m_per_s = 10.0;   ///< a hand that is faster is a fault of the encoder
  WorkspaceConfig workspace;
  DeviceProfile profile;
  SimulatedDeviceConfig simulated;
};

// --- the simulated hand ---------------------------------------------------------------------

/// The paper's V: free motion above the tissue, down one leg, up the other.
struct VPath {
  Vector3 apex_m = Vector3(0, 0, -0.02);  ///< D, the lowest point
  Vector3 normal = Vector3::UnitZ();      ///< unit, out of the tissue: legs end `height_m` along it
  Vector3 tangent = Vector3::UnitX();     ///< unit, ⟂ normal: from the first leg to the second
  double height_m = 0.05;                 ///< of the ends above the apex
  double half_width_m = 0.03;             ///< of the V at its ends
  double speed_m_per_s = 0.08;            ///< along the legs
  double free_motion_s = 0.0;             ///< t_free
  double free_amplitude_m = 0.02;         ///< radius of the circle before the V, in its plane
  double free_frequency_hz = 0.5;
};
struct HoldPath {
  Vector3 position_m = Vector3::Zero();
};
/// position = center + amplitude ∘ sin(2π frequency t + phase), per axis.
struct SinusoidPath {
  Vector3 center_m = Vector3::Zero();
  Vector3 amplitude_m = Vector3::Zero();
  Vector3 frequency_hz = Vector3::Zero();
  Vector3 phase_rad = Vector3::Zero();
};
/// Columns t,x,y,z of a CSV file, SI units, t increasing; linear in between, first and last held.
struct RecordedPath {
  struct Sample {
    double t_s = 0.0;
    Vector3 position_m = Vector3::Zero();
  };
  std::vector<Sample> samples;  ///< loaded and checked
  bool loops = false;
};
/// A hand that tries to draw energy out of the force it feels.
struct HostilePath {
  Vector3 center_m = Vector3::Zero();  ///< stays within `radius_m` of it
  double radius_m = 0.02;
  double v_max_m_per_s = 0.5;  ///< of the intended point
};
using PathConfig = std::variant<VPath, HoldPath, SinusoidPath, RecordedPath, HostilePath>;

struct ButtonPress {
  std::uint32_t button = 0;
  double from_s = 0.0;
  double until_s = 0.0;
};

/// How a viewer's page may lead the hand.
struct PointerConfig {
  Vector3 center_m = Vector3::Zero();  ///< D; targets stay within `reach_m` of it
  double reach_m = 0.1;
  double speed_m_per_s = 0.25;                        ///< the intended point moves at most so fast
  Duration holder_timeout = std::chrono::seconds(2);  ///< silence that frees the hand for another
};

/// Mass, spring and damper towards the intended path, CONTROLLERS §6.2 and 7.3.
struct HandConfig {
  double mass_kg = 0.255;
  double stiffness_newton_per_m = 150.0;
  double damping_newton_s_per_m = 6.0;
  PathConfig path = HoldPath{};
  std::vector<ButtonPress> presses{};
  std::optional<PointerConfig> pointer{};  ///< none: the hand keeps to its path
};

// --- mofc -------------------------------------------------------------------------------------

enum class ControllerKind : std::uint8_t { kNone, kMofc };
enum class MofcMode : std::uint8_t { kPaper, kVector, kGuard };
/// What is made of an Interaction until the next one comes.
enum class InteractionUse : std::uint8_t {
  kLocal,  ///< its local contact model, evaluated at the device's rate
  kHeld,   ///< its force, held
};
/// Mode paper: the Coulomb friction that each axis counts.
enum class PaperFriction : std::uint8_t {
  kAsPublished,  ///< f_co
  kIsotropic,    ///< f_co/√3
};

/// Mode guard: what is assumed of the hand, and how far credit may grow.
struct GuardConfig {
  double v_max_m_per_s = 0.5;      ///< fastest the hand can be
  double credit_cap_joule = 5e-3;  ///< S_cap: E′ above the energy stored in the tissue
  double gate_joule = 10e-3;       ///< S_g: leak that closes the gate
  Duration gate_recovery = std::chrono::milliseconds(500);  ///< t_rec
};

/// Backward difference, then a low-pass.
struct DifferenceVelocity {
  Duration time_constant{};  ///< 0: none
};
/// First-order adaptive windowing, then a low-pass.
struct AdaptiveWindowVelocity {
  Duration max_window = std::chrono::milliseconds(20);
  bool is_best_fit = true;   ///< else the line through the window's ends
  Duration time_constant{};  ///< 0: none
};
struct KalmanVelocity {
  enum class Model : std::uint8_t { kConstantVelocity, kConstantAcceleration };
  Model model = Model::kConstantAcceleration;
  double noise_density =
      10.0;  ///< of the jerk, m²/s⁵; of the acceleration, m²/s³, if constant velocity
  double moving_mass_kg = 0.3;  ///< that the motors' force moves; 0: their force is not used
};
/// How the tool's velocity is estimated: mofc_node/velocity_estimator.h.
using VelocityEstimatorConfig =
    std::variant<DifferenceVelocity, AdaptiveWindowVelocity, KalmanVelocity>;

/// Hop 2 thinned: a motion is sent when the tool has moved on, or after `keep_alive`.
struct MotionDeadband {
  double ratio = 0.05;          ///< k of the velocity
  double floor_m_per_s = 2e-3;  ///< least change of velocity that counts
  double floor_m = 1e-4;        ///< change of position that counts
  double floor_rad = 0.02;      ///< change of orientation that counts
  Duration keep_alive = std::chrono::milliseconds(20);
};
/// Hop 3 thinned: an Interaction is sent when the receiver's force is wrong, or after `keep_alive`.
struct InteractionDeadband {
  double ratio = 0.05;         ///< k of the force
  double floor_newton = 0.05;  ///< least error that counts
  Duration keep_alive = std::chrono::milliseconds(20);
};

struct MofcConfig {
  ControllerKind controller = ControllerKind::kMofc;
  MofcMode mode = MofcMode::kGuard;
  GuardConfig guard;
  PaperFriction paper_friction = PaperFriction::kAsPublished;
  Duration wait_for_physics{};  ///< 0: never wait; else answer from the Interaction of this tick
  Duration delta_max{};         ///< longest time from the reading to the switch; not in mode paper
  InteractionUse interaction = InteractionUse::kLocal;
  double handover_newton_per_s = 100.0;  ///< fastest change that a new contact model alone may make
  Duration stale_after{};                ///< silence on hop 3 after which the force fades
  Duration fade{};
  VelocityEstimatorConfig velocity_estimator = KalmanVelocity{};
  std::optional<MotionDeadband> motion_deadband{};  ///< none: every motion is sent
};

// --- scene ------------------------------------------------------------------------------------

/// Fills the side of the plane away from `normal`.
struct HalfSpaceGeometry {
  Vector3 point_m = Vector3::Zero();
  Vector3 normal = Vector3::UnitZ();  ///< unit, out of the tissue
};
struct SphereGeometry {
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.01;
};
/// Axes along W.
struct BoxGeometry {
  Vector3 center_m = Vector3::Zero();
  Vector3 size_m = Vector3::Constant(0.1);  ///< full edge lengths
};
/// All points within `radius_m` of the line from one end to the other.
struct CapsuleGeometry {
  Vector3 from_m = Vector3::Zero();
  Vector3 to_m = Vector3::Zero();  ///< the same place: a sphere
  double radius_m = 0.01;
};
/// A surface from a file, in a frame of its own: lengths times `unit_m`, then turned, then moved.
/// physics_node reads the file (physics_node/surface_files.h), nobody else needs it.
struct FileGeometry {
  enum class Kind : std::uint8_t {
    kPointCloud,       ///< PLY
    kTriangleSurface,  ///< OBJ, STL
    kTetrahedralMesh,  ///< Gmsh .msh, legacy VTK
  };
  Kind kind = Kind::kPointCloud;
  std::string file;                      ///< path, from the folder of the program
  double unit_m = 1.0;                   ///< length of 1 in the file
  std::string stiffness_property{};      ///< of a cloud's points: factor on the stiffness; "": none
  Vector3 position_m = Vector3::Zero();  ///< of the file's origin, in W
  Quaternion rotation = Quaternion::Identity();
};
using Geometry =
    std::variant<HalfSpaceGeometry, SphereGeometry, BoxGeometry, CapsuleGeometry, FileGeometry>;

/// A ball of other stiffness and damping inside a tissue, such as a tumour; the change is smooth.
struct InclusionConfig {
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.005;      ///< where the change is half done
  double transition_m = 0.002;  ///< thickness of the shell in which it happens
  double stiffness_newton_per_m = 0.0;
  double damping_newton_s_per_m = 0.0;
};

/// The paper's tissue: force along the normal k·p + b·ṗ for penetration p > 0; and what soft tissue
/// does besides.
struct KelvinVoigtMaterial {
  double stiffness_newton_per_m = 500.0;         ///< k
  double damping_newton_s_per_m = 0.0;           ///< b
  bool is_damping_isotropic = false;             ///< b acts on the tangential motion too
  bool is_adhesive = false;                      ///< may pull while p > 0
  double stiffening_newton_per_m3 = 0.0;         ///< k₃: adds k₃ p³
  double relaxing_stiffness_newton_per_m = 0.0;  ///< k₁: adds k₁ (p − z), τ ż = p − z
  double relaxation_time_s = 0.0;                ///< τ
  std::vector<InclusionConfig> inclusions{};
  double friction_coefficient = 0.0;  ///< μ ≥ 0 of Coulomb friction; 0: slippery
  double friction_stiffness_newton_per_m =
      0.0;                       ///< of the tissue along its surface while it sticks
  double puncture_newton = 0.0;  ///< press of the tip, along the normal, that punctures; 0: never
  double cutting_newton = 0.0;   ///< most that punctured tissue holds the tip with
};
using Material = std::variant<KelvinVoigtMaterial>;

/// The tissue goes to and fro as a whole, as with breath or pulse: a sin(2πft + φ).
struct TissueMotionConfig {
  Vector3 amplitude_m = Vector3::Zero();
  double frequency_hz = 0.0;
  double phase_rad = 0.0;
};

struct TissueConfig {
  std::string name;
  Geometry geometry;
  Material material;
  TissueMotionConfig motion{};
};

struct SceneConfig {
  double tip_radius_m = 0.0;  ///< spherical tool tip; 0: a point
  double shaft_length_m =
      0.0;  ///< from the tip's centre towards the handle, along T's +z; 0: only a tip
  double shaft_radius_m = 0.0;
  std::vector<TissueConfig> tissues;
};

struct PhysicsConfig {
  double rate_hz = 1000.0;
  double reach_m = 0.05;  ///< tissues this near to the tip are described before they are touched
  std::optional<InteractionDeadband> interaction_deadband{};  ///< none: every step is sent
};

/// The page and the Foxglove WebSocket of viewer_node, on loopback.
struct WebConfig {
  bool is_on = true;
  std::uint16_t port = 8765;  ///< 0: any free one
};

struct ViewerConfig {
  Duration status_interval = std::chrono::milliseconds(500);
  WebConfig web;
};

struct FaultsConfig {
  LinkFaults device_state;
  LinkFaults force_command;
  LinkFaults tool_motion;
  LinkFaults interaction;
};

/// What the links over tcp ask of a peer.
struct SecurityConfig {
  std::string key_folder{};   ///< as `palpate keygen` makes it; empty: no keys
  bool may_be_plain = false;  ///< without keys beyond loopback too: --insecure
};

/// The whole deployment.
struct Session {
  std::string name;
  std::string file;  ///< as given on the command line, for messages
  std::string text;  ///< as it counts, overrides applied; protobuf text format
  double duration_s = 10.0;
  std::uint64_t seed = 1;
  LinksConfig links;
  RealtimeConfig realtime;
  DeviceConfig device;
  HandConfig hand;
  MofcConfig mofc;
  PhysicsConfig physics;
  SceneConfig scene;
  ViewerConfig viewer;
  FaultsConfig faults;
  SecurityConfig security;

  /// Several devices in one tissue: the session as it is for each of them; what stands above is
  /// that of the first. Empty for one device.
  std::vector<Session> sides;
  std::string side;  ///< in `sides`: its name
};

/// One session for each device: its sides, or itself if it has none.
[[nodiscard]] std::span<const Session> sides_of(const Session& session);

/// That of the side. Throws SetupError, naming those there are, if `name` is none of them; "" is
/// for a session without sides.
[[nodiscard]] const Session& side_of(const Session& session, const std::string& name);

/// "device"; of a side "left.device".
[[nodiscard]] std::string with_side(const std::string& side, const std::string& name);

/// "none", "mofc paper", "mofc vector", "mofc guard".
[[nodiscard]] std::string controller_text(const MofcConfig& config);

/// Seed of one random stream of a session: different for every `stream` name, same on every run.
[[nodiscard]] std::uint64_t stream_seed(std::uint64_t session_seed, const char* stream);

}  // namespace palpate
