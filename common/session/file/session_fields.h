// SPDX-License-Identifier: Apache-2.0
// session_fields.h — reads one message of a session field by field, each checked against its rule.
#pragma once

#include <google/protobuf/message.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "common/core/problems.h"
#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/file/session_rules.h"
#include "common/session/file/session_text.h"

namespace palpate {

/// A field that breaks its rule becomes a problem and reads as NaN (numbers) or as its default.
/// Rules between fields are written so that NaN breaks none: one mistake, one problem.
///
/// Names are those of the schema; an unknown name aborts. Ranges, constant defaults and remedies
/// are those of the schema.
class Fields {
 public:
  /// The whole session.
  Fields(const SessionText& text, Problems& problems)
      : Fields(text, problems, text.message(), "") {}

  [[nodiscard]] bool has(const char* name) const;
  /// `has`; a field that is left out is a problem.
  [[nodiscard]] bool has_required(const char* name) const;

  /// A message; one that is left out reads as one without fields.
  [[nodiscard]] Fields message(const char* name) const;
  [[nodiscard]] std::vector<Fields> messages(const char* name) const;

  /// The member of the oneof that is given, "" if none.
  [[nodiscard]] std::string given_member(const char* oneof) const;

  /// In the unit of the name. Left out: NaN with a problem if required, else the constant default.
  [[nodiscard]] double number(const char* name) const;
  [[nodiscard]] double number(const char* name, double computed_default) const;
  [[nodiscard]] double required_number(const char* name) const;  ///< whatever the schema says
  [[nodiscard]] double default_number(const char* name) const;   ///< the constant one
  [[nodiscard]] std::int64_t integer(const char* name) const;
  /// The number of the enumerator; 0, the default, if there is none of that number.
  [[nodiscard]] int enumerator(const char* name) const;
  [[nodiscard]] bool flag(const char* name) const;
  [[nodiscard]] std::string text(const char* name) const;
  [[nodiscard]] std::vector<std::string> texts(const char* name) const;  ///< of a repeated field

  /// The file that the field names, relative to `base_dir`; empty, with a problem, if it cannot be
  /// one.
  [[nodiscard]] std::filesystem::path file(const char* name,
                                           const std::filesystem::path& base_dir) const;

  /// A component left out is 0; in a required vector it is a problem.
  [[nodiscard]] Vector3 vector(const char* name) const;
  /// Scaled to length 1.
  [[nodiscard]] Vector3 direction(const char* name) const;
  /// Of a vector axis · angle; none for 0.
  [[nodiscard]] Quaternion rotation(const char* name) const;

  [[nodiscard]] Duration milliseconds(const char* name) const;  ///< of a field in ms
  [[nodiscard]] Duration microseconds(const char* name) const;  ///< of a field in µs

  /// "path.name = value: rule", at the place of the field; no value if it is left out.
  void problem(const char* name, const std::string& rule) const;
  void problem(const std::string& rule) const;  ///< of the message itself
  /// Of one text of a repeated field.
  void problem_at(const char* name, int index, const std::string& rule) const;

  [[nodiscard]] std::string path(const char* name) const { return child_path(path_, name, -1); }
  /// Path of the field in the file: below the side that gives it.
  [[nodiscard]] std::string written_path(const char* name) const {
    return text_->written_path(path(name));
  }
  [[nodiscard]] Place place(const char* name) const { return text_->place(path(name)); }

 private:
  Fields(const SessionText& text, Problems& problems, const google::protobuf::Message& message,
         std::string path)
      : text_(&text), problems_(&problems), message_(&message), path_(std::move(path)) {}

  [[nodiscard]] const google::protobuf::FieldDescriptor* field(const char* name) const;
  [[nodiscard]] double checked(const char* name, double fallback, const v1::FieldRule& rule) const;

  const SessionText* text_;
  Problems* problems_;
  const google::protobuf::Message* message_;
  std::string path_;
};

/// At least 1 ns if above 0; 0 for NaN, which has a problem already.
[[nodiscard]] Duration to_milliseconds(double ms);
[[nodiscard]] Duration to_microseconds(double us);
[[nodiscard]] Duration to_duration(double s);

}  // namespace palpate
