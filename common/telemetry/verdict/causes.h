// SPDX-License-Identifier: Apache-2.0
// causes.h — why what was found in a run is as it is: because of an earlier finding, of something
// that the session simulates, or of what the session asks for.
#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <vector>

#include "common/telemetry/verdict/simulated.h"
#include "common/telemetry/verdict/verdict.h"

namespace palpate {

struct Cause {
  std::string what;    ///< RunFinding::cause
  std::string remedy;  ///< RunFinding::remedy
};

/// 0 of nothing.
[[nodiscard]] double ratio(std::uint64_t part, std::uint64_t whole);
/// Ticks before the first answer, which nobody has missed; 0 if there was none.
[[nodiscard]] std::uint64_t start_up_ticks(const DeviceCounters& device);
/// "4.2 %", "42 %"
[[nodiscard]] std::string percent(double share);
/// "1,000"
[[nodiscard]] std::string thousands(double value);

class Causes {
 public:
  /// @param findings  those so far; both must outlive this
  Causes(const RunFacts& facts, const std::vector<RunFinding>& findings)
      : f_(facts), findings_(findings) {}

  /// The first of these that was found, is not good and took at least that share of the run.
  [[nodiscard]] std::optional<Cause> found(std::initializer_list<const char*> events,
                                           double least_share = 0.0) const;
  /// What the session simulates there, if it disturbs enough of the run.
  /// @param loss  share of the run, or of the contact, that is to be explained
  /// @param least_delay_s  of a delay, what nobody notices
  [[nodiscard]] std::optional<Cause> simulated(SimulatedAt place, double loss,
                                               double least_delay_s = 0.0) const;
  /// The device gave no force, because its motors end none by themselves.
  [[nodiscard]] std::optional<Cause> held_to_no_force() const {
    return f_.device.max_force_newton == 0.0 ? found({"no_motor_watchdog"}) : std::nullopt;
  }
  /// The controller is not MOFC: a net behind it changes nothing about who asks for the force.
  [[nodiscard]] bool is_other_controller() const {
    return !f_.controller.empty() && !f_.controller.starts_with("mofc");
  }

  [[nodiscard]] Cause of_late_ticks(double skipped) const;
  [[nodiscard]] Cause of_no_answer(double unanswered) const;
  [[nodiscard]] Cause of_silent_physics(double silent) const;
  /// @param missing  share of the steps, or of the ticks that had to wait for one
  [[nodiscard]] Cause of_slow_physics(double missing) const;
  [[nodiscard]] Cause of_extracted_energy() const;
  [[nodiscard]] Cause of_no_contact() const;
  /// The account is below 0.
  [[nodiscard]] Cause of_debt(double loss) const;
  /// The machine has fewer processors than the session has sides.
  [[nodiscard]] std::optional<Cause> few_processors() const;
  /// Why a force that physics asks for is not passive, or not true. A disturbance is the cause only
  /// if the loss lies in the ticks that it touched; what the session sets is asked before one of
  /// which that is not known.
  /// @param loss  share of the contact that is lost: what took far less of the run is not its cause
  [[nodiscard]] Cause of_loss(double loss) const;

 private:
  [[nodiscard]] std::optional<Cause> stopped_process() const;
  [[nodiscard]] std::optional<Cause> paused_clamp() const;
  /// Where the clamp took force.
  enum class LossPlace : std::uint8_t {
    kUnknown,    ///< or it took little
    kDisturbed,  ///< in ticks that something disturbed, and soon after
    kElsewhere,  ///< as often where nothing was disturbed
  };
  [[nodiscard]] LossPlace place_of_loss() const;
  /// The force ages with the news of the physics: local models of described tissue do not.
  [[nodiscard]] bool needs_news() const {
    return !f_.is_local || f_.is_foreign_physics || std::isfinite(f_.solve_rate_hz);
  }
  [[nodiscard]] bool is_coarse() const { return f_.physics_rate_hz < f_.device_rate_hz; }
  [[nodiscard]] bool is_held() const { return !f_.is_local && !f_.waits_for_physics; }
  [[nodiscard]] std::optional<Cause> of_run(double least_share) const;
  [[nodiscard]] std::optional<Cause> disturbed_ticks(double loss) const;
  [[nodiscard]] std::optional<Cause> old_news(double loss) const;
  [[nodiscard]] std::optional<Cause> settings(double loss) const;
  [[nodiscard]] std::optional<Cause> begin_of_run(double loss) const;
  [[nodiscard]] std::optional<Cause> device(double least_share) const;
  [[nodiscard]] std::optional<Cause> deadband() const;
  [[nodiscard]] std::optional<Cause> rate_and_mode() const;
  [[nodiscard]] std::optional<Cause> credit_cap() const;
  [[nodiscard]] std::optional<Cause> no_friction() const;
  [[nodiscard]] std::optional<Cause> physics() const;
  [[nodiscard]] std::optional<Cause> controller_settings() const;

  const RunFacts& f_;
  const std::vector<RunFinding>& findings_;
};

}  // namespace palpate
