// SPDX-License-Identifier: Apache-2.0
#include "deploy/lockstep/recompute.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "common/core/clock.h"
#include "common/core/workspace_map.h"
#include "common/session/clamped_device.h"
#include "common/telemetry/request_comparison.h"
#include "common/telemetry/summary.h"
#include "deploy/lockstep/ideal.h"
#include "device_node/simulation/simulated_device.h"
#include "mofc_node/make_controller.h"
#include "viewer_node/feed/telemetry_mirror.h"

namespace palpate {
namespace {

constexpr double kSameIntegral = 1e-9;
constexpr double kSameLedger_joule = 1e-9;
// Forces are replaced at instants that are recorded, so no lease ends by itself.
constexpr Duration kEndlessLease = std::chrono::hours(24);

double difference(const Vector3& a, const Vector3& b) { return (a - b).norm(); }

bool is_same_integral(double a, double b) {
  return std::abs(a - b) <= kSameIntegral * std::max(std::abs(a), std::abs(b));
}

std::array<Twice, 7> integrals_of(const Recomputed& r) {
  const ForceComparison::Integrals& a = r.recorded_to_ideal.integrals();
  const ForceComparison::Integrals& b = r.to_ideal.integrals();
  return {{{a.judged_s, b.judged_s},
           {a.transparency_s, b.transparency_s},
           {a.along_n2s, b.along_n2s},
           {a.reference_n2s, b.reference_n2s},
           {a.error_n2s, b.error_n2s},
           {a.error_ns, b.error_ns},
           {a.beyond_jnd_s, b.beyond_jnd_s}}};
}

/// The hand of the session under the forces that acted.
class MovedAgain {
 public:
  MovedAgain(const Session& session, Recomputed& result)
      : result_(result),
        device_(without_limit(session.side().simulated), session.side().hand, clock_,
                stream_seed(session, session.side(), "hand")),
        map_(session.side().device.workspace),
        ideal_(session, session.side()) {
    device_.record_steps(&steps_);
  }

  /// Until the reading of the row; false where it is not known what acted.
  [[nodiscard]] bool move(const TickRow& row) {
    const DeviceTick& tick = row.device;
    if (tick.sequence != next_sequence_++) return stop("ticks are missing");
    device::DeviceSample sample;
    if (tick.sequence > 0 && tick.acted_count == 0 && tick.sampled_at > clock_.now()) {
      return stop("it does not say what acted: recorded by an earlier version");
    }
    for (std::uint32_t i = 0; i < tick.acted_count; ++i) {
      const AppliedForce& acted = tick.acted[i];
      if (acted.from != clock_.now()) return stop("what acted is not known throughout");
      device_.set_wrist_torque(acted.wrist_torque_newton_m);
      static_cast<void>(device_.apply(acted.force_on_hand_newton, kEndlessLease, sample));
      clock_.sleep_until(acted.until);
      static_cast<void>(device_.read(sample));
    }
    clock_.sleep_until(tick.sampled_at);
    static_cast<void>(device_.read(sample));
    compare(row);
    return true;
  }

 private:
  /// The recorded forces are what the motors made of the commands.
  static SimulatedDeviceConfig without_limit(SimulatedDeviceConfig device) {
    device.peak_force_newton = std::numeric_limits<double>::infinity();
    if (device.wrist) device.wrist->peak_torque_newton_m = device.peak_force_newton;
    return device;
  }

  bool stop(const char* why) {
    result_.not_moved = fmt::format("from tick {} on: {}", next_sequence_ - 1, why);
    return false;
  }

  void compare(const TickRow& row) {
    const device::TrueState truth = device_.true_state();
    map_.update(row.device.measured_hand_position_m, row.device.is_clutched);
    TickRow again{.device_session_id = row.device_session_id, .device = row.device};
    again.device.true_tool_position_world_m = map_.tool_position_world_m(truth.hand_position_m);
    again.device.true_tool_velocity_world_m_per_s =
        map_.tool_velocity_world_m_per_s(truth.hand_velocity_m_per_s);
    if (truth.wrist) {
      again.device.true_wrist_angle_rad = truth.wrist->angle_rad;
      again.device.true_wrist_velocity_rad_per_s = truth.wrist->velocity_rad_per_s;
    }
    result_.largest_position_difference_m = std::max(
        result_.largest_position_difference_m,
        difference(again.device.true_tool_position_world_m, row.device.true_tool_position_world_m));
    result_.largest_energy_difference_joule =
        std::max(result_.largest_energy_difference_joule,
                 std::abs(truth.energy_joule - row.device.true_energy_joule));
    result_.least_true_energy_joule = {row.device.minimum_true_energy_joule,
                                       truth.minimum_energy_joule};
    ideal_.judge(again, steps_);
    if (again.to_ideal) result_.to_ideal.add(*again.to_ideal);
    if (row.to_ideal) result_.recorded_to_ideal.add(*row.to_ideal);
  }

  Recomputed& result_;
  ManualClock clock_;
  std::vector<device::InnerStep> steps_;
  device::SimulatedDevice device_;
  WorkspaceMap map_;
  Ideal ideal_;
  std::uint64_t next_sequence_ = 0;
};

/// The ledger of the session's controller, from the recorded echo. With a wrist it is not booked:
/// the recording has no measured angles.
class BookedAgain {
 public:
  BookedAgain(const Session& session, Recomputed& result)
      : result_(result),
        controller_(mofc::make_controller(without_cap(session.side().mofc),
                                          clamped_device(session.side().device))) {}

  void book(const TickRow& row) {
    const DeviceTick& tick = row.device;
    if (tick.has_wrist()) return;
    if (row.device_session_id != session_id_) {
      session_id_ = row.device_session_id;
      controller_->reset();
      known_until_.reset();
      next_sequence_ = 0;
    }
    // what follows a missing tick, or one that does not say what acted, is not known either
    const bool is_told = tick.acted_count > 0 || !known_until_ || tick.sampled_at == known_until_;
    if (tick.sequence != next_sequence_ || !is_told) return;
    ++next_sequence_;
    std::array<controllers::AppliedStretch, kMaxActedForces> applied;
    for (std::uint32_t i = 0; i < tick.acted_count; ++i) {
      const AppliedForce& acted = tick.acted[i];
      applied[i] = {.duration_s = to_seconds(acted.until - acted.from),
                    .force_on_hand_newton = acted.force_on_hand_newton,
                    .hand_position_at_end_m = acted.hand_position_at_end_m,
                    .has_position_at_end = acted.has_position_at_end};
    }
    const bool is_continued =
        tick.acted_count > 0 ? tick.acted[0].from == known_until_ : tick.sampled_at == known_until_;
    const controllers::ControlOutput output =
        controller_->step({.hand_position_m = tick.measured_hand_position_m,
                           .applied = {applied.data(), tick.acted_count},
                           .has_gap = known_until_.has_value() && !is_continued});
    known_until_ = tick.sampled_at;
    if (!row.mofc || !std::isfinite(row.mofc->ledger_energy_joule)) return;
    result_.last_ledger_joule = {row.mofc->ledger_energy_joule, output.ledger_energy_joule};
    result_.largest_ledger_excess_joule =
        std::fmax(result_.largest_ledger_excess_joule,
                  row.mofc->ledger_energy_joule - output.ledger_energy_joule);
  }

 private:
  static MofcConfig without_cap(MofcConfig mofc) {
    mofc.guard.credit_cap_joule = std::numeric_limits<double>::infinity();
    return mofc;
  }

  Recomputed& result_;
  std::unique_ptr<controllers::ForceController> controller_;
  std::uint64_t session_id_ = 0;
  std::uint64_t next_sequence_ = 0;
  std::optional<TimePoint> known_until_;
};

/// Empty where the hand's motion can be computed again.
std::string obstacle(const RecordingFile& recording) {
  const std::string by = recording.about("recorded_by");
  if (!by.starts_with("palpate loopback")) {
    return "only recordings of palpate loopback begin with the hand; this is one of " + by;
  }
  return by == "palpate loopback" ? "" : "the hand followed another recording: " + by;
}

}  // namespace

bool Recomputed::is_same() const {
  if (largest_ledger_excess_joule > kSameLedger_joule) return false;
  if (!not_moved.empty()) return true;
  const auto integrals = integrals_of(*this);
  const bool has_integrals = recorded_to_ideal.integrals().judged_s > 0.0;
  return largest_position_difference_m == 0.0 && largest_energy_difference_joule == 0.0 &&
         least_true_energy_joule.recorded == least_true_energy_joule.recomputed &&
         (!has_integrals || std::all_of(integrals.begin(), integrals.end(), [](const Twice& i) {
           return is_same_integral(i.recorded, i.recomputed);
         }));
}

Recomputed recompute(RecordingFile& recording, const Session& session,
                     const std::function<void(double)>& on_progress) {
  Recomputed result;
  result.not_moved = obstacle(recording);
  std::optional<MovedAgain> moved;
  if (result.not_moved.empty()) moved.emplace(session, result);
  BookedAgain booked(session, result);
  RequestComparison requests;
  std::optional<std::uint64_t> session_id;

  viewer::TelemetryMirror mirror;
  mirror.on_row = [&](TickRow row) {
    recording.complete(row);
    ++result.ticks;
    if (session_id && session_id != row.device_session_id) requests.interrupt();
    session_id = row.device_session_id;
    requests.add(row.device, row.mofc);
    booked.book(row);
    if (moved && !moved->move(row)) moved.reset();
  };
  recording.seek(0);
  while (const RecordingFile::Item* item = recording.next()) {
    if (on_progress) on_progress(recording.passed_ratio());
    const TimePoint at{Duration(static_cast<std::int64_t>(item->log_time_ns))};
    std::visit(
        [&](const auto& message) {
          if constexpr (requires { mirror.take(message, at); }) mirror.take(message, at);
        },
        item->message);
  }
  mirror.flush_rows();
  result.transparency = {mirror.mofc_counters().transparency(), requests.rendered().transparency()};
  return result;
}

std::string recomputed_text(const Recomputed& r) {
  std::string text;
  const auto line = [&](const char* label, const std::string& value) {
    text += fmt::format("  {:<24}{}\n", label, value);
  };
  const auto twice = [&](const char* label, const Twice& figures, double unit, const char* format) {
    line(label, figure(unit * figures.recomputed, format) + ", recorded " +
                    figure(unit * figures.recorded, format));
  };
  line("ticks", fmt::format("{}", r.ticks));
  if (r.not_moved.empty()) {
    line("true tool position",
         r.largest_position_difference_m == 0.0
             ? "the same in every tick"
             : fmt::format("up to {:.3g} m off", r.largest_position_difference_m));
    line("true energy", r.largest_energy_difference_joule == 0.0
                            ? "the same in every tick"
                            : fmt::format("up to {:.3g} J off", r.largest_energy_difference_joule));
    twice("least true energy", r.least_true_energy_joule, 1e6, "{:.3f} µJ");
    const ForceComparison& a = r.recorded_to_ideal;
    const ForceComparison& b = r.to_ideal;
    twice("transparency, ideal", {a.transparency(), b.transparency()}, 1.0, "{:.6f}");
    twice("gain", {a.gain(), b.gain()}, 1.0, "{:.6f}");
    twice("force error, rms", {a.rms_error_ratio(), b.rms_error_ratio()}, 1.0, "{:.6f}");
    twice("beyond the force JND", {a.beyond_jnd_ratio(), b.beyond_jnd_ratio()}, 100.0, "{:.3f} %");
  } else {
    line("hand", "not moved again: " + r.not_moved);
  }
  twice("transparency, requested", r.transparency, 1.0, "{:.6f}");
  if (std::isfinite(r.largest_ledger_excess_joule)) {
    twice("ledger, at the end", r.last_ledger_joule, 1e3, "{:.3f} mJ");
    line("ledger", r.largest_ledger_excess_joule <= kSameLedger_joule
                       ? "recorded nowhere above what acted allows"
                       : fmt::format("recorded up to {:.3g} J above what acted allows",
                                     r.largest_ledger_excess_joule));
  }
  if (!r.is_same()) {
    line("result", "NOT the same as recorded");
  } else {
    line("result", r.not_moved.empty() ? "the same as recorded" : "what was compared agrees");
  }
  return text;
}

}  // namespace palpate
