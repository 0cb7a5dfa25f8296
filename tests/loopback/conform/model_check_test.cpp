// SPDX-License-Identifier: Apache-2.0
// Contact models that are not those of the answers: each fault is named, on answers that are
// computed here, and right ones pass.
#include "deploy/conform/model_check.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "common/contact/contact_model.h"

namespace palpate {
namespace {

constexpr double kStiffness = 400.0;
constexpr double kDamping = 1.0;
constexpr double kDepth_m = 5e-3;

using Falsify = std::function<void(Interaction&, Contact&)>;

/// The answer of a soft half-space below z = 0.
AnsweredPlace place_at(double t_s, const Vector3& position_m, const Vector3& velocity_m_per_s,
                       bool is_hunt_crossley, const Falsify& falsify) {
  auto answer = std::make_shared<Interaction>();
  answer->tool_position_world_m = position_m;
  answer->listed_count = 1;
  Contact& contact = answer->contacts[0];
  contact.penetration_m = -position_m.z();
  contact.elastic_force_on_tool_newton = Vector3(0, 0, -kStiffness * position_m.z());
  contact.d_force_d_position = Vector3(0, 0, -kStiffness).asDiagonal();
  contact.d_force_d_velocity = Vector3(0, 0, -kDamping).asDiagonal();
  contact.trust_radius_m = 0.02;
  if (is_hunt_crossley) {
    contact.hunt_crossley_exponent = 1.5;
    contact.hunt_crossley_depth_m = kDepth_m;
    contact.hunt_crossley_stiffness_newton_per_m = kStiffness;
    contact.hunt_crossley_damping_newton_s_per_m = kDamping;
  }
  const Vector3 force =
      evaluate(contact, Vector3::Zero(), velocity_m_per_s, 0.0).force_on_tool_newton;
  contact.force_on_tool_newton = answer->force_on_tool_newton = force;
  answer->contact_count = contact.penetration_m > 0.0 ? 1 : 0;
  falsify(*answer, contact);
  const TimePoint at{from_seconds(t_s)};
  return {.received_at = at,
          .sampled_at = at,
          .position_m = position_m,
          .velocity_m_per_s = velocity_m_per_s,
          .force_newton = answer->force_on_tool_newton,
          .answer = answer};
}

/// Down from 5 mm above, a slide, and up again, at 500 Hz.
std::vector<AnsweredPlace> press(bool is_hunt_crossley, const Falsify& falsify) {
  std::vector<AnsweredPlace> trace;
  const auto position_m = [](double t_s) {
    const auto share = [](double s) {
      return 0.5 - 0.5 * std::cos(std::numbers::pi * std::clamp(s, 0.0, 1.0));
    };
    return Vector3(6e-3 * share((t_s - 0.3) / 0.3), 0.0,
                   kDepth_m - 2.0 * kDepth_m * (share(t_s / 0.3) - share((t_s - 0.6) / 0.3)));
  };
  for (double t_s = 0.0; t_s < 0.9; t_s += 2e-3) {
    const Vector3 velocity = (position_m(t_s + 1e-5) - position_m(t_s)) / 1e-5;
    trace.push_back(place_at(t_s, position_m(t_s), velocity, is_hunt_crossley, falsify));
  }
  return trace;
}
std::vector<AnsweredPlace> rest(const Falsify& falsify) {
  std::vector<AnsweredPlace> trace;
  for (double t_s = 0.0; t_s < 0.2; t_s += 2e-3) {
    trace.push_back(place_at(t_s, {0, 0, -kDepth_m}, Vector3::Zero(), false, falsify));
  }
  return trace;
}

/// Empty: nothing is wrong.
std::string problem_of(bool is_hunt_crossley, const Falsify& falsify) {
  ModelCheck check;
  check.add(press(is_hunt_crossley, falsify));
  if (!is_hunt_crossley) check.add_rest(rest(falsify));
  return check.contacts_problem() + check.model_problem();
}

/// Only what the model says, not the force that acts.
Falsify slope(double factor) {
  return [factor](Interaction&, Contact& contact) { contact.d_force_d_position *= factor; };
}

TEST(ModelCheck, RightModelsPass) {
  const Falsify nothing = [](Interaction&, Contact&) {};
  EXPECT_EQ(problem_of(false, nothing), "");
  EXPECT_EQ(problem_of(true, nothing), "");
  // 2 times: what an engine with a coarse model may say
  EXPECT_EQ(problem_of(false, slope(2.0)), "");
  EXPECT_EQ(problem_of(false, slope(0.5)), "");
  // an engine that knows a force only
  EXPECT_EQ(problem_of(false, [](Interaction& a, Contact&) { a.listed_count = 0; }), "");
}

TEST(ModelCheck, EachFaultOfAModelIsNamed) {
  const std::map<std::string, Falsify> faults{
      {"slope x4", slope(4.0)},
      {"slope x0.25", slope(0.25)},
      {"slope x0.001", slope(0.001)},
      {"slope 0", slope(0.0)},
      {"slope reversed", slope(-1.0)},
      {"penetration in mm", [](auto&, Contact& c) { c.penetration_m *= 1e3; }},
      {"penetration in km", [](auto&, Contact& c) { c.penetration_m *= 1e-3; }},
      {"elastic force x5", [](auto&, Contact& c) { c.elastic_force_on_tool_newton *= 5.0; }},
      {"contact force x10", [](auto&, Contact& c) { c.force_on_tool_newton *= 10.0; }},
      {"total x2", [](Interaction& a, auto&) { a.force_on_tool_newton *= 2.0; }},
      {"total pulls, no contact touches",
       [](Interaction& a, Contact& c) {
         if (c.penetration_m < 0.0) a.force_on_tool_newton.z() = -0.4;
       }},
      {"pulls above the surface",
       [](Interaction& a, Contact& c) {
         c.is_adhesive = true;
         if (c.penetration_m > 0.0 || c.penetration_m < -2e-3) return;
         a.force_on_tool_newton.z() = c.force_on_tool_newton.z() = -0.4;
       }},
      {"stiffening", [](auto&, Contact& c) { c.stiffening_newton_per_m2 = -1e6; }},
      {"damping x100", [](auto&, Contact& c) { c.d_force_d_velocity *= 100.0; }},
      {"damping that drives", [](auto&, Contact& c) { c.d_force_d_velocity *= -30.0; }},
      {"normal at 90°", [](auto&, Contact& c) { c.normal_world = Vector3::UnitX(); }},
      {"normal reversed", [](auto&, Contact& c) { c.normal_world = -Vector3::UnitZ(); }},
      {"surface velocity",
       [](auto&, Contact& c) { c.surface_velocity_world_m_per_s = Vector3(0, 0, 5); }},
      {"trust radius of 1 nm", [](auto&, Contact& c) { c.trust_radius_m = 1e-9; }}};
  for (const auto& [fault, falsify] : faults) EXPECT_NE(problem_of(false, falsify), "") << fault;
}

TEST(ModelCheck, EachFaultOfAHuntCrossleyModelIsNamed) {
  const std::map<std::string, Falsify> faults{
      {"stiffness x4", [](auto&, Contact& c) { c.hunt_crossley_stiffness_newton_per_m *= 4.0; }},
      {"stiffness x0.25",
       [](auto&, Contact& c) { c.hunt_crossley_stiffness_newton_per_m *= 0.25; }},
      {"penetration in mm", [](auto&, Contact& c) { c.penetration_m *= 1e3; }},
      {"damping x100", [](auto&, Contact& c) { c.hunt_crossley_damping_newton_s_per_m *= 100.0; }},
      {"total x2", [](Interaction& a, auto&) { a.force_on_tool_newton *= 2.0; }}};
  for (const auto& [fault, falsify] : faults) EXPECT_NE(problem_of(true, falsify), "") << fault;
}

}  // namespace
}  // namespace palpate
