// SPDX-License-Identifier: Apache-2.0
// palpate_ros: topics of ROS 2 by DDS, without ROS.
//
//   palpate_ros --session FILE     a running session, or a replay, as topics: a viewer
//   palpate_ros physics            a publisher of forces as the physics of a session
//   palpate_ros device --session FILE   an arm behind topics as the device of a session
#include <CLI/CLI.hpp>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/check.h"
#include "deploy/ros/device/process.h"
#include "deploy/ros/physics/process.h"
#include "deploy/ros/viewer/process.h"
#include "physics_node/engine_process/launched_session.h"

namespace palpate::ros {
namespace {

/// Names with / between them.
CLI::Validator is_topic() {
  return {[](const std::string& text) {
            const bool is_name = text.find_first_not_of(
                                     "abcdefghijklmnopqrstuvwxyz"
                                     "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                     "0123456789_/") == std::string::npos &&
                                 !text.empty() && text.back() != '/' &&
                                 text.find("//") == std::string::npos;
            return is_name ? std::string()
                           : text + ": must be letters, digits and _, with / between names";
          },
          ""};
}

/// What both share.
struct CommonOptions {
  Network network{};
  std::string name_space = "palpate";
  bool is_reliable = false;
  CLI::Option* domain = nullptr;
  CLI::Option* interface = nullptr;
  CLI::Option* peer = nullptr;
  CLI::Option* rosbridge = nullptr;  // none: it is not offered

  void add_to(CLI::App& app, bool has_rosbridge = true) {
    domain = app.add_option("--domain", network.domain,
                            "domain of DDS, as ROS_DOMAIN_ID, which is not read (default: 0)")
                 ->type_name("N")
                 ->check(CLI::Range(0, 232));
    interface = app.add_option("--interface", network.interface,
                               "address or name of the interface for DDS (default: 127.0.0.1, this "
                               "machine only); another one needs --domain")
                    ->type_name("ADDRESS");
    peer = app.add_option("--peer", network.peers,
                          "address of a machine that multicast does not reach; may be repeated")
               ->type_name("ADDRESS")
               ->allow_extra_args(false);
    app.add_option("--namespace", name_space, "of the topics (default: palpate)")
        ->type_name("NAME")
        ->check(is_topic());
    app.add_flag("--reliable", is_reliable,
                 "offer reliable topics, for subscribers that ask for it (default: the QoS of "
                 "sensor data, best effort)");
    if (!has_rosbridge) return;
    rosbridge =
        app.add_option("--rosbridge", network.rosbridge,
                       "address of a rosbridge server, in place of DDS and its options, for "
                       "networks that DDS does not cross; [::1]:9090 of IPv6 (default port: "
                       "9090)")
            ->type_name("HOST[:PORT]");
  }
  /// After parsing. Throws SetupError.
  void check() const {
    if (name_space.starts_with('/')) {
      throw SetupError("--namespace = " + name_space + ": leave out the leading /");
    }
    if (rosbridge != nullptr && rosbridge->count() > 0) {
      if (network.rosbridge.empty()) throw SetupError("--rosbridge: must be HOST or HOST:PORT");
      if (domain->count() + interface->count() + peer->count() > 0 || is_reliable) {
        throw SetupError(
            "--rosbridge: leave out --domain, --interface, --peer and --reliable, which are for "
            "DDS");
      }
      return;
    }
    if (network.is_loopback() || domain->count() > 0) return;
    throw SetupError("--interface = " + network.interface +
                     ": everybody on that network may read the topics and, of a physics, send "
                     "forces: say which domain with --domain, which ROS_DOMAIN_ID names there");
  }
  [[nodiscard]] Offer offer() const { return is_reliable ? Offer::kReliable : Offer::kSensorData; }
};

int run_viewer(int argc, char** argv) {
  // markers of a scene, which is at most 16 MiB on the wire of hop 5, have each corner of a
  // triangle anew
  constexpr std::size_t kLargestMarker = std::size_t{256} << 20U;
  CommonOptions common;
  RosViewerOptions options;
  return run_node(
      argc, argv,
      {.name = "ros",
       .program = "palpate ros",
       .description =
           "Shows a running session or a replay to nodes of ROS 2, by DDS or a rosbridge server: "
           "measured_cp, "
           "measured_cv, measured_cf, servo_cf, measured_js, operating_state, energy, tf and "
           "markers. Receives nothing. `palpate ros physics --help`: forces from ROS 2; `palpate "
           "ros device --help`: an arm of ROS 2 as the device.",
       .add_options =
           [&](CLI::App& app) {
             common.add_to(app);
             app.add_flag("--every-tick", options.topics.has_every_tick,
                          "publish every tick, 30 or so at a time (default: the newest of each "
                          "batch, 30 to 60 a second)");
           }},
      [&](NodeContext& context) {
        common.check();
        options.network = common.network;
        options.network.largest_bytes = kLargestMarker;
        options.topics.name_space = common.name_space;
        options.topics.offer = common.offer();
        ProcessLinks links({.priority = 0, .cpu = -1},
                           tcp_rules(context.session.security, {KeyRole::kViewer}));
        run_ros_viewer(context, links, options);
      });
}

int run_physics(int argc, char** argv) {
  CommonOptions common;
  RosPhysicsOptions options;
  return run_node(
      argc, argv,
      {.name = "physics",
       .program = "palpate ros physics",
       .description = "A publisher of ROS 2 as the physics of a session, by DDS or a rosbridge "
                      "server: servo_cp goes out, "
                      "measured_cf, the force on the tool, comes in. For physics { command: "
                      "[\"palpate_ros\", \"physics\"] }.",
       .signals = "SIGUSR1 writes the last ticks to a file (the log names it).",
       .launched = physics::launched_session,
       .add_options =
           [&](CLI::App& app) {
             common.add_to(app);
             WrenchSettings& wrench = options.wrench;
             app.add_option("--force-topic", options.force_topic,
                            "topic of the force, in the namespace unless it begins with / "
                            "(default: measured_cf)")
                 ->type_name("NAME")
                 ->check(is_topic());
             app.add_option("--max-force", wrench.max_force_newton,
                            "a force above this is refused, in N (default: 100)")
                 ->type_name("N")
                 ->check(CLI::Range(0.001, 10000.0));
             app.add_option("--world-frame", wrench.world_frame,
                            "frame_id of the world (default: world)")
                 ->type_name("NAME");
             app.add_option("--tool-frame", wrench.tool_frame,
                            "frame_id of what turns with the tool, such as a sensor at its end "
                            "(default: tool)")
                 ->type_name("NAME");
             app.add_flag("--on-tissue", wrench.is_on_tissue,
                          "the publisher tells the force on the tissue, not on the tool");
           }},
      [&](NodeContext& context) {
        common.check();
        options.network = common.network;
        options.name_space = common.name_space;
        options.offer = common.offer();
        ProcessLinks links(context.session.side().realtime,
                           tcp_rules(context.session.security, {KeyRole::kPhysics}));
        run_ros_physics(context, links, options);
      });
}

int run_device(int argc, char** argv) {
  CommonOptions common;
  RosDeviceOptions options;
  std::string axes = "x y z";
  std::vector<double> center_m{0.0, 0.0, 0.0};
  double button_limit_ms = 500.0;
  common.name_space.clear();
  return run_node(
      argc, argv,
      {.name = "ros_device",
       .program = "palpate ros device",
       .description =
           "An arm behind topics of ROS 2 as the device of a session, by DDS: measured_cp, "
           "operating_state and buttons come in, servo_cf, the force on the hand, goes out. For "
           "device { plugin { library: \"palpate_ros_device.so\" } }.",
       .is_of_one_side = true,
       .add_options =
           [&](CLI::App& app) {
             common.add_to(app, false);
             app.add_option("--axes", axes,
                            "what x (right), y (away from the person) and z (up) are in the frame "
                            "of the poses, such as \"-y x z\" (default: x y z)")
                 ->type_name("AXES");
             app.add_option("--center", center_m,
                            "middle of the workspace in the frame of the poses, in m (default: 0 0 "
                            "0)")
                 ->type_name("X Y Z")
                 ->expected(3)
                 ->check(CLI::Range(-10.0, 10.0));
             app.add_option("--button-limit", button_limit_ms,
                            "a button that is not told for longer is released, in ms; 0: for "
                            "publishers that tell changes only (default: 500)")
                 ->type_name("MS")
                 ->check(CLI::Range(0.0, 10000.0));
             app.add_option("--base-frame", options.base_frame,
                            "frame_id of the poses (default: that of the first one)")
                 ->type_name("NAME");
           }},
      [&](NodeContext& context) {
        common.check();
        options.network = common.network;
        options.name_space = common.name_space;
        if (common.name_space.empty()) {
          throw SetupError(
              "--namespace is missing: that of the arm; `palpate ros` shows sessions under "
              "palpate/, with topics of the same names");
        }
        if (!std::isfinite(center_m[0] + center_m[1] + center_m[2])) {
          throw SetupError("--center: must be three numbers");
        }
        options.offer = common.is_reliable ? Offer::kCommand : Offer::kSensorData;
        if (button_limit_ms > 0.0) options.button_limit = from_seconds(1e-3 * button_limit_ms);
        options.axes = {.device_from_base = DeviceAxes::rotation_of(axes),
                        .center_m = Vector3(center_m[0], center_m[1], center_m[2])};
        run_ros_device(context, options);
      });
}

}  // namespace
}  // namespace palpate::ros

int main(int argc, char** argv) {
  if (argc > 1 && std::string_view(argv[1]) == "physics") {
    return palpate::ros::run_physics(argc - 1, argv + 1);
  }
  if (argc > 1 && std::string_view(argv[1]) == "device") {
    return palpate::ros::run_device(argc - 1, argv + 1);
  }
  return palpate::ros::run_viewer(argc, argv);
}
