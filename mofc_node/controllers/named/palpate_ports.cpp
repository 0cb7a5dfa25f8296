// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <new>
#include <span>
#include <string_view>

#include "mofc_node/controllers/named/palpate_controllers.h"
#include "mofc_node/controllers/ports/port_guard.h"

using palpate::controllers::kMostPorts;
using palpate::controllers::PortGuard;
using palpate::controllers::PortGuardParameters;
using palpate::controllers::PortOutput;
using palpate::controllers::PortStretch;
using palpate::controllers::PortValues;

static_assert(kMostPorts == PALPATE_MOST_PORTS);

namespace {

/// More in one step are not known: they count as a gap.
constexpr std::size_t kMostStretches = 64;

struct Setting {
  const char* name;
  double& (*of)(PortGuardParameters&);
  bool is_zero_allowed;
};
constexpr std::array<Setting, 6> kSettings{{
    {"lease_s", [](PortGuardParameters& p) -> double& { return p.times.hold_s; }, false},
    {"longest_lease_s", [](PortGuardParameters& p) -> double& { return p.times.longest_lease_s; },
     true},
    {"delta_max_s", [](PortGuardParameters& p) -> double& { return p.times.delta_max_s; }, true},
    {"credit_cap_joule", [](PortGuardParameters& p) -> double& { return p.credit_cap_joule; },
     false},
    {"gate_joule", [](PortGuardParameters& p) -> double& { return p.gate_joule; }, false},
    {"gate_recovery_s", [](PortGuardParameters& p) -> double& { return p.gate_recovery_s; }, false},
}};

PortValues values_of(const double (&values)[kMostPorts], std::size_t count) {
  PortValues taken{};
  std::copy_n(std::begin(values), count, taken.begin());
  return taken;
}

bool all_finite(const double (&values)[kMostPorts], std::size_t count) {
  return std::all_of(std::begin(values), std::begin(values) + count,
                     [](double value) { return std::isfinite(value); });
}

bool is_not_negative(double value) { return std::isfinite(value) && value >= 0.0; }

bool is_finite(const palpate_port_input& input, std::size_t count) {
  bool is_good = std::isfinite(input.acting_lease_s) && std::isfinite(input.stored_energy_joule) &&
                 all_finite(input.position, count) &&
                 all_finite(input.acting_effort_on_hand, count);
  for (const palpate_port_stretch& s : std::span(input.applied, input.applied_count)) {
    is_good = is_good && is_not_negative(s.duration_s) && all_finite(s.effort_on_hand, count) &&
              (s.is_end_unknown != 0 || all_finite(s.position_at_end, count));
  }
  return is_good;
}

}  // namespace

struct palpate_ports {
  PortGuardParameters parameters{};
  PortValues peak_effort{};
  PortGuard guard;
  std::array<PortStretch, kMostStretches> stretches{};
  bool is_next_a_gap = false;

  void begin_anew() noexcept {
    guard = PortGuard(raised_for_one_hold(parameters, peak_effort));
    is_next_a_gap = false;
  }
};

palpate_ports* palpate_ports_create(const palpate_port* ports, size_t count) {
  if (ports == nullptr || count == 0 || count > kMostPorts) return nullptr;
  PortGuardParameters parameters{.count = count,
                                 .times = {.hold_s = 0.002, .longest_lease_s = 0.002}};
  PortValues peak_effort{};
  for (std::size_t i = 0; i < count; ++i) {
    const palpate_port& port = ports[i];
    const bool is_good = is_not_negative(port.viscous) && is_not_negative(port.coulomb) &&
                         is_not_negative(port.resolution) && is_not_negative(port.peak_effort) &&
                         is_not_negative(port.v_max) && port.v_max > 0.0;
    if (!is_good) return nullptr;
    parameters.ports[i] = {.f_d = port.viscous,
                           .f_co = port.coulomb,
                           .q = port.resolution,
                           .v_max = port.v_max,
                           .priority = port.priority};
    peak_effort[i] = port.peak_effort;
  }
  auto* made = new (std::nothrow)
      palpate_ports{.parameters = parameters,
                    .peak_effort = peak_effort,
                    .guard = PortGuard(raised_for_one_hold(parameters, peak_effort))};
  return made;
}

void palpate_ports_destroy(palpate_ports* ports) { delete ports; }

palpate_status palpate_ports_set(palpate_ports* ports, const char* setting, double value) {
  if (ports == nullptr || setting == nullptr) return PALPATE_NULL_POINTER;
  for (const Setting& known : kSettings) {
    if (std::string_view(known.name) != setting) continue;
    if (!is_not_negative(value) || (value == 0.0 && !known.is_zero_allowed)) {
      return PALPATE_OUT_OF_RANGE;
    }
    known.of(ports->parameters) = value;
    ports->begin_anew();
    return PALPATE_OK;
  }
  return PALPATE_UNKNOWN_NAME;
}

palpate_status palpate_ports_reset(palpate_ports* ports) {
  if (ports == nullptr) return PALPATE_NULL_POINTER;
  ports->guard.reset();
  ports->is_next_a_gap = false;
  return PALPATE_OK;
}

palpate_status palpate_ports_step(palpate_ports* ports, const palpate_port_input* input,
                                  palpate_port_output* output) {
  if (output == nullptr) return PALPATE_NULL_POINTER;
  *output = {};
  if (ports == nullptr) return PALPATE_NULL_POINTER;
  const std::size_t used = ports->parameters.count;
  const bool has_stretches =
      input != nullptr && (input->applied != nullptr || input->applied_count == 0);
  if (!has_stretches || !is_finite(*input, used)) {
    ports->is_next_a_gap = true;
    return has_stretches ? PALPATE_NOT_FINITE : PALPATE_NULL_POINTER;
  }
  const bool is_too_much = input->applied_count > kMostStretches;
  const std::size_t count = is_too_much ? 0 : input->applied_count;
  for (std::size_t i = 0; i < count; ++i) {
    const palpate_port_stretch& s = input->applied[i];
    ports->stretches[i] = {.duration_s = s.duration_s,
                           .effort_on_hand = values_of(s.effort_on_hand, used),
                           .position_at_end = values_of(s.position_at_end, used),
                           .has_position_at_end = s.is_end_unknown == 0};
  }
  const PortOutput made = ports->guard.step(
      {.position = values_of(input->position, used),
       .applied = {ports->stretches.data(), count},
       .has_gap = input->has_gap != 0 || is_too_much || ports->is_next_a_gap,
       .acting_effort_on_hand = values_of(input->acting_effort_on_hand, used),
       .acting_lease_s = input->acting_lease_s > 0.0 ? input->acting_lease_s
                                                     : std::numeric_limits<double>::infinity(),
       .requested_effort_on_hand = values_of(input->requested_effort_on_hand, used),
       .is_request_fresh = input->is_request_held == 0,
       .stored_energy_joule = input->stored_energy_joule});
  ports->is_next_a_gap = false;
  std::copy(made.effort_on_hand.begin(), made.effort_on_hand.end(), output->effort_on_hand);
  std::copy(made.most_effort.begin(), made.most_effort.end(), output->most_effort);
  output->ledger_energy_joule = made.ledger_energy_joule;
  output->lease_s = made.lease_s;
  output->begins_within_s = made.begins_within_s;
  output->is_clamped = made.is_clamped ? 1 : 0;
  output->is_too_fast = made.is_too_fast ? 1 : 0;
  return PALPATE_OK;
}
