#include "common/session/file/session_rules.h"

#include <array>
#include <cmath>
#include <cstdio>

namespace palpate {

namespace {

constexpr double kMaxNumber = 1e9;
constexpr double kMaxSeconds = 1e6;

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
  if (rule.has_above()) return "> " + shown(rule.above());
  return {};
}

std::string range_complaint(const v1::FieldRule& rule, double value) {
  const bool is_allowed = (!rule.has_min() || value >= rule.min()) &&
                          (!rule.has_above() || value > rule.above()) &&
                          (!rule.has_max() || value <= rule.max());
  return is_allowed ? "" : with_remedy("must be " + range_text(rule), rule);
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
