// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/model_check.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "common/contact/contact_model.h"

namespace palpate {
namespace {

constexpr double kSameNewton = 0.05;  // and 10 % of the force
constexpr double kSameRatio = 0.1;
constexpr std::size_t kSeveral = 5;       // answers that are wrong: no accident
constexpr double kSeenNewton = 0.2;       // of a force whose direction and depth are judged
constexpr double kLeastAlong = 0.3;       // cosine of normal and force, without friction
constexpr double kMostDepthRatio = 10.0;  // of stiffness · depth and the elastic force
constexpr std::array kSpans_m{0.3e-3, 1e-3};
constexpr double kLongestSpan_s = 0.1;
constexpr double kLeastNewton = 0.02;  // of a change that is judged, and 3 % of the force
constexpr double kLeastChange = 0.03;
constexpr double kAlong = 0.7;      // cosine of motion and force: into the tissue, or out of it
constexpr double kMostError = 0.7;  // a model 3.3 times too stiff or too soft
constexpr double kMostErrorAcross = 1.2;  // to hold the force is allowed: 1
constexpr double kLeastTrust_m = 0.05e-3;
constexpr std::size_t kRestSpan = 20;  // motions

double tolerance_newton(const Vector3& force_newton) {
  return kSameNewton + kSameRatio * force_newton.norm();
}

std::string text_of(const Vector3& v) {
  return fmt::format("({:.3g}, {:.3g}, {:.3g}) N", v.x(), v.y(), v.z());
}

/// As far as each contact is trusted.
double trust_m(const Interaction& answer) {
  double trust_m = std::numeric_limits<double>::infinity();
  for (std::uint32_t i = 0; i < answer.listed_count; ++i) {
    trust_m = std::min(trust_m, answer.contacts[i].trust_radius_m);
  }
  return trust_m;
}

/// Three in four are larger.
double quartile_of(std::vector<double> values) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 4);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

Vector3 predicted_newton(const AnsweredPlace& from, const AnsweredPlace& to) {
  return evaluate(*from.answer, to.position_m, to.velocity_m_per_s,
                  std::max(0.0, to_seconds(to.sampled_at - from.sampled_at)))
      .force_on_tool_newton;
}

}  // namespace

void ModelCheck::Fault::note(double by_newton, std::string what) {
  ++count;
  if (by_newton <= newton) return;
  newton = by_newton;
  text = std::move(what);
}

void ModelCheck::judge_contact(const Contact& contact, const AnsweredPlace& place) {
  const Vector3& n = contact.normal_world;
  const Vector3& force = contact.force_on_tool_newton;
  const Vector3 law =
      evaluate(contact, Vector3::Zero(), place.velocity_m_per_s, 0.0).force_on_tool_newton;
  const double off = (law - force).norm();
  if (off > tolerance_newton(force)) {
    law_.note(off, "a contact has a force of " + text_of(force) + " by its force_on_tool_newton, " +
                       text_of(law) + " by its law");
  }
  if (contact.penetration_m <= 0.0 || contact.is_adhesive || force.norm() < kSeenNewton) return;
  ++touches_;
  const double along = kLeastAlong / std::hypot(1.0, contact.friction_coefficient);
  if (std::abs(n.dot(force)) < along * force.norm()) ++across_count_;
  const double stiffness = -n.dot(contact.d_force_d_position * n);
  const double elastic = n.dot(contact.elastic_force_on_tool_newton);
  const bool has_own_depth = contact.hunt_crossley_exponent > 0.0 || contact.relaxed_m != 0.0;
  if (has_own_depth || elastic < kSeenNewton) return;
  surface_newton_ += stiffness * contact.penetration_m;
  elastic_newton_ += elastic;
}

void ModelCheck::judge_parts(const AnsweredPlace& place) {
  const Interaction& answer = *place.answer;
  Vector3 sum = Vector3::Zero();
  double most_outward = -std::numeric_limits<double>::infinity();
  bool is_adhesive = false;
  for (std::uint32_t i = 0; i < answer.listed_count; ++i) {
    const Contact& contact = answer.contacts[i];
    sum += contact.force_on_tool_newton;
    judge_contact(contact, place);
    if (contact.penetration_m <= 0.0) continue;
    most_outward = std::max(most_outward, place.force_newton.dot(contact.normal_world));
    is_adhesive = is_adhesive || contact.is_adhesive;
  }
  const bool is_all_listed = answer.contact_count <= answer.listed_count;
  const double off = (sum - place.force_newton).norm();
  if (answer.listed_count > 0 && is_all_listed && off > tolerance_newton(place.force_newton)) {
    sum_.note(off, "force_on_tool_newton is " + text_of(place.force_newton) +
                       ", the forces of its contacts sum to " + text_of(sum));
  }
  const double against = std::isfinite(most_outward) && !is_adhesive ? -most_outward : 0.0;
  if (against > tolerance_newton(place.force_newton)) {
    against_.note(against,
                  fmt::format("the force pulls against every contact, by {:.3g} N", against));
  }
}

void ModelCheck::predict(const std::vector<AnsweredPlace>& trace, double span_m) {
  for (std::size_t i = 0, j = 0; i < trace.size(); ++i) {
    const AnsweredPlace& from = trace[i];
    for (j = std::max(i, j); j < trace.size(); ++j) {
      if ((trace[j].position_m - from.position_m).norm() >= span_m) break;
    }
    if (j == trace.size()) break;
    const AnsweredPlace& to = trace[j];
    const Vector3 moved_m = to.position_m - from.position_m;
    if (from.answer->listed_count == 0 || moved_m.norm() > trust_m(*from.answer)) continue;
    if (to_seconds(to.sampled_at - from.sampled_at) > kLongestSpan_s) continue;
    const Vector3 told = predicted_newton(from, to);
    const Vector3 force = from.force_newton + to.force_newton;
    const double change =
        std::max((to.force_newton - from.force_newton).norm(), (told - from.force_newton).norm());
    if (change < kLeastNewton + kLeastChange * from.force_newton.norm()) continue;
    const double along = moved_m.dot(force) / (moved_m.norm() * std::max(force.norm(), 1e-9));
    errors_[along < -kAlong  ? kInwards
            : along > kAlong ? kOutwards
                             : kAcross]
        .push_back((told - to.force_newton).norm() / change);
  }
}

void ModelCheck::add(const std::vector<AnsweredPlace>& trace) {
  for (const AnsweredPlace& place : trace) {
    judge_parts(place);
    if (place.answer->contact_count > 0) trusts_m_.push_back(trust_m(*place.answer));
  }
  for (const double span_m : kSpans_m) predict(trace, span_m);
}

double ModelCheck::error(Direction direction) const {
  const std::vector<double>& errors = errors_[direction];
  return errors.size() < kSeveral ? 0.0 : quartile_of(errors);
}

std::string ModelCheck::model_problem() const {
  if (!rest_problem_.empty()) return rest_problem_;
  const double trust = trusts_m_.size() < kSeveral ? 1.0 : quartile_of(trusts_m_);
  if (trust < kLeastTrust_m) {
    return fmt::format(
        "the contacts are trusted for {:.2g} mm only: less than the tool moves until "
        "the next answer arrives",
        1e3 * trust);
  }
  constexpr std::array kNames{"into the tissue", "out of it", "along it"};
  constexpr std::array kMost{kMostError, kMostError, kMostErrorAcross};
  for (const Direction direction : {kInwards, kOutwards, kAcross}) {
    if (error(direction) <= kMost[direction]) continue;
    return fmt::format(
        "of the changes of the force that the contacts predict as the tool moves {}, three in four "
        "are wrong by {:.0f} % or more",
        kNames[direction], 100.0 * error(direction));
  }
  return {};
}

bool ModelCheck::is_compared() const {
  return std::any_of(errors_.begin(), errors_.end(),
                     [](const auto& errors) { return errors.size() >= kSeveral; });
}

void ModelCheck::add_rest(const std::vector<AnsweredPlace>& trace) {
  Fault fault;
  for (std::size_t i = 0; i < trace.size(); ++i) {
    judge_parts(trace[i]);
    if (i < kRestSpan || trace[i - kRestSpan].answer->listed_count == 0) continue;
    const Vector3 told = predicted_newton(trace[i - kRestSpan], trace[i]);
    const double off = (told - trace[i].force_newton).norm();
    if (off < tolerance_newton(trace[i].force_newton)) continue;
    fault.note(off,
               fmt::format("the contacts predict a change of {:.3g} N on a tool at rest", off));
  }
  if (fault.count >= kSeveral) rest_problem_ = fault.text;
}

std::string ModelCheck::contacts_problem() const {
  for (const Fault* fault : {&against_, &sum_, &law_}) {
    if (fault->count >= kSeveral) return fault->text;
  }
  if (touches_ >= kSeveral && 2 * across_count_ > touches_) {
    return "the forces of the contacts are across their normals";
  }
  if (elastic_newton_ == 0.0) return {};
  const double ratio = surface_newton_ / elastic_newton_;
  if (ratio < kMostDepthRatio && ratio > 1.0 / kMostDepthRatio) return {};
  return fmt::format("penetration times stiffness is {:.2g} times the elastic force", ratio);
}

}  // namespace palpate
