// SPDX-License-Identifier: Apache-2.0
#include "deploy/campaign/checked_text.h"

#include <google/protobuf/io/tokenizer.h>
#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cctype>
#include <cmath>

#include "common/core/check.h"
#include "common/core/user/files.h"
#include "common/session/file/session_rules.h"

namespace palpate::campaign {
namespace {

namespace pb = google::protobuf;

constexpr std::uintmax_t kMostBytes = 1'000'000;

class Errors final : public pb::io::ErrorCollector {
 public:
  explicit Errors(Problems& problems) : problems_(problems) {}
  void AddError(int line, int column, const std::string& message) override {
    problems_.add({.line = line + 1, .column = column + 1}, message);
  }

 private:
  Problems& problems_;
};

}  // namespace

CheckedText::CheckedText(const std::filesystem::path& file, const char* what, pb::Message& written,
                         Problems& problems)
    : file_(file.string()), problems_(problems) {
  const FileContent content = read_text_file(file, kMostBytes);
  if (!content.complaint.empty()) {
    throw SetupError(std::string(what) + " " + one_line(file.string()) + ": " + content.complaint);
  }
  Errors errors(problems);
  pb::TextFormat::Parser parser;
  parser.RecordErrorsTo(&errors);
  parser.SetRecursionLimit(32);
  pb::TextFormat::ParseInfoTree places;
  parser.WriteLocationsTo(&places);
  if (!parser.ParseFromString(content.bytes, &written)) problems.throw_if_any();
  check_rules(written, places, "");
}

void CheckedText::check_name(const std::string& name) const {
  const auto is_plain = [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-';
  };
  if (name.size() > 64 || !std::all_of(name.begin(), name.end(), is_plain)) {
    problem("name", "must be 1 … 64 letters, digits, '_' and '-'");
  }
}

/// Required fields and ranges as the schema states them, of a message and all below it.
void CheckedText::check_rules(const pb::Message& message,
                              const pb::TextFormat::ParseInfoTree& places,
                              const std::string& path) {
  const pb::Descriptor& type = *message.GetDescriptor();
  const pb::Reflection& reflection = *message.GetReflection();
  for (int i = 0; i < type.field_count(); ++i) {
    const pb::FieldDescriptor& field = *type.field(i);
    const std::string name = path + field.name();
    const int size = field.is_repeated() ? reflection.FieldSize(message, &field)
                                         : static_cast<int>(reflection.HasField(message, &field));
    const v1::FieldRule& rule = rule_of(field);
    if (size == 0 && rule.required()) problem(name, required_complaint(rule));
    for (int k = 0; k < size; ++k) {
      const std::string at = field.is_repeated() ? fmt::format("{}[{}]", name, k) : name;
      const auto location = places.GetLocation(&field, field.is_repeated() ? k : -1);
      places_[at] = {.line = location.line + 1, .column = location.column + 1};
      if (field.type() == pb::FieldDescriptor::TYPE_MESSAGE) {
        const auto& below = field.is_repeated() ? reflection.GetRepeatedMessage(message, &field, k)
                                                : reflection.GetMessage(message, &field);
        const auto* tree = places.GetTreeForNested(&field, field.is_repeated() ? k : -1);
        if (tree != nullptr) check_rules(below, *tree, at + ".");
      } else if (!field.is_repeated()) {
        check_number(message, field, at);
      }
    }
  }
}

void CheckedText::check_number(const pb::Message& message, const pb::FieldDescriptor& field,
                               const std::string& at) const {
  const pb::Reflection& reflection = *message.GetReflection();
  double value = 0.0;
  if (field.type() == pb::FieldDescriptor::TYPE_DOUBLE) {
    value = reflection.GetDouble(message, &field);
    if (!std::isfinite(value)) return problem(at, "must be a finite number");
  } else if (field.type() == pb::FieldDescriptor::TYPE_UINT64) {
    value = static_cast<double>(reflection.GetUInt64(message, &field));
  } else {
    return;
  }
  const std::string complaint = range_complaint(rule_of(field), value);
  if (!complaint.empty()) problem(at, complaint);
}

void CheckedText::problem(const std::string& at, const std::string& rule) const {
  problems_.add(place_of(at), at + ": " + rule);
}

std::string CheckedText::where(const std::string& at) const {
  const Place place = place_of(at);
  const std::string position =
      place.line > 0 ? fmt::format(":{}:{}", place.line, place.column) : "";
  return one_line(file_ + position) + ": " + at;
}

Place CheckedText::place_of(const std::string& at) const {
  std::string above = at;
  while (!places_.contains(above) && !above.empty()) {
    const std::size_t dot = above.rfind('.');
    above.resize(dot == std::string::npos ? 0 : dot);
  }
  const auto place = places_.find(above);
  return place == places_.end() ? Place{.line = 0} : place->second;
}

}  // namespace palpate::campaign
