// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/controllers/step_times.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "common/session/mofc_config.h"
#include "mofc_node/make_controller.h"
#include "mofc_node/model_probe.h"

namespace palpate::bench {
namespace {

using std::chrono_literals::operator""ms;

/// Palpation at 1 Hz of a wall of 500 N/m, asked through its contact model.
std::vector<double> step_times_us(const MofcConfig& config) {
  constexpr int kSteps = 20'000;
  const ClampedDevice device{.lease = 2ms, .longest_lease = 5ms};
  const auto controller = mofc::make_controller(config, device);
  Interaction interaction;
  interaction.listed_count = interaction.contact_count = 1;
  interaction.contacts[0] = {.penetration_m = 0.005,
                             .elastic_force_on_tool_newton = Vector3(0, 0, 2.5),
                             .d_force_d_position = Vector3(0, 0, -500).asDiagonal(),
                             .stored_energy_joule = 0.5 * 500 * 25e-6,
                             .trust_radius_m = 1.0};
  interaction.tool_position_world_m = {0, 0, -0.005};
  DeviceState state;
  Vector3 acting = Vector3::Zero();
  std::vector<double> times_us;
  times_us.reserve(kSteps);
  for (int k = 0; k < kSteps; ++k) {
    state.hand_position_m = {0, 0, -0.005 + 0.004 * std::sin(6.28e-3 * k)};
    state.tool_position_world_m = state.hand_position_m;
    const mofc::ModelProbe probe(&interaction, state, state.tool_position_world_m,
                                 device.workspace);
    const Vector3 v(0, 0, 0.025 * std::cos(6.28e-3 * k));
    const auto force = probe.at(state.hand_position_m, v);
    const controllers::AppliedStretch stretch{1e-3, acting, state.hand_position_m, true};
    const controllers::ControlInput input{
        .hand_position_m = state.hand_position_m,
        .applied = {&stretch, k > 0 ? 1U : 0U},
        .acting_force_on_hand_newton = acting,
        .requested_force_on_hand_newton = force.force_on_hand_newton,
        .stored_energy_joule = force.stored_energy_joule,
        .hand_velocity_m_per_s = v,
        .evaluated_at_m = state.hand_position_m,
        .surface_normal = probe.surface_normal(),
        .tissue = &probe};
    const auto begin = std::chrono::steady_clock::now();
    acting = controller->step(input).force_on_hand_newton;
    const std::chrono::duration<double, std::micro> elapsed =
        std::chrono::steady_clock::now() - begin;
    times_us.push_back(elapsed.count());
  }
  std::sort(times_us.begin(), times_us.end());
  return times_us;
}

}  // namespace

Table step_time_table() {
  Table table({{"controller", "controller", ""},
               {"median_us", "median µs", "{:.2f}"},
               {"p99_us", "99 % µs", "{:.2f}"}});
  using Kind = ControllerKind;
  for (const Kind kind :
       {Kind::kNone, Kind::kMofc, Kind::kVirtualCoupling, Kind::kEnergyBounding,
        Kind::kForceBounding, Kind::kPassivityControl, Kind::kMemoryBased, Kind::kInputToState,
        Kind::kTwoPort, Kind::kEnergyTank, Kind::kLyapunov, Kind::kWaveVariables}) {
    MofcConfig config;
    config.controller = kind;
    for (const bool has_net : {false, true}) {
      if (has_net && kind == Kind::kMofc) continue;
      config.has_safety_net = has_net;
      const std::vector<double> times_us = step_times_us(config);
      table.add({controller_text(config), times_us[times_us.size() / 2],
                 times_us[times_us.size() * 99 / 100]});
    }
  }
  return table;
}

}  // namespace palpate::bench
