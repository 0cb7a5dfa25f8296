// SPDX-License-Identifier: Apache-2.0
// The clamp for ports through the C interface.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "mofc_node/controllers/named/palpate_controllers.h"
#include "mofc_node/controllers/ports/port_guard.h"
#include "tests/support/alloc_guard.h"

namespace palpate::test {
namespace {

using controllers::PortGuard;
using controllers::PortGuardParameters;
using controllers::PortInput;
using controllers::PortOutput;
using controllers::PortStretch;
using controllers::PortValues;

struct Destroy {
  void operator()(palpate_ports* ports) const { palpate_ports_destroy(ports); }
};
using Made = std::unique_ptr<palpate_ports, Destroy>;

constexpr std::array<palpate_port, 3> kPorts{palpate_port{.viscous = 0.02,
                                                          .coulomb = 0.05,
                                                          .resolution = 1.6e-3,
                                                          .v_max = 5.0,
                                                          .peak_effort = 2.0,
                                                          .priority = 1},
                                             palpate_port{.viscous = 0.1,
                                                          .coulomb = 0.1,
                                                          .resolution = 55e-6,
                                                          .v_max = 0.5,
                                                          .peak_effort = 3.3,
                                                          .priority = 0},
                                             palpate_port{.viscous = 0.0,
                                                          .coulomb = 0.0,
                                                          .resolution = 0.0,
                                                          .v_max = 1.0,
                                                          .peak_effort = 0.0,
                                                          .priority = 1}};

Made create() { return Made(palpate_ports_create(kPorts.data(), kPorts.size())); }

PortGuardParameters parameters() {
  PortGuardParameters p{.count = 3,
                        .times = {.hold_s = 0.003, .delta_max_s = 1e-4, .longest_lease_s = 0.01},
                        .credit_cap_joule = 2e-3,
                        .gate_joule = 5e-3,
                        .gate_recovery_s = 0.2};
  PortValues peak{};
  for (std::size_t i = 0; i < 3; ++i) {
    p.ports[i] = {.f_d = kPorts[i].viscous,
                  .f_co = kPorts[i].coulomb,
                  .q = kPorts[i].resolution,
                  .v_max = kPorts[i].v_max,
                  .priority = kPorts[i].priority};
    peak[i] = kPorts[i].peak_effort;
  }
  return raised_for_one_hold(p, peak);
}

double shaking(int k, std::size_t i) {
  return kPorts[i].v_max *
         (2e-3 * std::cos(0.05 * k + static_cast<double>(i)) + 1e-3 * std::sin(0.31 * k));
}

palpate_port_input input_at(int k, palpate_port_stretch& last) {
  palpate_port_input input{};
  last.duration_s = 0.001;
  last.is_end_unknown = k % 17 == 16 ? 1 : 0;
  for (std::size_t i = 0; i < 3; ++i) {
    last.position_at_end[i] = input.position[i] = shaking(k, i);
    input.acting_effort_on_hand[i] = last.effort_on_hand[i];
    input.requested_effort_on_hand[i] =
        k / 40 % 2 == 0 ? -800.0 * shaking(k, i) / kPorts[i].v_max : 0.01 * kPorts[i].coulomb;
  }
  input.applied = &last;
  input.applied_count = k > 0 ? 1 : 0;
  input.has_gap = k % 97 == 96 ? 1 : 0;
  input.acting_lease_s = 0.004;
  input.is_request_held = k % 2;
  input.stored_energy_joule = 1e-3;
  return input;
}

TEST(PortCInterface, AnswersAsTheClassDoes) {
  const Made handle = create();
  ASSERT_NE(handle, nullptr);
  for (const auto& [name, value] :
       std::vector<std::pair<const char*, double>>{{"lease_s", 0.003},
                                                   {"delta_max_s", 1e-4},
                                                   {"longest_lease_s", 0.01},
                                                   {"credit_cap_joule", 2e-3},
                                                   {"gate_joule", 5e-3},
                                                   {"gate_recovery_s", 0.2}}) {
    ASSERT_EQ(palpate_ports_set(handle.get(), name, value), PALPATE_OK) << name;
  }
  PortGuard guard(parameters());
  palpate_port_stretch last{};
  PortStretch stretch;
  double largest = 0.0;
  int clamped = 0;
  for (int k = 0; k < 400; ++k) {
    const palpate_port_input in = input_at(k, last);
    PortInput input;
    stretch.duration_s = last.duration_s;
    stretch.has_position_at_end = last.is_end_unknown == 0;
    for (std::size_t i = 0; i < 3; ++i) {
      input.position[i] = stretch.position_at_end[i] = in.position[i];
      input.acting_effort_on_hand[i] = stretch.effort_on_hand[i] = last.effort_on_hand[i];
      input.requested_effort_on_hand[i] = in.requested_effort_on_hand[i];
    }
    if (k > 0) input.applied = {&stretch, 1};
    input.has_gap = in.has_gap != 0;
    input.acting_lease_s = in.acting_lease_s;
    input.is_request_fresh = in.is_request_held == 0;
    input.stored_energy_joule = in.stored_energy_joule;
    const PortOutput expected = guard.step(input);
    palpate_port_output out{};
    ASSERT_EQ(palpate_ports_step(handle.get(), &in, &out), PALPATE_OK);
    for (std::size_t i = 0; i < controllers::kMostPorts; ++i) {
      ASSERT_EQ(out.effort_on_hand[i], expected.effort_on_hand[i]) << k;
      ASSERT_EQ(out.most_effort[i], expected.most_effort[i]) << k;
      last.effort_on_hand[i] = out.effort_on_hand[i];
    }
    ASSERT_EQ(out.ledger_energy_joule, expected.ledger_energy_joule);
    ASSERT_EQ(out.lease_s, expected.lease_s);
    ASSERT_EQ(out.begins_within_s, expected.begins_within_s);
    ASSERT_EQ(out.is_clamped != 0, expected.is_clamped);
    ASSERT_EQ(out.is_too_fast != 0, expected.is_too_fast);
    largest = std::max(largest, std::abs(out.effort_on_hand[0]));
    clamped += out.is_clamped;
  }
  EXPECT_GT(largest, 4.0 * kPorts[0].coulomb);
  EXPECT_GT(clamped, 10);
  EXPECT_LT(clamped, 399);
}

TEST(PortCInterface, RefusesPortsAndSettingsOutOfTheirRange) {
  EXPECT_EQ(palpate_ports_create(nullptr, 1), nullptr);
  EXPECT_EQ(palpate_ports_create(kPorts.data(), 0), nullptr);
  const std::array<palpate_port, 9> many{};
  EXPECT_EQ(palpate_ports_create(many.data(), many.size()), nullptr);
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  for (const double bad : {-1.0, kNaN, std::numeric_limits<double>::infinity()}) {
    for (double palpate_port::*field :
         {&palpate_port::viscous, &palpate_port::coulomb, &palpate_port::resolution,
          &palpate_port::v_max, &palpate_port::peak_effort}) {
      palpate_port port = kPorts[0];
      port.*field = bad;
      EXPECT_EQ(palpate_ports_create(&port, 1), nullptr) << bad;
    }
  }
  palpate_port slow = kPorts[0];
  slow.v_max = 0.0;
  EXPECT_EQ(palpate_ports_create(&slow, 1), nullptr);

  const Made handle = create();
  EXPECT_EQ(palpate_ports_set(handle.get(), "lease_s", 0.0), PALPATE_OUT_OF_RANGE);
  EXPECT_EQ(palpate_ports_set(handle.get(), "lease_s", kNaN), PALPATE_OUT_OF_RANGE);
  EXPECT_EQ(palpate_ports_set(handle.get(), "delta_max_s", 0.0), PALPATE_OK);
  EXPECT_EQ(palpate_ports_set(handle.get(), "delta_max_s", -1.0), PALPATE_OUT_OF_RANGE);
  EXPECT_EQ(palpate_ports_set(handle.get(), "rate_hz", 100.0), PALPATE_UNKNOWN_NAME);
  EXPECT_EQ(palpate_ports_set(nullptr, "lease_s", 1.0), PALPATE_NULL_POINTER);
  EXPECT_EQ(palpate_ports_set(handle.get(), nullptr, 1.0), PALPATE_NULL_POINTER);
  EXPECT_EQ(palpate_ports_reset(nullptr), PALPATE_NULL_POINTER);
  palpate_port_output out{};
  EXPECT_EQ(palpate_ports_step(handle.get(), nullptr, &out), PALPATE_NULL_POINTER);
  const palpate_port_input input{};
  EXPECT_EQ(palpate_ports_step(handle.get(), &input, nullptr), PALPATE_NULL_POINTER);
  EXPECT_EQ(palpate_ports_step(nullptr, &input, &out), PALPATE_NULL_POINTER);
}

TEST(PortCInterface, AReadingThatIsNoNumberGivesNothingAndCostsTheCredit) {
  const Made handle = create();
  palpate_port_stretch last{};
  palpate_port_output out{};
  int k = 0;
  for (; k < 90; ++k) {
    const palpate_port_input input = input_at(k, last);
    ASSERT_EQ(palpate_ports_step(handle.get(), &input, &out), PALPATE_OK);
    std::copy(std::begin(out.effort_on_hand), std::end(out.effort_on_hand), last.effort_on_hand);
  }
  EXPECT_GT(out.ledger_energy_joule, 1e-6);
  palpate_port_input bad = input_at(k, last);
  bad.position[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(palpate_ports_step(handle.get(), &bad, &out), PALPATE_NOT_FINITE);
  EXPECT_EQ(out.effort_on_hand[0], 0.0);
  const palpate_port_input next = input_at(++k, last);
  EXPECT_EQ(palpate_ports_step(handle.get(), &next, &out), PALPATE_OK);
  EXPECT_LE(out.ledger_energy_joule, 0.0);

  // a request that is no number is none, and beyond the last port nothing is read
  palpate_port_input request = input_at(++k, last);
  request.requested_effort_on_hand[1] = std::numeric_limits<double>::infinity();
  EXPECT_EQ(palpate_ports_step(handle.get(), &request, &out), PALPATE_OK);
  EXPECT_EQ(out.effort_on_hand[0], 0.0);
  palpate_port_input beyond = input_at(++k, last);
  beyond.position[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(palpate_ports_step(handle.get(), &beyond, &out), PALPATE_OK);
}

// Not even where it is shorter than the default of 2 ms.
TEST(PortCInterface, NoEffortOutlivesTheLeaseThatIsSet) {
  for (const double lease_s : {0.0005, 0.001, 0.002, 0.004}) {
    const Made handle = create();
    ASSERT_EQ(palpate_ports_set(handle.get(), "lease_s", lease_s), PALPATE_OK);
    palpate_port_output out{};
    const palpate_port_input input{};
    ASSERT_EQ(palpate_ports_step(handle.get(), &input, &out), PALPATE_OK);
    EXPECT_EQ(out.lease_s, lease_s);
    ASSERT_EQ(palpate_ports_set(handle.get(), "longest_lease_s", 0.01), PALPATE_OK);
    ASSERT_EQ(palpate_ports_step(handle.get(), &input, &out), PALPATE_OK);
    EXPECT_EQ(out.lease_s, 0.01);
  }
}

TEST(PortCInterface, WhatIsRefusedIsSaidWithFieldAndRule) {
  std::array<char, 200> text{};
  const auto refusal = [&](const palpate_port& port) {
    EXPECT_EQ(palpate_ports_check(&port, 1, text.data(), text.size()), 0);
    return std::string(text.data());
  };
  palpate_port port = kPorts[0];
  EXPECT_EQ(palpate_ports_check(&port, 1, text.data(), text.size()), 1);
  EXPECT_STREQ(text.data(), "");
  port.coulomb = -0.5;
  EXPECT_EQ(refusal(port), "port 0: coulomb = -0.5: must be 0 or above, at most 1e9");
  port = kPorts[0];
  port.v_max = 0.0;
  EXPECT_EQ(refusal(port), "port 0: v_max = 0: must be above 0, the fastest that the hand ever is");
  EXPECT_EQ(palpate_ports_check(kPorts.data(), 0, text.data(), text.size()), 0);
  EXPECT_STREQ(text.data(), "a clamp has 1 … 8 ports, not 0");
  EXPECT_EQ(palpate_ports_check(&port, 1, nullptr, 0), 0);

  const Made handle = create();
  EXPECT_STREQ(palpate_ports_error(handle.get()), "");
  EXPECT_EQ(palpate_ports_set(handle.get(), "lease_s", 0.0), PALPATE_OUT_OF_RANGE);
  EXPECT_STREQ(palpate_ports_error(handle.get()), "lease_s = 0: must be above 0, at most 1e9");
  EXPECT_EQ(palpate_ports_set(handle.get(), "lease", 1.0), PALPATE_UNKNOWN_NAME);
  EXPECT_EQ(std::string(palpate_ports_error(handle.get())).rfind("lease: there is no such", 0), 0U);
  palpate_port_output out{};
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), 1e308, -2e9}) {
    palpate_port_input input{};
    input.position[1] = bad;
    EXPECT_EQ(palpate_ports_step(handle.get(), &input, &out), PALPATE_NOT_FINITE);
    EXPECT_NE(std::string(palpate_ports_error(handle.get())).find("port 1: position"),
              std::string::npos);
  }
  const palpate_port_input good{};
  EXPECT_EQ(palpate_ports_step(handle.get(), &good, &out), PALPATE_OK);
  EXPECT_STREQ(palpate_ports_error(handle.get()), "");
  EXPECT_STREQ(palpate_ports_error(nullptr), "no clamp");
}

TEST(PortCInterface, MoreThanSixtyFourStretchesAreAGap) {
  for (const std::size_t count : {64U, 65U}) {
    const Made handle = create();
    std::vector<palpate_port_stretch> applied(count);
    for (std::size_t k = 0; k < count; ++k) {
      applied[k].duration_s = 0.01;
      applied[k].position_at_end[1] = 1e-3 * static_cast<double>(k + 1);
    }
    palpate_port_input input{};
    palpate_port_output out{};
    ASSERT_EQ(palpate_ports_step(handle.get(), &input, &out), PALPATE_OK);
    input.position[1] = applied.back().position_at_end[1];
    input.applied = applied.data();
    input.applied_count = count;
    ASSERT_EQ(palpate_ports_step(handle.get(), &input, &out), PALPATE_OK);
    EXPECT_EQ(out.ledger_energy_joule > 1e-3, count == 64) << count;
  }
}

TEST(PortCInterface, AStepAllocatesNothing) {
  const Made handle = create();
  palpate_port_stretch last{};
  palpate_port_output out{};
  const std::uint64_t before = mallocs_of_this_thread();
  for (int k = 0; k < 200; ++k) {
    const palpate_port_input input = input_at(k, last);
    ASSERT_EQ(palpate_ports_step(handle.get(), &input, &out), PALPATE_OK);
    std::copy(std::begin(out.effort_on_hand), std::end(out.effort_on_hand), last.effort_on_hand);
  }
  ASSERT_EQ(palpate_ports_reset(handle.get()), PALPATE_OK);
  EXPECT_EQ(mallocs_of_this_thread() - before, 0U);
}

// One hold of the peak leaks T_hold drain(peak): 3 ms of (2 − 0.05 − 0.02 · 5) 5 and (3.3 − 0.1 −
// 0.1 · 0.5) 0.5 W.
TEST(PortGuardParameters, AreRaisedToOneHoldOfThePeak) {
  const double hold = 0.003 * (1.85 * 5.0 + 3.15 * 0.5);
  const PortGuardParameters p = parameters();
  EXPECT_NEAR(p.contact_credit_joule, hold, 1e-12);
  EXPECT_NEAR(p.credit_cap_joule, 0.25 * hold, 1e-12);
  EXPECT_NEAR(p.gate_joule, hold, 1e-12);
  PortGuardParameters large = p;
  large.credit_cap_joule = large.gate_joule = 1.0;
  large.contact_credit_joule = 0.0;
  large = raised_for_one_hold(large, {2.0, 3.3, 0.0});
  EXPECT_EQ(large.credit_cap_joule, 1.0);
  EXPECT_EQ(large.contact_credit_joule, 0.0);
  EXPECT_EQ(large.gate_joule, 1.0);
  PortGuardParameters contact = p;
  contact.credit_cap_joule = 1e-3;
  contact.contact_credit_joule = 2.0;
  EXPECT_EQ(raised_for_one_hold(contact, {2.0, 3.3, 0.0}).contact_credit_joule, 2.0);
}

}  // namespace
}  // namespace palpate::test
