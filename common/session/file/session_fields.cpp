// SPDX-License-Identifier: Apache-2.0
#include "common/session/file/session_fields.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/text_format.h>

#include <algorithm>
#include <cmath>

#include "common/core/check.h"

namespace palpate {

namespace {

namespace pb = google::protobuf;

constexpr double kShortestDirection = 1e-6;

bool has_control_characters(const std::string& text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) <= 0x1f || c == 0x7f; });
}

Vector3 default_vector(const v1::FieldRule& rule) {
  if (rule.default_vector_size() != 3) return Vector3::Zero();
  return {rule.default_vector(0), rule.default_vector(1), rule.default_vector(2)};
}

}  // namespace

const pb::FieldDescriptor* Fields::field(const char* name) const {
  const pb::FieldDescriptor* field = message_->GetDescriptor()->FindFieldByName(name);
  PALPATE_REQUIRE(field != nullptr);
  return field;
}

bool Fields::has(const char* name) const {
  const pb::FieldDescriptor* const given = field(name);
  const pb::Reflection& reflection = *message_->GetReflection();
  return given->is_repeated() ? reflection.FieldSize(*message_, given) > 0
                              : reflection.HasField(*message_, given);
}

bool Fields::has_required(const char* name) const {
  if (has(name)) return true;
  problem(name, required_complaint(rule_of(*field(name))));
  return false;
}

Fields Fields::message(const char* name) const {
  return {*text_, *problems_, message_->GetReflection()->GetMessage(*message_, field(name)),
          path(name)};
}

std::vector<Fields> Fields::messages(const char* name) const {
  const pb::Reflection& reflection = *message_->GetReflection();
  const pb::FieldDescriptor* list = field(name);
  const int size = reflection.FieldSize(*message_, list);
  std::vector<Fields> result;
  result.reserve(static_cast<std::size_t>(size));
  for (int i = 0; i < size; ++i) {
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

double Fields::checked(const char* name, double fallback, const v1::FieldRule& rule) const {
  if (!has(name)) return fallback;
  const double value = message_->GetReflection()->GetDouble(*message_, field(name));
  // SessionText::check_numbers reports these
  if (!number_complaint(*field(name), value).empty()) return kNaN;
  const std::string complaint = range_complaint(rule, value);
  if (complaint.empty()) return value;
  problem(name, complaint);
  return kNaN;
}

double Fields::number(const char* name) const {
  if (rule_of(*field(name)).required()) return required_number(name);
  return number(name, default_number(name));
}

double Fields::number(const char* name, double computed_default) const {
  return checked(name, computed_default, rule_of(*field(name)));
}

double Fields::required_number(const char* name) const {
  return has_required(name) ? number(name, kNaN) : kNaN;
}

double Fields::default_number(const char* name) const {
  return rule_of(*field(name)).default_value();
}

std::int64_t Fields::integer(const char* name) const {
  const pb::FieldDescriptor* given = field(name);
  const v1::FieldRule& rule = rule_of(*given);
  const auto fallback = static_cast<std::int64_t>(rule.default_value());
  if (!has(name)) return fallback;
  const pb::Reflection& reflection = *message_->GetReflection();
  const std::int64_t value = given->cpp_type() == pb::FieldDescriptor::CPPTYPE_INT32
                                 ? reflection.GetInt32(*message_, given)
                                 : std::int64_t{reflection.GetUInt32(*message_, given)};
  const std::string complaint = range_complaint(rule, static_cast<double>(value));
  if (complaint.empty()) return value;
  problem(name, complaint);
  return fallback;
}

int Fields::enumerator(const char* name) const {
  const pb::EnumDescriptor& type = *field(name)->enum_type();
  const int value = message_->GetReflection()->GetEnumValue(*message_, field(name));
  if (type.FindValueByNumber(value) != nullptr) return value;
  problem(name, "must be " + choices_text(type));
  return 0;
}

bool Fields::flag(const char* name) const {
  return message_->GetReflection()->GetBool(*message_, field(name));
}

std::string Fields::text(const char* name) const {
  return message_->GetReflection()->GetString(*message_, field(name));
}

std::vector<std::string> Fields::texts(const char* name) const {
  const pb::Reflection& reflection = *message_->GetReflection();
  const pb::FieldDescriptor* list = field(name);
  const int size = reflection.FieldSize(*message_, list);
  std::vector<std::string> result;
  result.reserve(static_cast<std::size_t>(size));
  for (int i = 0; i < size; ++i) {
    result.push_back(reflection.GetRepeatedString(*message_, list, i));
  }
  return result;
}

std::filesystem::path Fields::file(const char* name, const std::filesystem::path& base_dir) const {
  const std::string file = text(name);
  if (base_dir.empty()) {
    problem(name, "this session has no folder; give it as a file of its own");
  } else if (has_control_characters(file)) {
    problem(name, "must not contain control characters; rename the file");
  } else {
    return base_dir / file;
  }
  return {};
}

Vector3 Fields::vector(const char* name) const {
  const v1::FieldRule& rule = rule_of(*field(name));
  if (rule.required() && !has_required(name)) return Vector3::Constant(kNaN);
  if (!has(name)) return default_vector(rule);
  const Fields v = message(name);
  const auto component = [&](const char* axis) {
    if (!rule.required() || v.has(axis)) return v.checked(axis, 0.0, rule);
    v.problem(axis, required_complaint(rule));
    return kNaN;
  };
  return {component("x"), component("y"), component("z")};
}

Quaternion Fields::rotation(const char* name) const {
  const Vector3 turn = vector(name);
  if (!(turn.norm() > 0.0)) return Quaternion::Identity();
  return Quaternion(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
}

Vector3 Fields::direction(const char* name) const {
  const Vector3 given = vector(name);
  if (given.norm() < kShortestDirection) {
    problem(name, "has no direction; give x, y, z, not all 0");
    return Vector3::Constant(kNaN);
  }
  return given.normalized();
}

Duration Fields::milliseconds(const char* name) const { return to_milliseconds(number(name)); }
Duration Fields::microseconds(const char* name) const { return to_microseconds(number(name)); }

void Fields::problem(const char* name, const std::string& rule) const {
  std::string value;
  if (has(name)) {
    pb::TextFormat::Printer printer;
    printer.SetSingleLineMode(true);
    printer.PrintFieldValueToString(*message_, field(name), -1, &value);
    if (field(name)->cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE) {
      // a vector is quoted, a block is not
      constexpr std::size_t kLongestBlock = 60;
      value = value.size() > kLongestBlock ? "{ … }" : "{ " + value + "}";
    }
    value = " = " + one_line(value);
  }
  problems_->add(place(name), written_path(name) + value + ": " + rule);
}

void Fields::problem(const std::string& rule) const {
  problems_->add(text_->place(path_), text_->written_path(path_) + ": " + rule);
}

void Fields::problem_at(const char* name, int index, const std::string& rule) const {
  const std::string path = child_path(path_, name, index);
  problems_->add(text_->place(path), text_->written_path(path) + ": " + rule);
}

Duration to_duration(double s) {
  if (!(s > 0.0)) return Duration::zero();
  return std::max(from_seconds(s), Duration(1));  // a value above 0 stays above 0
}
Duration to_milliseconds(double ms) { return to_duration(ms * 1e-3); }
Duration to_microseconds(double us) { return to_duration(us * 1e-6); }

}  // namespace palpate
