#include "common/session/session_fields.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/text_format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "common/core/check.h"

namespace palpate {

namespace {

namespace pb = google::protobuf;

constexpr double kShortestDirection = 1e-6;

std::string rule_of(const Range& range) {
  if (std::isfinite(range.max)) {
    return "must be " + shown(range.min) + " … " + shown(range.max);
  }
  return std::string("must be ") + (range.is_min_allowed ? "≥ " : "> ") + shown(range.min);
}

std::string with_remedy(const std::string& rule, const char* remedy) {
  return *remedy == '\0' ? rule : rule + "; " + remedy;
}

}  // namespace

const pb::FieldDescriptor* Fields::field(const char* name) const {
  const pb::FieldDescriptor* field = message_->GetDescriptor()->FindFieldByName(name);
  PALPATE_REQUIRE(field != nullptr);
  return field;
}

bool Fields::has(const char* name) const {
  return message_->GetReflection()->HasField(*message_, field(name));
}

Fields Fields::message(const char* name) const {
  return {*text_, *problems_, message_->GetReflection()->GetMessage(*message_, field(name)),
          path(name)};
}

std::vector<Fields> Fields::messages(const char* name) const {
  const pb::Reflection& reflection = *message_->GetReflection();
  const pb::FieldDescriptor* list = field(name);
  std::vector<Fields> result;
  for (int i = 0; i < reflection.FieldSize(*message_, list); ++i) {
    result.push_back(Fields(*text_, *problems_, reflection.GetRepeatedMessage(*message_, list, i),
                            child_path(path_, name, i)));
  }
  return result;
}

std::string Fields::given_member(const char* oneof) const {
  const pb::OneofDescriptor* descriptor = message_->GetDescriptor()->FindOneofByName(oneof);
  PALPATE_REQUIRE(descriptor != nullptr);
  const pb::FieldDescriptor* given =
      message_->GetReflection()->GetOneofFieldDescriptor(*message_, descriptor);
  return given == nullptr ? "" : given->name();
}

double Fields::number(const char* name, double fallback, const Range& range,
                      const char* remedy) const {
  if (!has(name)) return fallback;
  const double value = message_->GetReflection()->GetDouble(*message_, field(name));
  // SessionText::check_numbers told of it
  if (!number_complaint(name, value).empty()) return kNaN;
  if (value < range.min || value > range.max || (value == range.min && !range.is_min_allowed)) {
    problem(name, with_remedy(rule_of(range), remedy));
    return kNaN;
  }
  return value;
}

double Fields::required_number(const char* name, const Range& range, const char* remedy) const {
  if (!has(name)) problem(name, with_remedy("required", remedy));
  return number(name, kNaN, range, remedy);
}

std::int64_t Fields::integer(const char* name, std::int64_t fallback, std::int64_t min,
                             std::int64_t max, const char* remedy) const {
  if (!has(name)) return fallback;
  const pb::FieldDescriptor* given = field(name);
  const pb::Reflection& reflection = *message_->GetReflection();
  const std::int64_t value = given->cpp_type() == pb::FieldDescriptor::CPPTYPE_INT32
                                 ? reflection.GetInt32(*message_, given)
                                 : std::int64_t{reflection.GetUInt32(*message_, given)};
  if (value < min || value > max) {
    problem(name,
            with_remedy("must be " + std::to_string(min) + " … " + std::to_string(max), remedy));
    return fallback;
  }
  return value;
}

bool Fields::flag(const char* name) const {
  return message_->GetReflection()->GetBool(*message_, field(name));
}

std::string Fields::text(const char* name) const {
  return message_->GetReflection()->GetString(*message_, field(name));
}

Vector3 Fields::vector(const char* name, const Vector3& fallback, const Range& range,
                       const char* remedy) const {
  if (!has(name)) return fallback;
  const Fields v = message(name);
  return {v.number("x", 0.0, range, remedy), v.number("y", 0.0, range, remedy),
          v.number("z", 0.0, range, remedy)};
}

Vector3 Fields::direction(const char* name, const Vector3& fallback) const {
  const Vector3 given = vector(name, fallback);
  if (given.norm() < kShortestDirection) {
    problem(name, "has no direction; give x, y, z, not all 0");
    return Vector3::Constant(kNaN);
  }
  return given.normalized();
}

void Fields::problem(const char* name, const std::string& rule) const {
  std::string value;
  if (has(name)) {
    pb::TextFormat::Printer printer;
    printer.SetSingleLineMode(true);
    printer.PrintFieldValueToString(*message_, field(name), -1, &value);
    if (field(name)->cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE) {
      value = "{ " + value + "}";
    }
    value = " = " + one_line(value);
  }
  problems_->add(place(name), written_path(name) + value + ": " + rule);
}

void Fields::problem(const std::string& rule) const {
  problems_->add(text_->place(path_), text_->written_path(path_) + ": " + rule);
}

Duration seconds(double s) {
  if (!(s > 0.0)) return Duration::zero();
  return std::max(from_seconds(s), Duration(1));  // what is above 0 stays so
}
Duration milliseconds(double ms) { return seconds(ms * 1e-3); }
Duration microseconds(double us) { return seconds(us * 1e-6); }

std::string shown(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.9g", value);
  return text.data();
}

}  // namespace palpate
