// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/feed/status_line.h"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>

#include "common/core/user/utf8.h"

namespace palpate::viewer {
namespace {

std::string fixed(double value, int digits) {
  if (!std::isfinite(value)) return "-";
  std::array<char, 400> text;  // the largest double has 309 digits before its point
  char* const end =
      std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, digits)
          .ptr;
  return {text.data(), end};
}

std::string percent(double ratio, int digits) { return fixed(100.0 * ratio, digits) + " %"; }

std::string duration(std::optional<Duration> d) {
  if (!d) return "-";
  const double seconds = to_seconds(*d);
  if (seconds < 1e-3) return fixed(1e6 * seconds, 0) + " µs";
  if (seconds < 1.0) return fixed(1e3 * seconds, 1) + " ms";
  return fixed(seconds, 1) + " s";
}

std::string absence(const char* node, const NodeLink& link, TimePoint now) {
  if (!link.is_heard()) return std::string(node) + ": not heard yet";
  if (!link.is_gone(now)) return {};
  return std::string(node) + ": not heard for " + duration(now - link.heard_at);
}

}  // namespace

std::string status_line(const TelemetryMirror& mirror, TimePoint now, std::size_t columns) {
  std::string line;
  const auto add = [&line, columns](const std::string& part) {
    const std::string extended = line + (line.empty() || part.empty() ? "" : "  ") + part;
    if (columns_of(extended) <= columns) line = extended;
  };
  add(absence("device", mirror.device_link(), now));
  add(absence("mofc", mirror.mofc_link(), now));
  add(absence("physics", mirror.physics_link(), now));

  // without the device there are no new ticks
  if (!mirror.device_link().is_alive(now)) return line;
  const bool has_mofc = mirror.mofc_link().is_alive(now);
  const bool has_physics = mirror.physics_link().is_alive(now);
  const TelemetryFigures figures = mirror.figures();
  const bool is_answered =
      figures.guard == GuardState::kAnswered || figures.guard == GuardState::kLeased;

  add(fixed(figures.tick_rate_hz, 1) + " Hz");
  add("jitter p99 " + duration(figures.lateness_p99));
  add("reply p99 " + duration(figures.reply_time_p99));
  add("answered " + percent(figures.answered_ratio_since_start, 2));
  if (mirror.device_counters().is_release_unconfirmed) add("MOTORS MAY PUSH");
  if (figures.guard == GuardState::kFault) {
    add(std::string("FAULT: ") + name(mirror.device_counters().last_fault));
  } else if (const DevicePhase phase = mirror.device_counters().phase;
             phase == DevicePhase::kConnected) {
    add("NO FORCE: calibrate, then SIGUSR2");
  } else if (phase == DevicePhase::kCalibrated) {
    add("NO FORCE: acknowledge by SIGUSR2");
  } else if (phase == DevicePhase::kChecking) {
    add("CHECKS MOTORS: hold still, and the dead-man button if there is one");
  } else {
    add(is_answered && has_mofc ? name(figures.mofc_state) : name(figures.guard));
  }
  add("|F| " + fixed(figures.applied_newton, 2) + "/" + fixed(figures.requested_newton, 2) + " N");
  if (has_mofc) {
    add("clamp " + percent(figures.clamped_ratio, 0));
    const bool knows_truth = std::isfinite(figures.true_energy_joule);
    add("E " + fixed(1e3 * figures.ledger_energy_joule, 1) + " mJ" +
        (knows_truth ? " (true " + fixed(1e3 * figures.true_energy_joule, 1) + ")" : ""));
  }
  if (has_mofc && has_physics) {
    add("transp " + fixed(figures.transparency, 2));
    add("age " + duration(figures.force_age_p50));
  }

  std::uint64_t telemetry_lost = 0;
  for (const NodeLink* link :
       {&mirror.device_link(), &mirror.mofc_link(), &mirror.physics_link()}) {
    telemetry_lost += link->batches_lost + link->records_lost;
  }
  const std::uint64_t lost =
      mirror.mofc_counters().device_state.skipped + mirror.device_counters().force_command.skipped;
  add("lost " + std::to_string(lost) +
      (telemetry_lost > 0 ? " (telemetry " + std::to_string(telemetry_lost) + ")" : ""));
  return line;
}

}  // namespace palpate::viewer
