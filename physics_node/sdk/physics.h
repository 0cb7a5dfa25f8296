// SPDX-License-Identifier: Apache-2.0
/// @file
/// physics.h — a physics of your own: a program that computes the force on the tool, in any engine.
///
///     find_package(palpate COMPONENTS physics)       target_link_libraries(mine palpate::physics)
///     physics { command: ["./mine", "scene.xml"] }   in the session: `palpate launch` starts it
///
/// Implement Engine::step, hand it to run(), and the rest is given: command line, session, links,
/// keys, rate loop, telemetry, viewers' meshes, signals, restart by `palpate launch`. The clamp on
/// the device's side bounds what the answers can do to the hand, whatever they are.
/// docs/extending.md explains; examples/half_space is a whole program. SI units, frame W (world).
/// An answer out of the ranges given below ends the program with a message and exit status 1, a
/// wrong surface with exit status 2.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

/// What a physics from elsewhere is written against.
namespace palpate::sdk {

using Vector3 = Eigen::Vector3d;  ///< x, y, z

/// Pose and velocity of the tool, as mofc_node knows them.
struct Motion {
  Vector3 position_m = Vector3::Zero();                             ///< tip, W
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< W from the tool's frame
  Vector3 velocity_m_per_s = Vector3::Zero();                       ///< of the tip, W
  std::uint32_t buttons = 0;                                        ///< bit i: button i is held
  bool is_new = true;   ///< false: nothing arrived since the last step, answer it again
  double time_s = 0.0;  ///< of this step, from an arbitrary origin; never goes back
};

/// A tissue that the tool touches or is close to, at the pose of the motion that it answers.
///
/// With a stiffness it is the contact model that mofc_node evaluates at the device's rate, along
/// the normal: (stiffness · penetration − damping · speed out of the tissue), at least 0. Without,
/// stiffness and depth are estimated from the forces of the steps so far (docs/extending.md).
/// Report a tissue before it is touched too: then the contact begins where it should.
struct Contact {
  Vector3 normal = Vector3::UnitZ();  ///< unit, out of the tissue, W
  double penetration_m = 0.0;         ///< > 0: touching; else the negative distance; ±1000
  std::optional<double> stiffness_newton_per_m = {};  ///< 0 … 1e6; none: estimated
  double damping_newton_s_per_m = 0.0;                ///< along the normal, 0 … 1e4
  /// Hessian of the distance, 1/m, 3×3, W, symmetric, ±1e9; of a sphere (I − n nᵀ) / radius. 0:
  /// flat.
  Eigen::Matrix3d curvature_per_m = Eigen::Matrix3d::Zero();
  Vector3 surface_velocity_m_per_s = Vector3::Zero();  ///< W; each ±10
  double friction_coefficient = 0.0;                   ///< Coulomb's μ, 0 … 10; 0: none
  /// Of the tangential spring that slips at μ times the normal force, 0 … 1e6.
  double friction_stiffness_newton_per_m = 0.0;
  Vector3 stretch_m = Vector3::Zero();  ///< of that spring at this pose, W; each ±1000
  double trust_radius_m = 1.0;          ///< how far from this pose the model holds; 1e-9 … 1000
  std::uint32_t tissue = 0;  ///< index of the tissue; contacts of one tissue belong together
  /// The engine's own force on the tool [N], W, each ±1e4, for contacts without stiffness. Either
  /// all of them have one, or none and the answer's force is that of their one tissue.
  std::optional<Vector3> force_on_tool_newton = {};
};

/// What one step gives: contacts, a force, or both.
struct Answer {
  /// Any number, of which the deepest eight are sent.
  std::vector<Contact> contacts = {};
  /// On the tool, of all tissues [N], W, each ±1e4. None: the sum of the contacts. Without contacts
  /// a contact model is estimated from the forces of the steps so far.
  std::optional<Vector3> force_on_tool_newton = {};
  /// Elastic, 0 … 1000; none: that of the contacts.
  std::optional<double> stored_energy_joule = {};
};

/// A tissue as viewers draw it, undeformed.
struct Surface {
  std::string name;                      ///< shown to people, UTF-8
  std::vector<float> vertices_m;         ///< W: x,y,z,x,y,z,…; each within ±1000
  std::vector<std::uint32_t> triangles;  ///< three indices each; empty: the vertices as points
};

/// The physics of one tool. All functions are called on one thread. An exception ends the program
/// with exit status 1, and `palpate launch` starts it again.
class Engine {
 public:
  virtual ~Engine() = default;

  /// The action of the tissue on the tool at this motion. Called physics.rate_hz times a second
  /// from the first motion on; if it takes longer than a period, turns are skipped and counted.
  virtual Answer step(const Motion& motion) = 0;

  /// The force on a tool that would rest at this place [N], W, each ±1e4. Asked a few times after a
  /// step that gives only a force, so that tissue is known before it is touched. Must change
  /// nothing that step() depends on. None (the default): the engine cannot say.
  virtual std::optional<Vector3> force_at(const Vector3& position_m) {
    static_cast<void>(position_m);
    return std::nullopt;
  }

  /// What viewers draw; called once, for the engine of the first side. The default: nothing.
  virtual std::vector<Surface> surfaces() { return {}; }
  /// The vertices of one of these as they are now. Asked after a step, at most 30 times a second,
  /// while a viewer is connected.
  /// @param surface  index into what surfaces() returned
  /// @param vertices_m  as in Surface, of the last call; to be overwritten in place, its size kept
  /// @return false: unchanged since the last call
  virtual bool deformed(std::size_t surface, std::vector<float>& vertices_m) {
    static_cast<void>(surface);
    static_cast<void>(vertices_m);
    return false;
  }
};

/// What is known before the first step.
struct Setup {
  std::filesystem::path session_file;  ///< as launched, or as --session names it
  std::string side;                    ///< of a session with several devices; else empty
  std::vector<std::string> arguments;  ///< of the program, behind its options
  double rate_hz = 0.0;                ///< physics.rate_hz: of the steps
  double tip_radius_m = 0.0;           ///< of the spherical tip of the tool; 0: a point
  double shaft_length_m = 0.0;         ///< from the tip's centre along +z of the tool; 0: none
  double shaft_radius_m = 0.0;         ///< of that shaft
  bool has_estimate = true;  ///< false: mofc_node holds forces (`mofc { interaction: held }`)
};

/// The set-up is wrong and a restart would not help; exit status 2. Say what, where and the remedy.
class SetupError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// What messages and --help say of the program.
struct Program {
  std::string name;            ///< for messages and --help
  std::string description;     ///< one sentence
  std::string arguments = {};  ///< what Setup::arguments are, for --help; empty: none are taken
};

/// Makes the engine of one side; called once for each before the first step. Not nullptr.
using MakeEngine = std::function<std::unique_ptr<Engine>(const Setup&)>;

/// Runs until SIGINT or SIGTERM; a second signal kills. The session is that of `palpate launch`, or
/// of `--session FILE` if the program is started by hand.
/// @return exit status: 0; 2 after a SetupError or wrong arguments; 1 after any other exception
int run(int argc, char** argv, const Program& program, const MakeEngine& make_engine);

}  // namespace palpate::sdk
