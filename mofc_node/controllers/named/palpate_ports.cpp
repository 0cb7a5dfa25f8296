// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <new>
#include <span>
#include <string_view>

#include "mofc_node/controllers/named/palpate_controllers.h"
#include "mofc_node/controllers/ports/port_guard.h"

using palpate::controllers::is_plausible;
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

bool is_not_negative(double value) { return is_plausible(value) && value >= 0.0; }

/// One line for a person.
using Text = std::array<char, 200>;

/// Whether `values` can be what they are said to be; if not, `text` says which is not.
bool are_plausible(const double (&values)[kMostPorts], std::size_t count, const char* what,
                   Text& text) {
  for (std::size_t i = 0; i < count; ++i) {
    if (is_plausible(values[i])) continue;
    std::snprintf(text.data(), text.size(), "port %zu: %s = %g: must be a number within ±1e9", i,
                  what, values[i]);
    return false;
  }
  return true;
}

bool is_plausible(const palpate_port_input& input, std::size_t count, Text& text) {
  if (!are_plausible(input.position, count, "position", text) ||
      !are_plausible(input.acting_effort_on_hand, count, "acting_effort_on_hand", text)) {
    return false;
  }
  if (!std::isfinite(input.acting_lease_s) || !std::isfinite(input.stored_energy_joule)) {
    std::snprintf(text.data(), text.size(),
                  "acting_lease_s = %g, stored_energy_joule = %g: must be finite",
                  input.acting_lease_s, input.stored_energy_joule);
    return false;
  }
  for (const palpate_port_stretch& s : std::span(input.applied, input.applied_count)) {
    if (!is_not_negative(s.duration_s)) {
      std::snprintf(text.data(), text.size(),
                    "duration_s = %g of a stretch: must be 0 or above, at most 1e9", s.duration_s);
      return false;
    }
    if (!are_plausible(s.effort_on_hand, count, "effort_on_hand of a stretch", text) ||
        (s.is_end_unknown == 0 &&
         !are_plausible(s.position_at_end, count, "position_at_end of a stretch", text))) {
      return false;
    }
  }
  return true;
}

/// Whether a clamp can be made for these; if not, `text` says why.
bool are_good(const palpate_port* ports, std::size_t count, Text& text) {
  if (ports == nullptr || count == 0 || count > kMostPorts) {
    std::snprintf(text.data(), text.size(), "a clamp has 1 … %zu ports, not %zu", kMostPorts,
                  ports == nullptr ? 0 : count);
    return false;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const palpate_port& port = ports[i];
    struct Field {
      const char* name;
      double value;
    };
    for (const auto& [name, value] :
         {Field{"viscous", port.viscous}, Field{"coulomb", port.coulomb},
          Field{"resolution", port.resolution}, Field{"v_max", port.v_max},
          Field{"peak_effort", port.peak_effort}}) {
      if (is_not_negative(value)) continue;
      std::snprintf(text.data(), text.size(), "port %zu: %s = %g: must be 0 or above, at most 1e9",
                    i, name, value);
      return false;
    }
    if (port.v_max > 0.0) continue;
    std::snprintf(text.data(), text.size(),
                  "port %zu: v_max = 0: must be above 0, the fastest that the hand ever is", i);
    return false;
  }
  return true;
}

}  // namespace

struct palpate_ports {
  PortGuardParameters parameters{};
  PortValues peak_effort{};
  PortGuard guard;
  std::array<PortStretch, kMostStretches> stretches{};
  bool is_next_a_gap = false;
  Text text{};  // what was refused last

  void begin_anew() noexcept {
    guard = PortGuard(raised_for_one_hold(parameters, peak_effort));
    is_next_a_gap = false;
  }
};

int palpate_ports_check(const palpate_port* ports, size_t count, char* error, size_t size) {
  Text text{};
  const bool is_good = are_good(ports, count, text);
  if (error != nullptr && size > 0) std::snprintf(error, size, "%s", text.data());
  return is_good ? 1 : 0;
}

const char* palpate_ports_error(const palpate_ports* ports) {
  return ports == nullptr ? "no clamp" : ports->text.data();
}

palpate_ports* palpate_ports_create(const palpate_port* ports, size_t count) {
  Text text{};
  if (!are_good(ports, count, text)) return nullptr;
  // no command outlives lease_s unless longest_lease_s says so
  PortGuardParameters parameters{.count = count, .times = {.hold_s = 0.002}};
  PortValues peak_effort{};
  for (std::size_t i = 0; i < count; ++i) {
    const palpate_port& port = ports[i];
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
  Text& text = ports->text;
  text.front() = '\0';
  for (const Setting& known : kSettings) {
    if (std::string_view(known.name) != setting) continue;
    if (!is_not_negative(value) || (value == 0.0 && !known.is_zero_allowed)) {
      std::snprintf(text.data(), text.size(), "%s = %g: must be %s 0, at most 1e9", setting, value,
                    known.is_zero_allowed ? "at least" : "above");
      return PALPATE_OUT_OF_RANGE;
    }
    known.of(ports->parameters) = value;
    ports->begin_anew();
    return PALPATE_OK;
  }
  int end = std::snprintf(text.data(), text.size(), "%.40s: there is no such setting; there are",
                          setting);
  for (const Setting& known : kSettings) {
    end += std::snprintf(text.data() + end, text.size() - static_cast<std::size_t>(end), " %s",
                         known.name);
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
  ports->text.front() = '\0';
  if (!has_stretches) std::snprintf(ports->text.data(), ports->text.size(), "input is NULL");
  if (!has_stretches || !is_plausible(*input, used, ports->text)) {
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
