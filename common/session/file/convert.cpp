// SPDX-License-Identifier: Apache-2.0
#include "common/session/file/convert.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace palpate {

namespace {

constexpr std::uint32_t kSchemaVersion = 1;
constexpr std::size_t kMaxNameBytes = 64;
constexpr std::size_t kMaxSideNameBytes = 16;
constexpr std::size_t kMaxSides = 64;

ViewerConfig to_viewer(const Fields& viewer) {
  const Fields web = viewer.message("web");
  return {.status_interval = viewer.milliseconds("status_interval_ms"),
          .web = {.is_on = !web.flag("disabled"),
                  .port = static_cast<std::uint16_t>(web.integer("port"))},
          .has_control = viewer.flag("control")};
}

/// "" with a problem if the name cannot be part of a file name; `max_bytes` ≥ 1.
std::string to_name(const Fields& fields, std::size_t max_bytes) {
  std::string name = fields.text("name");
  if (name.empty()) {
    fields.problem("name", "required; give letters, digits, '_' and '-'");
    return name;
  }
  const bool is_plain = std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-';
  });
  if (is_plain && name.size() <= max_bytes) return name;
  fields.problem("name", "must be 1 … " + std::to_string(max_bytes) +
                             " letters, digits, '_' and '-'; it names files");
  return "";
}

/// @param fields  of the session   @param session  with its scene and its physics
TaskConfig to_shared_task(const Fields& fields, const Session& session) {
  const Fields task = fields.message("task");
  if (!fields.messages("side").empty()) {
    fields.problem("task", "is for one device; leave it out of a session with sides");
  }
  const std::string kind = task.given_member("kind");
  if (!session.physics_command.empty() && !kind.empty() && kind != "free") {
    task.problem(kind.c_str(),
                 "needs physics_node, whose tissue is known; leave it out with physics.command");
  }
  TaskConfig config = to_task(task, session.scene);
  if (session.scene.gripper && config.mark_button == session.scene.gripper->button) {
    task.problem("mark_button",
                 "must be another button than scene.tool.gripper.button, or each closing of the "
                 "jaws is a mark");
  }
  if (session.scene.electrode && config.mark_button == session.scene.electrode->button) {
    task.problem("mark_button",
                 "must be another button than scene.tool.electrode.button, or each use of the "
                 "electrode is a mark");
  }
  return config;
}

/// The jaws and the electrode have buttons of their own.
void check_buttons(const SceneConfig& scene, const DeviceConfig& device, const Fields& fields) {
  const auto check = [&](std::uint32_t button, const std::string& owner, const char* clutched,
                         const char* released) {
    const std::string rule = "must be another button than scene.tool." + owner + ".button, or ";
    if (device.workspace.clutch_button == button) {
      fields.message("workspace").problem("clutch_button", rule + clutched);
    }
    if (device.dead_man_button == button) fields.problem("dead_man_button", rule + released);
  };
  if (scene.gripper) {
    check(scene.gripper->button, "gripper", "no held tissue is felt",
          "no force acts while the jaws are open");
  }
  if (scene.electrode) {
    check(scene.electrode->button, "electrode", "nothing is felt while it ablates",
          "no force acts while it is off");
  }
}

/// What all sides share.
Session to_shared(const SessionText& text, const std::filesystem::path& base_dir,
                  Problems& problems) {
  const Fields fields(text, problems);
  const v1::Session& written = text.message();
  Session session;
  session.name = to_name(fields, kMaxNameBytes);
  if (written.has_schema_version() && written.schema_version() != kSchemaVersion) {
    fields.problem("schema_version",
                   "this program reads version 1 only; use the program the session was written for,"
                   " or write the session anew");
  }
  session.duration_s = fields.number("duration_s");
  session.seed = written.has_seed() ? written.seed()
                                    : static_cast<std::uint64_t>(fields.default_number("seed"));
  session.faults = to_faults(fields.message("faults"));
  session.adversary = to_adversary(fields.message("adversary"));
  if (fields.has("security")) session.security = to_security(fields.message("security"), base_dir);
  session.physics = to_physics(fields.message("physics"));
  session.physics_command = to_physics_command(fields.message("physics"), base_dir);
  session.viewer = to_viewer(fields.message("viewer"));
  if (session.physics.standby && !session.physics_command.empty()) {
    fields.message("physics").problem("standby", "needs physics_node; leave it out with command");
  }
  session.scene = to_scene(fields.message("scene"), base_dir);
  if (session.scene.electrode && session.physics.standby) {
    fields.message("physics").problem(
        "standby",
        "does not know what the first physics_node has ablated; leave it out, or "
        "scene.tool.electrode");
  }
  if (session.scene.blade && session.physics.standby) {
    fields.message("physics").problem(
        "standby",
        "does not know what the first physics_node has cut; leave it out, or scene.tool.blade");
  }
  if (session.physics.standby &&
      std::any_of(session.scene.tissues.begin(), session.scene.tissues.end(), can_tear)) {
    fields.message("physics").problem(
        "standby",
        "does not know what the first physics_node has torn off; leave it out, or "
        "attached.toughness_joule_per_m2");
  }
  if (fields.has("task")) session.task = to_shared_task(fields, session);
  session.sides.clear();
  return session;
}

/// Adds the side that `text` describes.
/// @param name  "" if the session has one device
void add_side(const SessionText& text, const std::string& name,
              const std::filesystem::path& base_dir, Endpoints& endpoints, Problems& problems,
              Session& session) {
  const Fields fields(text, problems);
  Side side;
  side.name = name;
  const Fields links = fields.message("links");
  // an unusable session name is reported once, not again in the default endpoints
  const LinkRules link_rules(links, session.name.empty() ? "session" : session.name, endpoints);
  const bool has_standby = session.physics.standby.has_value();
  side.links = link_rules.of_side(name, has_standby);
  session.physics_telemetry = link_rules.shared("physics_telemetry");
  if (has_standby) session.standby_telemetry = link_rules.shared("standby_telemetry");
  session.tissue_change = link_rules.on_this_machine("tissue_change");
  side.realtime = to_realtime(fields.message("realtime"), session.sides.size());
  side.hand = to_hand(fields.message("hand"), base_dir, problems);

  // the wait depends on both rates, the deadline of the device depends on the wait
  const Fields device = fields.message("device");
  const Fields mofc = fields.message("mofc");
  const double rate_hz = device.number("rate_hz");
  const double wait_ms = to_wait_for_physics_ms(mofc, rate_hz, session.physics.rate_hz);
  if (!name.empty() && wait_ms > 0.0) {
    mofc.problem("wait_for_physics_ms", "needs a session without sides; give 0 never to wait");
  }
  if (session.physics.interaction_deadband) {
    refuse_if_waiting(fields.message("physics"), "interaction_deadband", wait_ms);
  }
  side.driver = to_driver(device, base_dir);
  side.simulated = simulated_as(side.driver, to_simulated_device(device.message("simulated")));
  side.device = to_device(device, rate_hz, wait_ms,
                          {.peak_force_newton = side.simulated.peak_force_newton,
                           .position_resolution_m = declared_step_m(side.driver)},
                          base_dir, problems);
  if (is_real(side.driver)) {
    side.simulated = with_friction_of(side.device.profile, side.simulated);
  }
  check_buttons(session.scene, side.device, device);
  side.mofc = to_mofc(mofc, wait_ms, session.physics, side.device);
  add_wrist(device, fields.message("hand"), mofc, side);
  if (is_real(side.driver) && side.mofc.controller != ControllerKind::kMofc &&
      !side.mofc.has_safety_net && !side.mofc.accepts_rival) {
    mofc.problem("controller",
                 "nothing but device.monitor would keep the hand from drawing energy, and the "
                 "device is a real one; give safety_net: true, or accept: RIVAL_CONTROLLER");
  }
  // the monitor assumes of the hand what the controller does
  side.device.monitor.v_max_m_per_s = side.mofc.mode == MofcMode::kVector
                                          ? std::numeric_limits<double>::infinity()
                                          : side.mofc.guard.v_max_m_per_s;
  session.sides.push_back(std::move(side));
}

/// Changes of tissues reach one physics_node only. @param viewer  of the session
void check_control(const Session& session, const Fields& viewer) {
  if (!may_change_tissue(session)) return;
  if (!session.physics_command.empty()) {
    viewer.problem("control", "needs physics_node; leave it out with physics.command");
  }
  if (session.physics.standby) {
    viewer.problem("control", "reaches one physics_node only; leave it out with physics.standby");
  }
}

std::vector<std::string> to_side_names(const std::vector<Fields>& sides) {
  if (sides.size() == 1 || sides.size() > kMaxSides) {
    sides.back().problem("must be 2 … " + std::to_string(kMaxSides) +
                         " sides; for one device leave side out");
  }
  std::vector<std::string> names;
  for (const Fields& side : sides) {
    std::string name = to_name(side, kMaxSideNameBytes);
    if (!name.empty() && std::find(names.begin(), names.end(), name) != names.end()) {
      side.problem("name", "another side has this name too; give each its own name");
      name.clear();
    }
    // an unusable name is reported once, not again in the default endpoints
    names.push_back(name.empty() ? "side." + std::to_string(names.size()) : name);
  }
  return names;
}

}  // namespace

Session to_session(const SessionText& text, const std::filesystem::path& base_dir,
                   Problems& problems) {
  Session session = to_shared(text, base_dir, problems);
  Endpoints endpoints;
  const Fields fields(text, problems);
  const std::vector<Fields> sides = fields.messages("side");
  if (sides.empty()) {
    add_side(text, "", base_dir, endpoints, problems, session);
    check_control(session, fields.message("viewer"));
    return session;
  }
  int index = 0;
  for (const std::string& name : to_side_names(sides)) {
    add_side(text.for_side(index++), name, base_dir, endpoints, problems, session);
  }
  check_control(session, fields.message("viewer"));
  return session;
}

}  // namespace palpate
