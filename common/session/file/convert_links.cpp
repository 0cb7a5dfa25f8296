// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstdint>

#include "common/session/file/convert.h"
#include "common/session/session_file.h"
#include "palpate/v1/session.pb.h"

namespace palpate {

namespace {

constexpr std::size_t kMaxIpcPathBytes = 107;     // sockaddr_un::sun_path without its zero
constexpr std::size_t kMaxInprocNameBytes = 246;  // libzmq: 255 with "inproc://"

bool has_spaces_or_control_characters(const std::string& text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) <= 0x20 || c == 0x7f; });
}

/// What is wrong with an endpoint; empty if nothing.
std::string endpoint_complaint(const std::string& endpoint) {
  const auto after = [&](const char* scheme) {
    return endpoint.substr(std::char_traits<char>::length(scheme));
  };
  if (has_spaces_or_control_characters(endpoint)) {
    return "must not contain spaces or control characters";
  }
  if (endpoint.starts_with("ipc://")) {
    const std::string path = after("ipc://");
    if (path.empty() || path == "*") return "must name a file: ipc:///run/user/1000/palpate/x.ipc";
    if (path.size() > kMaxIpcPathBytes) {
      return "its path has " + std::to_string(path.size()) + " bytes, the system takes " +
             std::to_string(kMaxIpcPathBytes) + "; give a shorter one, or set PALPATE_RUN_DIR";
    }
    return {};
  }
  if (endpoint.starts_with("inproc://")) {
    const std::string name = after("inproc://");
    if (name.empty() || name.size() > kMaxInprocNameBytes) {
      return "must have a name of 1 … " + std::to_string(kMaxInprocNameBytes) + " bytes";
    }
    return {};
  }
  if (endpoint.starts_with("tcp://")) {
    const std::string address = after("tcp://");
    const std::size_t colon = address.rfind(':');
    const std::string host = address.substr(0, colon);
    if (colon == std::string::npos || host.empty() || host == "*") {
      return "must name host and port for both ends: tcp://192.168.1.5:5551";
    }
    int port = 0;
    const char* const last = address.data() + address.size();
    const auto [stop, error] = std::from_chars(address.data() + colon + 1, last, port);
    if (error != std::errc() || stop != last || port < 1 || port > 65535) {
      return "must end with a port of 1 … 65535: tcp://192.168.1.5:5551";
    }
    return {};
  }
  return "must be ipc://PATH, tcp://HOST:PORT or inproc://NAME";
}

void add_windows(const Fields& link, const char* name, FaultWindow::Kind kind,
                 std::vector<FaultWindow>& windows) {
  for (const Fields& fields : link.messages(name)) {
    const double from_s = fields.number("from_s");
    const double until_s = to_until_s(fields, from_s);
    const double every_s = fields.number("every_s");
    if (every_s > 0.0 && every_s < until_s) {
      fields.problem("every_s", "must be ≥ until_s, " + shown(until_s) + ", or 0 for once");
    }
    windows.push_back({.kind = kind,
                       .from = to_duration(from_s),
                       .until = to_duration(until_s),
                       .every = to_duration(every_s)});
  }
}

LinkFaults to_link_faults(const Fields& fields) {
  LinkFaults faults;
  faults.delay = fields.milliseconds("delay_ms");
  faults.jitter = fields.milliseconds("jitter_ms");
  faults.loss_ratio = fields.number("loss_ratio");
  faults.burst_ratio = fields.number("burst_ratio");
  faults.burst_length = static_cast<std::uint32_t>(fields.integer("burst_length"));
  faults.duplicate_ratio = fields.number("duplicate_ratio");
  faults.reorder_ratio = fields.number("reorder_ratio");
  faults.reorder_delay = fields.milliseconds("reorder_delay_ms");
  if (faults.reorder_ratio > 0.0 && faults.reorder_delay <= Duration::zero()) {
    fields.problem("reorder_ratio", "needs reorder_delay_ms > 0; give the delay of these messages");
  }
  faults.jitter_reorders = fields.flag("jitter_reorders");
  add_windows(fields, "outage", FaultWindow::Kind::kOutage, faults.windows);
  add_windows(fields, "stall", FaultWindow::Kind::kStall, faults.windows);
  add_windows(fields, "freeze", FaultWindow::Kind::kFreeze, faults.windows);
  return faults;
}

}  // namespace

// --- links ------------------------------------------------------------------------------------

LinkRules::LinkRules(const Fields& links, const std::string& session_name, Endpoints& owner_of)
    : links_(links), folder_(run_folder(session_name)), owner_of_(owner_of) {}

LinksConfig LinkRules::of_side(const std::string& side, bool has_standby) const {
  const auto of_standby = [&](const char* name) {
    return has_standby ? own_endpoint(name, side) : std::string();
  };
  return {.exchange = own_endpoint("exchange", side),
          .tool_motion = own_endpoint("tool_motion", side),
          .interaction = own_endpoint("interaction", side),
          .device_telemetry = own_endpoint("device_telemetry", side),
          .mofc_telemetry = own_endpoint("mofc_telemetry", side),
          .hand_target = own_endpoint("hand_target", side),
          .acknowledgement = on_this_machine(with_side(side, "acknowledgement")),
          .standby_tool_motion = of_standby("standby_tool_motion"),
          .standby_interaction = of_standby("standby_interaction")};
}

std::string LinkRules::own_endpoint(const char* name, const std::string& side) const {
  const Endpoint endpoint = read(name, with_side(side, name));
  const std::string path = links_.written_path(name);
  std::string complaint = endpoint_complaint(endpoint.text);
  const auto [other, is_new] = owner_of_.emplace(endpoint.text, path);
  if (complaint.empty() && !is_new) {
    complaint = other->second == path
                    ? "is that of another side too; give each side its own"
                    : "is that of " + other->second + " too; give each link its own";
  }
  if (!complaint.empty()) links_.problem(name, endpoint.shown_default + complaint);
  return endpoint.text;
}

std::string LinkRules::shared(const char* name) const {
  const Endpoint endpoint = read(name, name);
  const std::string path = links_.path(name);
  std::string complaint = endpoint_complaint(endpoint.text);
  const auto [other, is_new] = owner_of_.emplace(endpoint.text, path);
  if (links_.has(name) && links_.written_path(name) != path) {
    complaint = "is one for all sides; give it in links { … } of the session";
  } else if (complaint.empty() && !is_new && other->second != path) {
    complaint = "is that of " + other->second + " too; give each link its own";
  }
  if (!complaint.empty()) links_.problem(name, endpoint.shown_default + complaint);
  return endpoint.text;
}

std::string LinkRules::on_this_machine(const std::string& name) const {
  return "ipc://" + (folder_ / (name + ".ipc")).string();
}

LinkRules::Endpoint LinkRules::read(const char* name, const std::string& default_file) const {
  std::string text = links_.text(name);
  if (!text.empty()) return {std::move(text), ""};
  text = on_this_machine(default_file);
  return {text, one_line(text) + ": "};
}

// --- real time, security, faults, adversary ---------------------------------------------------

RealtimeConfig to_realtime(const Fields& realtime, std::size_t place) {
  RealtimeConfig config;
  config.priority = static_cast<int>(realtime.integer("priority"));
  // tick threads of many sides that poll on one processor would leave each other no time
  const auto processors = static_cast<std::size_t>(std::max(1L, ::sysconf(_SC_NPROCESSORS_ONLN)));
  config.cpu =
      static_cast<int>(realtime.has("cpu") ? realtime.integer("cpu")
                                           : static_cast<std::int64_t>(place % processors));
  const int wait = realtime.enumerator("wait");
  if (wait == v1::Realtime::spin) config.wait = WaitStrategy::kSpin;
  if (wait == v1::Realtime::block) config.wait = WaitStrategy::kBlock;
  return config;
}

SecurityConfig to_security(const Fields& security, const std::filesystem::path& base_dir) {
  if (!security.has_required("key_folder")) return {};
  return {.key_folder = security.file("key_folder", base_dir).string()};
}

DeviceFaults to_device_faults(const Fields& fields) {
  DeviceFaults faults;
  add_windows(fields, "skip", FaultWindow::Kind::kOutage, faults.skips);
  faults.late_ratio = fields.number("late_ratio");
  faults.late_periods = fields.number("late_periods");
  faults.late_switch_ratio = fields.number("late_switch_ratio");
  faults.late_switch = fields.microseconds("late_switch_us");
  return faults;
}

FaultsConfig to_faults(const Fields& faults) {
  return {.device_state = to_link_faults(faults.message("device_state")),
          .force_command = to_link_faults(faults.message("force_command")),
          .tool_motion = to_link_faults(faults.message("tool_motion")),
          .interaction = to_link_faults(faults.message("interaction")),
          .standby_tool_motion = to_link_faults(faults.message("standby_tool_motion")),
          .standby_interaction = to_link_faults(faults.message("standby_interaction")),
          .device = to_device_faults(faults.message("device"))};
}

AdversaryConfig to_adversary(const Fields& adversary) {
  // an enumerator left out, 0, stands for the honest law, 1
  const auto law_of = [&](const char* name) {
    return static_cast<std::uint8_t>(std::max(adversary.enumerator(name), 1) - 1);
  };
  return {.physics = static_cast<HostilePhysics>(law_of("physics")),
          .clamp = static_cast<LyingClamp>(law_of("clamp")),
          .tick_jitter_ratio = adversary.number("tick_jitter_ratio"),
          .late_tick_ratio = adversary.number("late_tick_ratio")};
}

}  // namespace palpate
