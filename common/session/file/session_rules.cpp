// SPDX-License-Identifier: Apache-2.0
#include "common/session/file/session_rules.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include "common/core/tissue.h"

namespace palpate {

namespace {

constexpr double kMaxNumber = 1e9;
constexpr double kMaxSeconds = 1e6;

/// Largest value of a quantity that a session may give: beyond it a number is a mistake, and hop 1
/// or hop 3 would refuse what follows from it. Infinite for other units.
double most_in(const std::string& unit) {
  if (unit == "m") return 10.0;
  if (unit == "N") return 1e3;
  if (unit == "rad") return 1e6;
  if (unit == "N/m") return kMaxStiffnessNewtonPerM;
  if (unit == "N·s/m") return kMaxDampingNewtonSPerM;
  if (unit == "N/m³") return kMaxStiffeningNewtonPerM3;
  return std::numeric_limits<double>::infinity();
}

/// Seconds in one unit of time; 0 for any other unit.
double seconds_in(const std::string& unit) {
  if (unit == "µs") return 1e-6;
  if (unit == "ms") return 1e-3;
  if (unit == "s") return 1.0;
  return 0.0;
}

std::string with_remedy(const std::string& complaint, const v1::FieldRule& rule) {
  return rule.remedy().empty() ? complaint : complaint + "; " + rule.remedy();
}

}  // namespace

const v1::FieldRule& rule_of(const google::protobuf::FieldDescriptor& field) {
  return field.options().GetExtension(v1::rule);
}

std::string range_text(const v1::FieldRule& rule) {
  if (rule.has_min() && rule.has_max()) return shown(rule.min()) + " … " + shown(rule.max());
  if (rule.has_min()) return "≥ " + shown(rule.min());
  if (rule.has_above() && rule.has_max()) {
    return "> " + shown(rule.above()) + ", ≤ " + shown(rule.max());
  }
  if (rule.has_above()) return "> " + shown(rule.above());
  return {};
}

std::string range_complaint(const v1::FieldRule& rule, double value) {
  const bool is_allowed = (!rule.has_min() || value >= rule.min()) &&
                          (!rule.has_above() || value > rule.above()) &&
                          (!rule.has_max() || value <= rule.max());
  if (!is_allowed) return with_remedy("must be " + range_text(rule), rule);
  const double most = most_in(rule.unit());
  if (std::abs(value) <= most) return {};
  return "must be within ±" + shown(most) + " " + rule.unit() + "; mind the unit in the name";
}

std::string number_complaint(const google::protobuf::FieldDescriptor& field, double value) {
  if (!std::isfinite(value)) return "must be a finite number";
  if (std::abs(value) > kMaxNumber) return "must be within ±1e9; mind the unit in the name";
  if (std::abs(value) * seconds_in(rule_of(field).unit()) > kMaxSeconds) {
    return "must be within ±1e6 s; mind the unit in the name";
  }
  return {};
}

std::string required_complaint(const v1::FieldRule& rule) { return with_remedy("required", rule); }

std::string choices_text(const google::protobuf::EnumDescriptor& type) {
  std::string text;
  for (int i = 1; i < type.value_count(); ++i) {
    if (i > 1) text += i + 1 == type.value_count() ? " or " : ", ";
    text += type.value(i)->name();
  }
  return text;
}

std::string shown(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.9g", value);
  return text.data();
}

}  // namespace palpate
