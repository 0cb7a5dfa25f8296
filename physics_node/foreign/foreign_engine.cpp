// SPDX-License-Identifier: Apache-2.0
#include "physics_node/foreign/foreign_engine.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>
#include <string>
#include <utility>

#include "common/contact/contact_model.h"
#include "physics_node/foreign/look_ahead.h"

namespace palpate::physics {
namespace {

constexpr double kLongest_m = 1e3;

std::string text(double value) {
  std::array<char, 32> digits{};
  const int length = std::snprintf(digits.data(), digits.size(), "%g", value);
  return {digits.data(), static_cast<std::size_t>(length)};
}

[[noreturn]] void refuse(const std::string& what, const std::string& rule) {
  throw std::invalid_argument("answer: " + what + ": must be " + rule + "; mind the SI unit");
}

void check(const std::string& name, double value, double least, double most) {
  if (value >= least && value <= most) return;  // NaN fails
  refuse(name + " = " + text(value), text(least) + " to " + text(most));
}

void check(const std::string& name, const Vector3& value, double most) {
  if ((value.cwiseAbs().array() <= most).all()) return;
  refuse(name + " = " + text(value.x()) + ", " + text(value.y()) + ", " + text(value.z()),
         "finite, each within ±" + text(most));
}

void check(const sdk::Contact& contact, const std::string& name) {
  check(name + "normal", contact.normal, 1.0 + 1e-6);
  if (std::abs(contact.normal.squaredNorm() - 1.0) > 1e-6) {
    refuse(name + "normal, of length " + text(contact.normal.norm()),
           "of length 1: divide it by its length");
  }
  check(name + "penetration_m", contact.penetration_m, -kLongest_m, kLongest_m);
  check(name + "stiffness_newton_per_m", contact.stiffness_newton_per_m.value_or(0.0), 0.0,
        kMaxStiffnessNewtonPerM);
  check(name + "damping_newton_s_per_m", contact.damping_newton_s_per_m, 0.0,
        kMaxDampingNewtonSPerM);
  const Eigen::Matrix3d& curvature = contact.curvature_per_m;
  if (!(curvature.cwiseAbs().array() <= kMaxCurvaturePerM).all() ||
      !curvature.isApprox(curvature.transpose(), 1e-6)) {
    refuse(name + "curvature_per_m", "symmetric and within ±1e9");
  }
  check(name + "surface_velocity_m_per_s", contact.surface_velocity_m_per_s, kMaxTissueSpeedMPerS);
  check(name + "friction_coefficient", contact.friction_coefficient, 0.0, kMaxFrictionCoefficient);
  check(name + "friction_stiffness_newton_per_m", contact.friction_stiffness_newton_per_m, 0.0,
        kMaxStiffnessNewtonPerM);
  check(name + "stretch_m", contact.stretch_m, kLongest_m);
  check(name + "trust_radius_m", contact.trust_radius_m, 1e-9, kLongest_m);
  if (contact.force_on_tool_newton) {
    check(name + "force_on_tool_newton", *contact.force_on_tool_newton, kMaxTissueForceNewton);
  }
}

sdk::Motion motion_of(const ToolMotion& motion, bool is_new, TimePoint now) {
  return {.position_m = motion.tool_position_world_m,
          .orientation = motion.tool_orientation_world,
          .velocity_m_per_s = motion.tool_velocity_world_m_per_s,
          .buttons = motion.buttons,
          .is_new = is_new,
          .time_s = seconds_of(now)};
}

/// The contact model of a tissue whose stiffness is known.
Contact contact_of(const sdk::Contact& given, const Vector3& velocity_m_per_s) {
  const Vector3& n = given.normal;
  const Matrix3 along = n * n.transpose();
  const double k = given.stiffness_newton_per_m.value_or(0.0);
  const double p = given.penetration_m;
  Contact contact{
      .tissue = given.tissue,
      .penetration_m = p,
      .normal_world = n,
      .curvature_per_m = 0.5 * (given.curvature_per_m + given.curvature_per_m.transpose()),
      .surface_velocity_world_m_per_s = given.surface_velocity_m_per_s,
      .elastic_force_on_tool_newton = k * p * n,
      .d_force_d_position = -k * along,
      .d_force_d_velocity = -given.damping_newton_s_per_m * along,
      .stored_energy_joule = 0.5 * k * p * p,
      .trust_radius_m = given.trust_radius_m};
  if (given.friction_coefficient > 0.0) {
    contact.friction_coefficient = given.friction_coefficient;
    contact.friction_stiffness_newton_per_m = given.friction_stiffness_newton_per_m;
    contact.stretch_m = given.stretch_m;
    contact.stored_energy_joule +=
        0.5 * given.friction_stiffness_newton_per_m * given.stretch_m.squaredNorm();
  }
  contact.force_on_tool_newton =
      evaluate(contact, Vector3::Zero(), velocity_m_per_s, 0.0).force_on_tool_newton;
  const std::string name = "contact of tissue " + std::to_string(given.tissue) + ": its ";
  check(name + "force", contact.elastic_force_on_tool_newton, kMaxTissueForceNewton);
  check(name + "force", contact.force_on_tool_newton, kMaxTissueForceNewton);
  check(name + "energy", contact.stored_energy_joule, 0.0, kMaxStoredEnergyJoule);
  return contact;
}

}  // namespace

void MovedSurfaces::reset(const std::vector<sdk::Surface>& surfaces) {
  surfaces_.clear();
  for (const sdk::Surface& surface : surfaces) {
    surfaces_.push_back({.vertices_m = surface.vertices_m, .newest_m = surface.vertices_m});
  }
}

void MovedSurfaces::collect(sdk::Engine& engine) {
  const std::unique_lock lock(mutex_, std::try_to_lock);
  if (!lock || !is_wanted_) return;
  is_wanted_ = false;
  for (std::size_t i = 0; i < surfaces_.size(); ++i) {
    Moved& moved = surfaces_[i];
    const std::size_t count = moved.vertices_m.size();
    if (!engine.deformed(i, moved.vertices_m)) continue;
    if (moved.vertices_m.size() != count) {
      throw std::invalid_argument("deformed: surface " + std::to_string(i) + " has " +
                                  std::to_string(count) + " coordinates, not " +
                                  std::to_string(moved.vertices_m.size()));
    }
    moved.newest_m = moved.vertices_m;
    moved.is_new = true;
  }
}

bool MovedSurfaces::take(std::size_t surface, std::vector<float>& vertices_m) {
  const std::scoped_lock lock(mutex_);
  Moved& moved = surfaces_[surface];
  if (!std::exchange(moved.is_new, false)) return false;
  vertices_m = moved.newest_m;
  return true;
}

ForeignEngine::ForeignEngine(std::unique_ptr<sdk::Engine> engine, bool has_estimate,
                             std::shared_ptr<MovedSurfaces> surfaces)
    : engine_(std::move(engine)), has_estimate_(has_estimate), surfaces_(std::move(surfaces)) {
  estimated_.reserve(kMaxContacts);
}

bool ForeignEngine::step(const ToolMotion& motion, bool is_new, TimePoint now,
                         Interaction& answer) noexcept {
  if (error_) return false;
  try {
    fill(engine_->step(motion_of(motion, is_new, now)), motion, answer);
    if (surfaces_) surfaces_->collect(*engine_);
    return true;
  } catch (...) {
    error_ = std::current_exception();
    return false;
  }
}

void ForeignEngine::rethrow() {
  if (error_) std::rethrow_exception(error_);
}

void ForeignEngine::fill(const sdk::Answer& answer, const ToolMotion& motion, Interaction& out) {
  if (answer.force_on_tool_newton) {
    check("force_on_tool_newton", *answer.force_on_tool_newton, kMaxTissueForceNewton);
  }
  check("stored_energy_joule", answer.stored_energy_joule.value_or(0.0), 0.0,
        kMaxStoredEnergyJoule);
  std::vector<Contact> contacts;
  Vector3 sum = Vector3::Zero();
  for (std::size_t i = 0; i < answer.contacts.size(); ++i) {
    const sdk::Contact& given = answer.contacts[i];
    check(given, "contacts[" + std::to_string(i) + "].");
    if (given.stiffness_newton_per_m) {
      contacts.push_back(contact_of(given, motion.tool_velocity_world_m_per_s));
    } else if (!has_estimate_) {
      sum += given.force_on_tool_newton.value_or(Vector3::Zero());
    }
  }
  if (has_estimate_) estimate(answer, motion, contacts);

  // the deepest first; of more than there is room for, those count that touch
  std::stable_sort(contacts.begin(), contacts.end(), [](const Contact& a, const Contact& b) {
    return a.penetration_m > b.penetration_m;
  });
  double energy_joule = 0.0;
  out.listed_count = 0;
  out.contact_count = 0;
  for (const Contact& contact : contacts) {
    sum += contact.force_on_tool_newton;
    if (contact.penetration_m > 0.0) {
      ++out.contact_count;
      energy_joule += contact.stored_energy_joule;
    }
    if (out.listed_count < kMaxContacts) out.contacts[out.listed_count++] = contact;
  }
  out.force_on_tool_newton = answer.force_on_tool_newton.value_or(sum);
  out.stored_energy_joule =
      answer.stored_energy_joule.value_or(std::min(energy_joule, kMaxStoredEnergyJoule));
  if (!has_estimate_ && contacts.empty()) {
    // held: the contact only says that something is touched
    if (!out.force_on_tool_newton.isZero(0.0)) {
      out.contacts[out.listed_count++] = {.penetration_m = 1.0, .trust_radius_m = 1.0};
      out.contact_count = 1;
    }
  }
}

std::vector<ForeignEngine::Group> ForeignEngine::groups_of(const sdk::Answer& answer,
                                                           const ToolMotion& motion) const {
  std::vector<Group> groups;
  std::vector<Vector3> normals;
  std::size_t without_force = 0;
  bool has_stiffness = false;
  for (const sdk::Contact& given : answer.contacts) {
    if (given.stiffness_newton_per_m) {
      has_stiffness = true;
      continue;
    }
    std::size_t i = 0;
    while (i < groups.size() && groups[i].tissue != given.tissue) ++i;
    if (i == groups.size()) {
      groups.push_back({.tissue = given.tissue, .seen = {}});
      normals.emplace_back(Vector3::Zero());
    }
    Observation& seen = groups[i].seen;
    const Vector3 force = given.force_on_tool_newton.value_or(Vector3::Zero());
    if (!given.force_on_tool_newton) ++without_force;
    seen.force_on_tool_newton += force;
    seen.penetration_m = std::max(seen.penetration_m.value_or(-kLongest_m), given.penetration_m);
    // the harder a point presses, the more its normal counts
    normals[i] += (1e-6 + std::max(0.0, given.penetration_m) + force.norm()) * given.normal;
  }
  const bool is_total = without_force > 0 || (groups.empty() && !has_stiffness);
  if (without_force > 0 && (groups.size() > 1 || has_stiffness || !answer.force_on_tool_newton)) {
    throw std::invalid_argument(
        "answer: a contact has neither stiffness nor force_on_tool_newton; give one of them, or "
        "force_on_tool_newton of the answer where it has contacts of one tissue only");
  }
  if (groups.empty() && !has_stiffness) groups.push_back({.tissue = 0, .seen = {}});
  for (std::size_t i = 0; i < groups.size(); ++i) {
    Observation& seen = groups[i].seen;
    if (is_total) {
      seen.force_on_tool_newton = answer.force_on_tool_newton.value_or(Vector3::Zero());
    }
    if (i < normals.size() && normals[i].norm() > 1e-9) seen.normal = normals[i].normalized();
    seen.position_m = motion.tool_position_world_m;
    seen.velocity_m_per_s = motion.tool_velocity_world_m_per_s;
  }
  return groups;
}

void ForeignEngine::estimate(const sdk::Answer& answer, const ToolMotion& motion,
                             std::vector<Contact>& contacts) {
  std::vector<Group> groups = groups_of(answer, motion);
  const auto add = [&](std::uint32_t tissue, const std::optional<Contact>& contact) {
    if (!contact) return;
    contacts.push_back(*contact);
    contacts.back().tissue = tissue;
  };
  for (const Group& group : groups) {
    const bool is_known =
        std::any_of(estimated_.begin(), estimated_.end(),
                    [&](const Estimated& known) { return known.tissue == group.tissue; });
    if (is_known || estimated_.size() == kMaxContacts) continue;
    estimated_.emplace_back().tissue = group.tissue;
  }
  if (answer.contacts.empty() && estimated_.size() == 1) look(estimated_[0], groups[0].seen);
  for (Estimated& known : estimated_) {
    const auto named = std::find_if(groups.begin(), groups.end(), [&](const Group& group) {
      return group.tissue == known.tissue;
    });
    const Observation untouched{.position_m = motion.tool_position_world_m,
                                .velocity_m_per_s = motion.tool_velocity_world_m_per_s};
    add(known.tissue, known.estimator.step(named != groups.end() ? named->seen : untouched));
  }
}

void ForeignEngine::look(Estimated& tissue, Observation& seen) {
  if (!engine_->force_at(seen.position_m)) return;
  const ForceAt force_at = [this](const Vector3& position_m) -> Vector3 {
    Vector3 force = engine_->force_at(position_m).value_or(Vector3::Zero());
    check("force_at", force, kMaxTissueForceNewton);
    return force;
  };
  if (seen.force_on_tool_newton.isZero(0.0)) {
    const auto ahead = look_ahead(force_at, seen.position_m, seen.velocity_m_per_s);
    if (!ahead) return;
    if (ahead->tissue) {
      tissue.estimator.foresee(*ahead->tissue);
    } else {
      tissue.estimator.foresee_none(ahead->as_far_as_m);
    }
  } else {
    seen.law = law_of(force_at, seen);
  }
}

}  // namespace palpate::physics
