#include "viewer_node/status_line.h"

#include <array>
#include <charconv>
#include <optional>

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

// Cut after kStatusColumns characters, never inside one.
std::string cut(std::string line) {
  std::size_t columns = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const bool begins_character = (static_cast<unsigned char>(line[i]) & 0xC0U) != 0x80U;
    if (begins_character && columns++ == kStatusColumns) {
      line.resize(i);
      break;
    }
  }
  return line;
}

}  // namespace

std::string status_line(const TelemetryMirror& mirror, TimePoint now) {
  std::string line;
  const auto add = [&line](const std::string& part) {
    if (!part.empty()) line += (line.empty() ? "" : "  ") + part;
  };
  add(absence("device", mirror.device_link(), now));
  add(absence("mofc", mirror.mofc_link(), now));
  add(absence("physics", mirror.physics_link(), now));

  // without the device there are no new ticks to speak of
  if (!mirror.device_link().is_alive(now)) return cut(line);
  const bool has_mofc = mirror.mofc_link().is_alive(now);
  const TelemetryFigures figures = mirror.figures();
  const bool is_answered =
      figures.guard == GuardState::kAnswered || figures.guard == GuardState::kLeased;

  add(fixed(figures.tick_rate_hz, 1) + " Hz");
  add("jitter p99 " + duration(figures.lateness_p99));
  add("reply p99 " + duration(figures.reply_time_p99));
  add("answered " + percent(figures.answered_ratio_since_start, 2));
  add(is_answered && has_mofc ? name(figures.mofc_state) : name(figures.guard));
  add("|F| " + fixed(figures.applied_newton, 2) + "/" + fixed(figures.asked_newton, 2) + " N");
  if (has_mofc) {
    add("clamp " + percent(figures.clamped_ratio, 0));
    add("E " + fixed(1e3 * figures.ledger_energy_joule, 1) + " mJ (true " +
        fixed(1e3 * figures.true_energy_joule, 1) + ")");
    add("transp " + fixed(figures.transparency, 2));
    add("age " + duration(figures.force_age_p50));
  }

  const std::uint64_t lost =
      mirror.mofc_counters().device_state.skipped + mirror.device_counters().force_command.skipped;
  add("lost " + std::to_string(lost));
  std::uint64_t telemetry_lost = 0;
  for (const NodeLink* link :
       {&mirror.device_link(), &mirror.mofc_link(), &mirror.physics_link()}) {
    telemetry_lost += link->batches_lost + link->records_lost;
  }
  if (telemetry_lost > 0) add("telemetry lost " + std::to_string(telemetry_lost));
  return cut(line);
}

}  // namespace palpate::viewer
