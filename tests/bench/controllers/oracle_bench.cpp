// SPDX-License-Identifier: Apache-2.0
// oracle_bench — how much of the force a better ledger could give back where forces are held: mode
// guard beside a clamp that knows the true energy of the plant, without cap and gate, beside one
// that also knows how fast this hand gets, and beside those that ask for a share of the request.
#include <spdlog/fmt/fmt.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/session/clamped_device.h"
#include "common/session/session_file.h"
#include "deploy/lockstep/loopback.h"
#include "device_node/simulation/true_state.h"
#include "mofc_node/controllers/lease_rule.h"
#include "mofc_node/controllers/one_pool_clamp.h"
#include "tests/bench/bench_output.h"
#include "tests/support/machine/places.h"

namespace palpate::bench {
namespace {

constexpr const char* kSession = "tests/bench/controllers/compare.txtpb";
constexpr double kResolution_m = 55e-6;

/// The rule of guard, T drain(F) + δ drain(F_acting) ≤ E, with the energy of the plant for E: no
/// encoder, no count, no cap, no gate. It may ask for less: a share of the request.
class OracleClamp final : public controllers::ForceController {
 public:
  OracleClamp(const ClampedDevice& device, double v_max_m_per_s, double request_share,
              const device::TrueStateSource& plant)
      : plant_(plant),
        request_share_(request_share),
        clamp_({.f_d = device.profile.viscous_newton_s_per_m,
                .f_co = device.profile.coulomb_newton,
                .T = to_seconds(device.lease)},
               std::nullopt, v_max_m_per_s),
        rule_({.hold_s = to_seconds(device.lease),
               .delta_max_s = to_seconds(device.reply),
               .prompt_s = to_seconds(device.prompt),
               .longest_lease_s = to_seconds(device.longest_lease)}) {
    PALPATE_REQUIRE(!device.profile.per_axis);
  }

  void reset() noexcept override {}

  controllers::ControlOutput step(const controllers::ControlInput& input) noexcept override {
    const controllers::LeaseRule::Reserve reserve =
        rule_.reserve(plant_.true_state().energy_joule, input.acting_lease_s,
                      clamp_.drain_watt(input.acting_force_on_hand_newton), 0.0);
    controllers::ControlOutput output = clamp_.clamp(
        request_share_ * input.requested_force_on_hand_newton, rule_.credit_joule(reserve));
    output.ledger_energy_joule = reserve.energy_joule;
    const controllers::LeaseRule::Lease lease =
        rule_.lease(reserve, clamp_.drain_watt(output.force_on_hand_newton));
    output.begins_within_s = lease.begins_within_s;
    output.lease_s = lease.lease_s;
    return output;
  }

 private:
  const device::TrueStateSource& plant_;
  double request_share_;
  controllers::OnePoolClamp clamp_;
  controllers::LeaseRule rule_;
};

struct Tissue {
  const char* label;
  double stiffness_newton_per_m;
  double damping_newton_s_per_m;
  bool is_damper;  ///< the paper's: in all directions, and it pulls
};
constexpr Tissue kTissues[] = {{"paper soft", 6, 15, true},
                               {"paper rigid", 45, 150, true},
                               {"500 N/m", 500, 1, false},
                               {"2000 N/m", 2000, 1, false}};

struct Clamp {
  const char* label;
  std::vector<std::string> overrides;
  double oracle_v_max_m_per_s = 0.0;  ///< 0: what the session selects
  double request_share = 1.0;         ///< of the oracle
};

std::vector<Clamp> clamps() {
  return {{"none", {"mofc.controller=none"}},
          {"vector", {"mofc.mode=vector"}},
          {"guard", {"mofc.mode=guard"}},
          {"guard, no cap, no gate",
           {"mofc.mode=guard", "mofc.guard_settings.credit_cap_joule=10",
            "mofc.guard_settings.gate_joule=10"}},
          {"true energy", {"mofc.mode=guard"}, 0.5},
          {"true energy, hand ≤ 0.2 m/s", {"mofc.mode=guard"}, 0.2},
          {"true energy, 0.6 of the request", {"mofc.mode=guard"}, 0.5, 0.6},
          {"true energy, 0.4 of the request", {"mofc.mode=guard"}, 0.5, 0.4},
          {"true energy, 0.3 of the request", {"mofc.mode=guard"}, 0.5, 0.3},
          {"true energy, 0.2 of the request", {"mofc.mode=guard"}, 0.5, 0.2},
          {"true energy, 0.1 of the request", {"mofc.mode=guard"}, 0.5, 0.1}};
}

class Rows {
 public:
  explicit Rows(const BenchOptions& options) : options_(options) {}

  void run() {
    for (const Tissue& tissue : kTissues) {
      for (const double hz : {50.0, 1000.0}) {
        for (const double delay_ms : {0.0, 20.0}) {
          for (const double q : {0.0, kResolution_m}) {
            if (options_.is_quick && (q == 0.0 || (hz > 50.0 && delay_ms > 0.0))) continue;
            condition(tissue, hz, delay_ms, q);
          }
        }
      }
    }
    table_.publish(options_);
  }

 private:
  void condition(const Tissue& tissue, double hz, double delay_ms, double resolution_m) {
    for (const Clamp& clamp : clamps()) {
      double truth = 0.0;
      double error = 0.0;
      double least_joule = 0.0;
      double reversals = 0.0;
      const int seeds = options_.is_quick ? 1 : 3;
      for (int seed = 1; seed <= seeds; ++seed) {
        const RunStatistics s = statistics(tissue, hz, delay_ms, resolution_m, clamp, seed);
        truth += s.ideal_transparency() / seeds;
        error += s.force_error_rms_ratio() / seeds;
        reversals += static_cast<double>(s.excess_reversals()) / seeds;
        least_joule = std::min(least_joule, s.minimum_true_energy_joule());
      }
      table_.add({tissue.label, hz, delay_ms, 1e6 * resolution_m, clamp.label, truth, 100.0 * error,
                  reversals, 1e3 * least_joule});
    }
    table_.add_gap();
  }

  static RunStatistics statistics(const Tissue& tissue, double hz, double delay_ms,
                                  double resolution_m, const Clamp& clamp, int seed) {
    std::vector<std::string> overrides = clamp.overrides;
    overrides.push_back(
        fmt::format("scene={{ tissue {{ name: 'wall' half_space {{}} kelvin_voigt {{ "
                    "stiffness_newton_per_m: {} damping_newton_s_per_m: {} isotropic_damping: {} "
                    "adhesive: {} }} }} }}",
                    tissue.stiffness_newton_per_m, tissue.damping_newton_s_per_m, tissue.is_damper,
                    tissue.is_damper));
    overrides.push_back(fmt::format("physics.rate_hz={}", hz));
    overrides.emplace_back("mofc.interaction=held");
    for (const char* hop : {"tool_motion", "interaction"}) {
      overrides.push_back(fmt::format("faults.{}.delay_ms={}", hop, delay_ms));
    }
    for (const char* path : {"device.profile", "device.simulated"}) {
      overrides.push_back(fmt::format("{}.position_resolution_m={}", path, resolution_m));
    }
    overrides.push_back(fmt::format("seed={}", seed));
    const Session session =
        load_session(std::filesystem::path(test::source_dir()) / kSession, overrides);
    LoopbackOptions options;
    options.lockstep.has_ideal = true;
    if (clamp.oracle_v_max_m_per_s > 0.0) {
      options.lockstep.make_controller = [&](const Side& side, const device::HapticDevice& device) {
        const auto* const plant = dynamic_cast<const device::TrueStateSource*>(&device);
        PALPATE_REQUIRE(plant != nullptr);
        return std::make_unique<OracleClamp>(
            clamped_device(side.device), clamp.oracle_v_max_m_per_s, clamp.request_share, *plant);
      };
    }
    return run_loopback(session, options).statistics;
  }

  const BenchOptions& options_;
  Table table_{{{"tissue", "tissue", ""},
                {"physics_hz", "physics Hz", "{:.0f}"},
                {"delay_ms", "each way ms", "{:.0f}"},
                {"resolution_um", "encoder µm", "{:.0f}"},
                {"clamp", "clamp", ""},
                {"transparency", "T", "{:.3f}"},
                {"force_error_percent", "force error %", "{:.0f}"},
                {"excess_reversals", "excess rev.", "{:.0f}"},
                {"least_true_energy_mj", "least true energy mJ", "{:.3f}"}}};
};

}  // namespace
}  // namespace palpate::bench

int main(int argc, char** argv) {
  CLI::App app("Mode guard beside a clamp that knows the true energy, where forces are held.");
  palpate::bench::BenchOptions options;
  return palpate::bench::run_bench(app, options, argc, argv,
                                   [&] { palpate::bench::Rows(options).run(); });
}
