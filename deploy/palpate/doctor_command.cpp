// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/link/security/keys.h"
#include "common/link/socket/endpoint.h"
#include "common/link/socket/link_socket.h"
#include "common/link/socket/zmq_context.h"
#include "common/process/endpoints.h"
#include "common/process/realtime.h"
#include "common/process/run_node.h"
#include "common/process/tcp_port.h"
#include "common/process/terminal.h"
#include "common/session/session_file.h"
#include "common/telemetry/device_telemetry.h"
#include "common/telemetry/quantile.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/devices/permission.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/session_warnings.h"
#include "device_node/device_node.h"
#include "device_node/drivers/driver_registry.h"
#include "device_node/identification/hands_off_check.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr double kMostTimerTicks = 500;
constexpr double kTimerSeconds = 1.0;  ///< at most: slow rates get fewer ticks
/// Largest acceptable lateness of a wake-up (99th percentile), as a share of the period.
constexpr double kLateRatio = 0.1;
constexpr Duration kDeviceLimit = std::chrono::seconds(3);  ///< until a device has opened

struct Finding {
  std::string what;      ///< "timer"
  std::string text;      ///< what was found
  std::string remedy{};  ///< what to do; empty: nothing
  bool is_note = false;  ///< to be known, and nothing can be done about it

  friend bool operator==(const Finding&, const Finding&) = default;
};

/// Appends what `examine` finds of each side, by with_only_side(): what is the same of all once,
/// the rest with the name of its side.
void examine_sides(
    const Session& session, std::vector<Finding>& findings,
    const std::function<void(const Session& of_one_side, std::vector<Finding>&)>& examine) {
  std::vector<std::vector<Finding>> found(session.sides.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    examine(with_only_side(session, session.sides[i].name), found[i]);
  }
  const auto is_of_all = [&](const Finding& one) {
    return std::all_of(found.begin(), found.end(), [&](const std::vector<Finding>& of_side) {
      return std::find(of_side.begin(), of_side.end(), one) != of_side.end();
    });
  };
  for (std::size_t i = 0; i < found.size(); ++i) {
    for (const Finding& one : found[i]) {
      const bool is_same = is_of_all(one);
      if (is_same && i > 0) continue;
      findings.push_back(one);
      if (!is_same) findings.back().what = session.sides[i].name + ": " + one.what;
    }
  }
}

Finding examine_realtime(const RealtimeConfig& realtime) {
  if (realtime.priority == 0) return {"real-time", "the session requests ordinary scheduling"};
  if (may_use_fifo(realtime.priority)) {
    return {"real-time", fmt::format("SCHED_FIFO {} is permitted", realtime.priority)};
  }
  return {"real-time", fmt::format("SCHED_FIFO {} is refused", realtime.priority),
          fmt::format("permit it: ulimit -r {0}, a line `@haptics - rtprio {0}` in "
                      "/etc/security/limits.d, or CAP_SYS_NICE",
                      realtime.priority)};
}

Finding examine_processors(std::size_t sides) {
  const std::string warning = too_many_ticks(sides);
  if (warning.empty()) return {"processors", "one or more for each side"};
  const std::size_t colon = warning.find(": ");
  return {"processors", warning.substr(0, colon), warning.substr(colon + 2)};
}

Finding examine_memory() {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  const rlimit unlimited{.rlim_cur = RLIM_INFINITY, .rlim_max = RLIM_INFINITY};
  if (limit.rlim_max == RLIM_INFINITY || setrlimit(RLIMIT_MEMLOCK, &unlimited) == 0) {
    return {"memory", "can be locked without limit"};
  }
  return {"memory", fmt::format("only {} KiB can be locked", limit.rlim_max >> 10U),
          "permit it: ulimit -l unlimited, or a line `@haptics - memlock unlimited` in "
          "/etc/security/limits.d"};
}

/// Measures wake-ups as the tick sleeps, with its priority where permitted.
Finding examine_timer(const RealtimeConfig& realtime, double rate_hz) {
  const Duration period = from_seconds(1.0 / rate_hz);
  const auto ticks =
      static_cast<std::size_t>(std::clamp(rate_hz * kTimerSeconds, 1.0, kMostTimerTicks));
  std::vector<Duration> lateness;
  lateness.reserve(ticks);
  std::thread([&] {
    static_cast<void>(enter_realtime(realtime));
    SteadyClock clock;
    TimePoint due = clock.now();
    while (lateness.size() < ticks) {
      due += period;
      clock.sleep_until(due);
      lateness.push_back(clock.now() - due);
      due = std::max(due, clock.now() - period);
    }
  }).join();
  munlockall();
  const Duration p99 = quantile(lateness, 0.99);
  const auto micro = [](Duration time) { return to_seconds(time) * 1e6; };
  Finding finding{"timer", fmt::format("{} wake-ups at {:g} Hz: 99 % within {:.0f} µs, all within "
                                       "{:.0f} µs",
                                       ticks, rate_hz, micro(p99), micro(quantile(lateness, 1.0)))};
  if (to_seconds(p99) * rate_hz > kLateRatio) {
    finding.remedy = fmt::format(
        "more than {:g} % of a period: stop other programs, permit real-time scheduling, or lower "
        "device.rate_hz",
        kLateRatio * 100);
  }
  return finding;
}

Finding examine_clock_source() {
  std::string source = "unknown";
  std::ifstream("/sys/devices/system/clocksource/clocksource0/current_clocksource") >> source;
  for (const char* slow : {"hpet", "acpi_pm", "pit", "jiffies", "refined-jiffies"}) {
    if (source == slow) {
      return {"clock", source + ": slow to read",
              "boot with clocksource=tsc if the machine has one"};
    }
  }
  return {"clock", source};
}

/// Binds each endpoint for an instant, in plain text; sends nothing.
void examine_links(const Session& session, std::vector<Finding>& findings) {
  for (const auto& [setting, endpoint] : endpoints_of(session, session.side())) {
    if (endpoint.starts_with("inproc://")) continue;
    Finding finding{setting, endpoint};
    try {
      ZmqContext context(RealtimeConfig{.priority = 0, .cpu = -1}, {.may_be_plain = true});
      const LinkSocket socket(context, kOneWayReceiver, bind_to(endpoint, setting));
      finding.text += " is free";
    } catch (const SetupError& error) {
      const std::string why = error.what();
      if (why.find("does not have that address") != std::string::npos) {
        finding.text += " belongs to another machine";
      } else {
        finding.remedy = why.substr(why.find(": ") + 2);
      }
    }
    findings.push_back(finding);
  }
}

/// The page moves to another port, where a bookmark or a tunnel does not find it.
Finding examine_page(const WebConfig& web) {
  if (!web.is_on) return {"page", "the session has none"};
  if (web.port == 0) return {"page", "any free port"};
  const std::string address = "127.0.0.1:" + std::to_string(web.port);
  if (is_port_free(web.port)) return {"page", address + " is free"};
  return {"page", address + " is in use",
          "end the program there (ss -ltnp), or choose another port: --set viewer.web.port=8766"};
}

void examine_keys(const Session& session, std::vector<Finding>& findings) {
  const fs::path folder = session.security.key_folder;
  if (folder.empty()) {
    for (const auto& [setting, endpoint] : endpoints_of(session, session.side())) {
      if (!endpoint.starts_with("tcp://") || is_on_loopback(bind_to(endpoint, setting))) continue;
      findings.push_back(
          {"keys", endpoint + " leaves this machine without keys",
           "palpate keygen DIR, and security { key_folder: \"DIR\" } in the session"});
      return;
    }
    findings.push_back({"keys", "none needed: no link leaves this machine"});
    return;
  }
  std::string here;
  try {
    static_cast<void>(load_link_keys(folder, {}));
    for (const KeyRole role : kAllKeyRoles) {
      const LinkKeys keys = load_link_keys(folder, {}, std::array{role});
      if (keys.of(role)) here += std::string(here.empty() ? "" : ", ") + name_of(role);
    }
  } catch (const SetupError& error) {
    findings.push_back({"keys", "cannot be used", error.what()});
    return;
  }
  if (here.empty()) {
    findings.push_back({"keys", folder.string() + " has no secret key",
                        "copy into it ROLE.key_secret of each role that runs here"});
    return;
  }
  findings.push_back({"keys", "this machine has the roles " + here});
}

std::string in_micrometres(double metres) { return fmt::format("{:.0f} µm", 1e6 * metres); }

Finding examine_encoder(const device::HapticDevice& device, const DeviceProfile& profile) {
  const double step_m = device.specification().position_resolution_m;
  Finding finding{"encoder", fmt::format("steps of {}, the profile says {}", in_micrometres(step_m),
                                         in_micrometres(profile.position_resolution_m))};
  if (step_m > profile.position_resolution_m) {
    finding.remedy = "give the larger one in device.profile.position_resolution_m";
  }
  return finding;
}

/// Moved on virtual time.
void examine_simulated_device(const Side& side, std::vector<Finding>& findings) {
  ManualClock clock;
  const auto device =
      device::all_drivers({.simulated = {.device = side.simulated, .hand = device::nobody()}})
          .at(device::kSimulatedDriver)
          .open(clock, {});
  findings.push_back(examine_encoder(*device, side.device.profile));

  const device::CheckedProfile checked =
      device::check_hands_off(*device, clock, side.device.profile);
  Finding friction{"friction", "the device has what the profile claims"};
  if (checked.is_lowered) {
    friction.text = fmt::format("the device has {:.0f} % of what the profile claims at 0.05 m/s",
                                100.0 * checked.ratio);
    friction.remedy =
        "palpate identify SESSION --output FILE, and device { profile_file: \"FILE\" }";
  }
  findings.push_back(friction);
}

/// Opened for a moment, motors limp; it is not moved.
void examine_real_device(const Side& side, std::vector<Finding>& findings) {
  const std::string driver = device::driver_name(side.driver);
  if (const auto* hapi = std::get_if<HapiConfig>(&side.driver)) {
    const std::string remedy = permission_remedy(hapi->port);
    if (!remedy.empty()) {
      findings.push_back({"device", hapi->port + " may not be opened by this user", remedy});
      return;
    }
  }
  if (const auto* plugin = std::get_if<PluginConfig>(&side.driver)) {
    // to open it would run what the session names
    std::error_code error;
    const bool is_file = plugin->library.find('/') != std::string::npos;
    if (is_file && !fs::is_regular_file(plugin->library, error)) {
      findings.push_back({"device", plugin->library + ": no such library",
                          "give its path, relative to the folder of the session, or absolute"});
      return;
    }
    findings.push_back({.what = "device",
                        .text = "library " + plugin->library +
                                " is not loaded here; `palpate conform device` loads and checks it",
                        .is_note = true});
    return;
  }
  const SteadyClock clock;
  std::vector<std::string> prompts;
  device::DriverOptions options;
  options.driver = side.driver;
  const device::DriverRegistry drivers = device::all_drivers(options);
  std::unique_ptr<device::HapticDevice> device;
  try {
    device = drivers.at(driver).open(
        clock, {.prompt = [&](const std::string& text) { prompts.push_back(text); },
                .limit = kDeviceLimit});
  } catch (const SetupError& error) {
    findings.push_back({"device", driver + " does not open", error.what()});
    return;
  }
  const device::DeviceSpecification& specification = device->specification();
  findings.push_back({"device", specification.model_name + " opens"});
  for (const std::string& prompt : prompts) findings.push_back({"device", "asks for help", prompt});
  if (device->phase() != DevicePhase::kCalibrated) {
    findings.push_back({.what = "calibration",
                        .text = "none yet: " + specification.calibration + ", as device_node asks",
                        .is_note = true});
  }
  findings.push_back(
      {.what = "acknowledgement",
       .text = std::string("no force before a person acknowledges each start and "
                           "each fault: SIGUSR2 to device_node") +
               (side.device.dead_man_button
                    ? ", or a press of button " + std::to_string(*side.device.dead_man_button) +
                          ", device.dead_man_button"
                    : ""),
       .is_note = true});
  try {
    device::refuse_missing_button(side.device, specification);
    device::refuse_unlikely_friction(side.device, specification);
    device::refuse_finer_resolution(side.device, specification);
    device::refuse_unmonitored(side.device, specification, false);
    if (side.device.has_hands_off_check) device::refuse_hands_off_check(specification);
  } catch (const SetupError& error) {
    findings.push_back({"device", "does not fit the session", error.what()});
  }
  if (specification.has_motor_watchdog) {
    findings.push_back({"motor watchdog", "ends a force by itself"});
  } else {
    findings.push_back({.what = "motor watchdog",
                        .text = no_watchdog_text(side.device.accepts_no_motor_watchdog),
                        .is_note = true});
  }
  if (const auto limit = device::friction_limit(side.device, specification, driver)) {
    findings.push_back({.what = "force limit",
                        .text = fmt::format("{:.3g} N: {}", limit->newton, limit->why),
                        .remedy = limit->remedy,
                        .is_note = limit->remedy.empty()});
  }
  findings.push_back(examine_encoder(*device, side.device.profile));
  findings.push_back(
      {.what = "friction",
       .text = "not examined: palpate identify SESSION --output FILE moves the device for it",
       .is_note = true});
}

/// Once for sides whose ticks are alike, with the name of the first of them if others are not.
void examine_timers(const Session& session, std::vector<Finding>& findings) {
  std::map<std::tuple<int, int, double>, const Side*> kinds;
  for (const Side& side : session.sides) {
    kinds.try_emplace({side.realtime.priority, side.realtime.cpu, side.device.rate_hz}, &side);
  }
  for (const auto& [kind, side] : kinds) {
    findings.push_back(examine_timer(side->realtime, side->device.rate_hz));
    if (kinds.size() > 1) findings.back().what = side->name + ": timer";
  }
}

/// What the guarantee assumes (docs/theory.md §1), as far as it can be examined without a hand.
void examine_assumptions(const Session& session, std::vector<Finding>& findings) {
  const Side& side = session.side();
  findings.push_back(side.device.monitor.is_on
                         ? Finding{"monitor", "on: checks every command on the device's side"}
                         : Finding{"monitor", "off: nothing checks what the clamp commands",
                                   "leave device.monitor out, unless the session shows an "
                                   "unprotected controller"});
  if (is_real(side.driver)) {
    examine_real_device(side, findings);
  } else {
    examine_simulated_device(side, findings);
  }

  // a session without v_max has nothing to exceed
  const double v_max = side.device.monitor.v_max_m_per_s;
  if (!std::isfinite(v_max)) return;
  const auto* hostile = std::get_if<HostilePath>(&side.hand.path);
  Finding speed{"hand speed", fmt::format("up to {:g} m/s is assumed; more is counted and logged "
                                          "(event=hand_faster_than_assumed)",
                                          v_max)};
  if (hostile != nullptr && hostile->v_max_m_per_s > v_max) {
    speed.remedy = fmt::format(
        "the session's hand reaches {:g} m/s: raise "
        "mofc.guard_settings.v_max_m_per_s",
        hostile->v_max_m_per_s);
  }
  findings.push_back(speed);
}

/// With a session also the links, keys and devices of its sides, as far as they concern this
/// machine. Takes about a second for each processor of a tick.
std::vector<Finding> examine_machine(const std::optional<Session>& session) {
  const Session& examined = session ? *session : Session();
  std::vector<Finding> findings;
  examine_sides(examined, findings, [](const Session& of_side, std::vector<Finding>& found) {
    found.push_back(examine_realtime(of_side.side().realtime));
  });
  findings.push_back(examine_processors(examined.sides.size()));
  findings.push_back(examine_memory());
  examine_timers(examined, findings);
  findings.push_back(examine_clock_source());
  if (session) {
    examine_sides(*session, findings, examine_links);
    findings.push_back(examine_page(session->viewer.web));
    examine_sides(*session, findings, examine_keys);
    examine_sides(*session, findings, examine_assumptions);
    for (const std::string& warning : session_warnings(*session)) {
      findings.push_back({.what = "session", .text = warning, .is_note = true});
    }
  }
  return findings;
}

/// Prints one line per finding.
/// @return exit status
int run_doctor(const SessionOptions& options) {
  std::optional<Session> session;
  if (!options.file.empty()) session = options.load();
  int status = 0;
  for (const Finding& finding : examine_machine(session)) {
    const bool is_well = finding.remedy.empty();
    if (!is_well) status = kExitFailure;
    const std::string mark = finding.is_note ? "note "
                             : is_well       ? coloured("ok   ", Colour::kGood)
                                             : coloured("TO DO", Colour::kBad);
    const std::string line = fmt::format("{}  {:<24} {}{}{}\n", mark, finding.what, finding.text,
                                         is_well ? "" : ": ", finding.remedy);
    std::fputs(line.c_str(), stdout);
  }
  return status;
}

}  // namespace

Command add_doctor_command(CLI::App& app) {
  CLI::App& command = *app.add_subcommand("doctor",
                                          "check this machine, and its part in a session; exit "
                                          "status 0 if fit, 1 if there is something "
                                          "to do");
  auto options = std::make_shared<SessionOptions>();
  options->add_to(command);
  command.get_option("SESSION")->required(false)->description(
      "session file: check its rate, links, ports, keys and assumptions too");
  return {&command, [options](const Verbosity&) { return run_doctor(*options); }};
}

}  // namespace palpate
