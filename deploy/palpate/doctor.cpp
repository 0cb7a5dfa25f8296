#include "deploy/palpate/doctor.h"

#include <spdlog/fmt/fmt.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <thread>
#include <utility>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/link/socket/endpoint.h"
#include "common/link/security/keys.h"
#include "common/link/socket/link_socket.h"
#include "common/link/socket/zmq_context.h"
#include "common/process/realtime.h"
#include "common/session/session_file.h"
#include "common/telemetry/quantile.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;

constexpr int kTimerTicks = 500;
/// Of the period: what the 99th percentile of the wake-ups may take from a tick.
constexpr double kLateRatio = 0.1;

Finding examine_realtime(const RealtimeConfig& realtime) {
  if (realtime.priority == 0) return {"real-time", "the session asks for ordinary scheduling"};
  if (may_use_fifo(realtime.priority)) {
    return {"real-time", fmt::format("SCHED_FIFO {} is permitted", realtime.priority)};
  }
  return {"real-time", fmt::format("SCHED_FIFO {} is refused", realtime.priority),
          fmt::format("permit it: ulimit -r {0}, a line `@haptics - rtprio {0}` in "
                      "/etc/security/limits.d, or CAP_SYS_NICE",
                      realtime.priority)};
}

Finding examine_memory() {
  rlimit limit{};
  getrlimit(RLIMIT_MEMLOCK, &limit);
  const rlimit unlimited{.rlim_cur = RLIM_INFINITY, .rlim_max = RLIM_INFINITY};
  if (limit.rlim_max == RLIM_INFINITY || setrlimit(RLIMIT_MEMLOCK, &unlimited) == 0) {
    return {"memory", "may be locked without a limit"};
  }
  return {"memory", fmt::format("only {} KiB may be locked", limit.rlim_max >> 10U),
          "permit it: ulimit -l unlimited, or a line `@haptics - memlock unlimited` in "
          "/etc/security/limits.d"};
}

/// Sleeps as the tick does, with its priority where permitted.
Finding examine_timer(const RealtimeConfig& realtime, double rate_hz) {
  const Duration period = from_seconds(1.0 / rate_hz);
  std::vector<Duration> lateness;
  lateness.reserve(kTimerTicks);
  std::thread([&] {
    static_cast<void>(enter_realtime(realtime));
    SteadyClock clock;
    TimePoint due = clock.now();
    for (int i = 0; i < kTimerTicks; ++i) {
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
                                       kTimerTicks, rate_hz, micro(p99), micro(quantile(lateness, 1.0)))};
  if (to_seconds(p99) * rate_hz > kLateRatio) {
    finding.remedy = fmt::format(
        "more than {:g} % of a period: stop other load, permit real-time scheduling, or lower "
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
              "boot with clocksource=tsc if the machine has it"};
    }
  }
  return {"clock", source};
}

/// The bound end of every link is tried as the session has it.
void examine_links(const Session& session, std::vector<Finding>& findings) {
  const LinksConfig& links = session.side().links;
  for (const auto& [setting, endpoint] :
       {std::pair<const char*, const std::string&>{"links.exchange", links.exchange},
        {"links.tool_motion", links.tool_motion},
        {"links.interaction", links.interaction},
        {"links.device_telemetry", links.device_telemetry},
        {"links.mofc_telemetry", links.mofc_telemetry},
        {"links.physics_telemetry", session.physics_telemetry},
        {"links.hand_target", links.hand_target}}) {
    if (endpoint.starts_with("inproc://")) continue;
    Finding finding{setting, endpoint};
    try {
      // plain, for an instant, and nothing is sent
      ZmqContext context(RealtimeConfig{.priority = 0, .cpu = -1}, {.may_be_plain = true});
      const LinkSocket socket(context, {.type = zmq::socket_type::sub},
                              {bind_to(endpoint, setting)});
      finding.text += " is free";
    } catch (const SetupError& error) {
      const std::string why = error.what();
      if (why.find("does not have that address") != std::string::npos) {
        finding.text += " is another machine's";
      } else {
        finding.remedy = why.substr(why.find(": ") + 2);
      }
    }
    findings.push_back(finding);
  }
}

void examine_keys(const Session& session, std::vector<Finding>& findings) {
  const fs::path folder = session.security.key_folder;
  if (folder.empty()) {
    const LinksConfig& links = session.side().links;
    for (const std::string& endpoint :
         {links.exchange, links.tool_motion, links.interaction, links.device_telemetry,
          links.mofc_telemetry, session.physics_telemetry, links.hand_target}) {
      if (!endpoint.starts_with("tcp://") || is_on_loopback(bind_to(endpoint, ""))) continue;
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
    for (const KeyRole role :
         {KeyRole::kDevice, KeyRole::kPhysics, KeyRole::kViewer, KeyRole::kPointer}) {
      const LinkKeys keys = load_link_keys(folder, {}, std::array{role});
      if (keys.of(role)) here += std::string(here.empty() ? "" : ", ") + name_of(role);
    }
  } catch (const SetupError& error) {
    findings.push_back({"keys", "not as they should be", error.what()});
    return;
  }
  if (here.empty()) {
    findings.push_back({"keys", folder.string() + " has no secret key",
                        "copy ROLE.key_secret of what shall run here into it"});
    return;
  }
  findings.push_back({"keys", "this machine may be: " + here});
}

}  // namespace

std::vector<Finding> examine_machine(const std::optional<Session>& session) {
  const Session& asked = session ? *session : Session();
  std::vector<Finding> findings{examine_realtime(asked.side().realtime), examine_memory(),
                                examine_timer(asked.side().realtime, asked.side().device.rate_hz),
                                examine_clock_source()};
  if (session) {
    examine_links(*session, findings);
    examine_keys(*session, findings);
  }
  return findings;
}

std::string findings_text(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& finding : findings) {
    const bool is_well = finding.remedy.empty();
    text += fmt::format("{}  {:<24} {}{}{}\n", is_well ? "ok   " : "TO DO", finding.what,
                        finding.text, is_well ? "" : ": ", finding.remedy);
  }
  return text;
}

}  // namespace palpate
