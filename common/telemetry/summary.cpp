#include "common/telemetry/summary.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/telemetry/verdict/verdict.h"

namespace palpate {

void RunStatistics::add(const TickRow& row, const IdealState& ideal) {
  const DeviceTick& device = row.device;
  const Vector3& fs = device.force_on_hand_newton;
  ++ticks_;

  // requested and rendered force
  if (row.mofc) {
    const Vector3& fe = row.mofc->asked_force_on_hand_newton;
    transparency_.add(fe, fs);
    rendered_.add(fe, fs);
    if (!fe.isZero(0.0)) ++asked_ticks_;
    if (row.mofc->is_clamped) ++clamped_ticks_;
  }
  const bool is_in_contact =
      row.is_truly_in_contact.value_or(row.mofc.has_value() && row.mofc->is_in_contact);
  if (is_in_contact) ++contact_ticks_;

  // ideal and rendered force
  if (row.ideal_force_on_hand_newton.allFinite()) {
    const Vector3& fi = row.ideal_force_on_hand_newton;
    true_to_ideal_.add(fi, fs);
    if (is_beyond_force_jnd(fi, fs)) ++beyond_jnd_;
  }
  if (ideal.force_on_hand_newton.allFinite())
    true_to_ideal_run_.add(ideal.force_on_hand_newton, fs);

  // safety
  maximum_force_newton_ = std::max(maximum_force_newton_, fs.norm());
  add_fallback(device);
  if (!std::isnan(device.minimum_true_energy_joule)) {
    minimum_true_energy_joule_ = device.minimum_true_energy_joule;
  }

  // the path, and the path of the ideal run
  if (device.true_tool_position_world_m.allFinite()) {
    top_tool_speed_m_per_s_ =
        std::max(top_tool_speed_m_per_s_, device.true_tool_velocity_world_m_per_s.norm());
    reversals_.add(device.true_tool_position_world_m);
    if (ideal.tool_position_world_m.allFinite()) {
      ++deviation_samples_;
      ideal_reversals_.add(ideal.tool_position_world_m);
      const double deviation2 =
          (device.true_tool_position_world_m - ideal.tool_position_world_m).squaredNorm();
      deviation2_m2_ += deviation2;
      deviation_peak_m_ = std::max(deviation_peak_m_, std::sqrt(deviation2));
    }
  }
}

void RunStatistics::add_fallback(const DeviceTick& tick) {
  if (tick.guard == GuardState::kAnswered) was_answered_ = true;
  if (tick.guard == GuardState::kAnswered || tick.guard == GuardState::kLeased) {
    fallback_from_.reset();
    return;
  }
  if (!was_answered_) return;
  if (!fallback_from_) fallback_from_ = tick.switched_at;
  longest_fallback_s_ =
      std::max(longest_fallback_s_, to_seconds(tick.switched_at - *fallback_from_));
}

std::uint64_t RunStatistics::excess_reversals() const {
  const std::uint64_t own = reversals_.total();
  const std::uint64_t ideal = ideal_reversals_.total();
  return own > ideal ? own - ideal : 0;
}

double RunStatistics::beyond_jnd_ratio() const {
  return true_to_ideal_.samples() > 0
             ? static_cast<double>(beyond_jnd_) / static_cast<double>(true_to_ideal_.samples())
             : kNaN;
}

double RunStatistics::path_deviation_rms_m() const {
  return deviation_samples_ > 0
             ? std::sqrt(deviation2_m2_ / static_cast<double>(deviation_samples_))
             : kNaN;
}

double RunStatistics::path_deviation_peak_m() const {
  return deviation_samples_ > 0 ? deviation_peak_m_ : kNaN;
}

double RunStatistics::clamp_ratio() const {
  return asked_ticks_ > 0 ? static_cast<double>(clamped_ticks_) / static_cast<double>(asked_ticks_)
                          : kNaN;
}

double answered_ratio(const DeviceCounters& counters) {
  const std::uint64_t scheduled = counters.loop.ticks + counters.loop.skipped_ticks;
  return scheduled > 0
             ? static_cast<double>(counters.answered_ticks) / static_cast<double>(scheduled)
             : kNaN;
}

nlohmann::ordered_json number_or_null(double value) {
  if (!std::isfinite(value)) return nullptr;
  return value;
}

nlohmann::ordered_json summary_json(const Session& session, const RunReport& report) {
  const RunStatistics& s = report.statistics;
  const bool has_ideal = std::isfinite(s.path_deviation_rms_m());
  const auto reversals = s.reversals();
  const auto ideal = s.ideal_reversals();
  const Vector3 transparency = s.transparency();
  nlohmann::ordered_json json;
  json["schema_version"] = 1;
  json["session"] = session.name;
  json["controller"] = controller_text(session.side().mofc);
  json["seed"] = session.seed;
  json["simulated_s"] = number_or_null(report.simulated_s);
  json["ticks"] = s.ticks();
  json["in_contact_ticks"] = s.contact_ticks();
  json["transparency"] = {{"x", number_or_null(transparency.x())},
                          {"y", number_or_null(transparency.y())},
                          {"z", number_or_null(transparency.z())},
                          {"vector", number_or_null(s.vector_transparency())},
                          {"ideal", number_or_null(s.ideal_transparency())}};
  json["force_error_rms_ratio"] = number_or_null(s.force_error_rms_ratio());
  json["ideal_run_force_error_rms_ratio"] = number_or_null(s.ideal_run_force_error_rms_ratio());
  json["beyond_jnd_ratio"] = number_or_null(s.beyond_jnd_ratio());
  json["min_true_energy_j"] = number_or_null(s.minimum_true_energy_joule());
  json["max_force_n"] = number_or_null(s.maximum_force_newton());
  json["largest_jump_n"] = number_or_null(report.device.largest_jump_newton);
  json["monitor"] = report.device.is_monitor_off ? "off" : "on";
  json["monitor_reductions"] = report.device.monitor_reductions;
  json["has_motor_watchdog"] = !report.device.has_no_motor_watchdog;
  json["velocity_reversals"] = {{"x", reversals[0]}, {"y", reversals[1]}, {"z", reversals[2]}};
  if (has_ideal) {
    json["velocity_reversals"]["ideal"] = {{"x", ideal[0]}, {"y", ideal[1]}, {"z", ideal[2]}};
    json["velocity_reversals"]["excess"] = s.excess_reversals();
  } else {
    json["velocity_reversals"]["ideal"] = nullptr;
    json["velocity_reversals"]["excess"] = nullptr;
  }
  json["path_deviation_rms_m"] = number_or_null(s.path_deviation_rms_m());
  json["path_deviation_peak_m"] = number_or_null(s.path_deviation_peak_m());
  json["clamp_ratio"] = number_or_null(s.clamp_ratio());
  json["answered_ratio"] = number_or_null(answered_ratio(report.device));
  json["motions_suppressed"] = report.mofc.motions_suppressed;
  json["physics_term"] = report.mofc.physics_term;
  json["standby_ticks"] = report.mofc.standby_ticks;
  json["physics_switches"] = report.mofc.physics_switches;
  json["interactions_suppressed"] = report.physics.interactions_suppressed;
  json["device_faults"] = report.device.device_faults;
  json["last_fault"] = name(report.device.last_fault);
  json["fault_ticks"] = report.device.fault_ticks;
  json["fallbacks"] = report.device.fallback_ticks + report.device.limp_ticks;
  json["wall_s"] = number_or_null(report.wall_s);
  json["ticks_per_wall_s"] =
      number_or_null(static_cast<double>(s.ticks()) / std::max(report.wall_s, 1e-9));
  json["verdict"] = verdict_json(judge(facts_of(session, report)));
  return json;
}

std::string monitor_text(const DeviceCounters& device) {
  if (device.is_monitor_off) return "off";
  std::string text = fmt::format("on, {} commands reduced", device.monitor_reductions);
  if (device.checked_friction_ratio > 0.0 && device.checked_friction_ratio < 1.0) {
    text += fmt::format(", friction lowered to {:.0f} % of the profile",
                        100.0 * device.checked_friction_ratio);
  }
  return text;
}

std::string speaker_text(const MofcCounters& mofc) {
  return fmt::format("{} speaks (term {}); {} of {} ticks from the standby, {} switches",
                     mofc.physics_term % 2 == 1 ? "the standby" : "the first", mofc.physics_term,
                     mofc.standby_ticks, mofc.ticks, mofc.physics_switches);
}

std::string figure(double value, const char* format) {
  return std::isfinite(value) ? fmt::format(fmt::runtime(format), value) : std::string("–");
}

std::string energy_text(double joule) {
  const double size = std::abs(joule);
  if (size >= 1.0) return fmt::format("{:.3g} J", joule);
  if (size >= 1e-3) return fmt::format("{:.3g} mJ", 1e3 * joule);
  return fmt::format("{:.3g} µJ", 1e6 * joule);
}

std::string summary_text(const Session& session, const RunReport& report) {
  const RunStatistics& s = report.statistics;
  const Vector3 transparency = s.transparency();
  const auto reversals = s.reversals();
  const auto total = reversals[0] + reversals[1] + reversals[2];
  const bool has_ideal = std::isfinite(s.path_deviation_rms_m());
  std::string text;
  const auto line = [&](const char* label, const std::string& value) {
    text += fmt::format("  {:<24}{}\n", label, value);
  };
  text += fmt::format("{}: {}, {:g} s simulated, {} ticks\n", session.name,
                      controller_text(session.side().mofc), report.simulated_s, s.ticks());
  line("in contact", fmt::format("{} ticks", s.contact_ticks()));
  line(
      "transparency x, y, z",
      fmt::format("{}, {}, {} (rendered / requested, per axis)", figure(transparency.x(), "{:.3f}"),
                  figure(transparency.y(), "{:.3f}"), figure(transparency.z(), "{:.3f}")));
  line("transparency, vector",
       figure(s.vector_transparency(), "{:.3f}") + " (rendered / requested), " +
           figure(s.ideal_transparency(), "{:.3f}") + " (rendered / ideal)");
  line("force error, rms", figure(s.force_error_rms_ratio(), "{:.3f}") + " of the ideal force; " +
                               figure(100.0 * s.beyond_jnd_ratio(), "{:.1f} %") +
                               " of the samples beyond the force JND");
  line("clamped", figure(100.0 * s.clamp_ratio(), "{:.1f} %") + " of the ticks with a force");
  line("largest force",
       figure(s.maximum_force_newton(), "{:.3f} N") +
           figure(report.device.largest_jump_newton, ", largest jump from tick to tick {:.3f} N"));
  line("monitor", monitor_text(report.device));
  if (report.device.has_no_motor_watchdog) line("motor watchdog", kNoWatchdogText);
  line("least true energy", figure(1e6 * s.minimum_true_energy_joule(), "{:.3f} µJ"));
  line("velocity reversals",
       has_ideal ? fmt::format("{}, {} more than the ideal run", total, s.excess_reversals())
                 : fmt::format("{}", total));
  line("path deviation", figure(1e3 * s.path_deviation_rms_m(), "{:.3f} mm") + " rms, " +
                             figure(1e3 * s.path_deviation_peak_m(), "{:.3f} mm") + " peak");
  line("answered in time",
       figure(100.0 * answered_ratio(report.device), "{:.3f} %") +
           fmt::format(" of {} scheduled ticks",
                       report.device.loop.ticks + report.device.loop.skipped_ticks));
  if (session.physics.standby) line("physics", speaker_text(report.mofc));
  const double times = report.simulated_s / std::max(report.wall_s, 1e-9);
  line("speed", fmt::format("{:.0f} ticks/s, {} times real time",
                            static_cast<double>(s.ticks()) / std::max(report.wall_s, 1e-9),
                            figure(times, times < 10.0 ? "{:.2g}" : "{:.0f}")));
  return text;
}

}  // namespace palpate
