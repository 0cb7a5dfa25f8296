// session_fields.h — one message of a session, read field by field, each against its rule.
#pragma once

#include <google/protobuf/message.h>

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "common/core/time.h"
#include "common/core/vector.h"
#include "common/session/session_problems.h"
#include "common/session/session_text.h"

namespace palpate {

/// The values a number may have.
struct Range {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
  bool is_min_allowed = true;
};
[[nodiscard]] constexpr Range above(double min) { return {.min = min, .is_min_allowed = false}; }
[[nodiscard]] constexpr Range at_least(double min) { return {.min = min}; }
[[nodiscard]] constexpr Range between(double min, double max) { return {.min = min, .max = max}; }
[[nodiscard]] constexpr Range anything() { return {}; }

/// A field that breaks its rule becomes a problem and reads as NaN (numbers) or as its default, and
/// rules between fields are written so that NaN breaks none: one mistake, one problem.
///
/// Names are those of the schema; a name that is not there aborts. `remedy` tells the user what to
/// do: "give the mass of the moving parts in kg".
class Fields {
 public:
  /// The whole session.
  Fields(const SessionText& text, Problems& problems)
      : Fields(text, problems, text.message(), "") {}

  [[nodiscard]] bool has(const char* name) const;

  /// A message; one that is left out reads as one with every field left out.
  [[nodiscard]] Fields message(const char* name) const;
  [[nodiscard]] std::vector<Fields> messages(const char* name) const;

  /// The member of the oneof that is given, "" if none.
  [[nodiscard]] std::string given_member(const char* oneof) const;

  /// In the unit of the name; `fallback` if left out.
  [[nodiscard]] double number(const char* name, double fallback, const Range& range,
                              const char* remedy) const;
  [[nodiscard]] double required_number(const char* name, const Range& range,
                                       const char* remedy) const;
  [[nodiscard]] std::int64_t integer(const char* name, std::int64_t fallback, std::int64_t min,
                                     std::int64_t max, const char* remedy) const;
  [[nodiscard]] bool flag(const char* name) const;
  [[nodiscard]] std::string text(const char* name) const;

  /// A component left out is 0.
  [[nodiscard]] Vector3 vector(const char* name, const Vector3& fallback,
                               const Range& range = anything(), const char* remedy = "") const;
  /// Scaled to length 1; `fallback` is a unit vector.
  [[nodiscard]] Vector3 direction(const char* name, const Vector3& fallback) const;

  /// "path.name = value: rule", at the place of the field; no value if it is left out.
  void problem(const char* name, const std::string& rule) const;
  void problem(const std::string& rule) const;  ///< of the message itself

  [[nodiscard]] std::string path(const char* name) const { return child_path(path_, name, -1); }
  /// The same in the file: below the side that gives the field.
  [[nodiscard]] std::string written_path(const char* name) const {
    return text_->written_path(path(name));
  }
  [[nodiscard]] Place place(const char* name) const { return text_->place(path(name)); }

 private:
  Fields(const SessionText& text, Problems& problems, const google::protobuf::Message& message,
         std::string path)
      : text_(&text), problems_(&problems), message_(&message), path_(std::move(path)) {}

  [[nodiscard]] const google::protobuf::FieldDescriptor* field(const char* name) const;

  const SessionText* text_;
  Problems* problems_;
  const google::protobuf::Message* message_;
  std::string path_;
};

/// From the unit of the field, at least 1 ns if it is above 0; a NaN, whose problem is known, gives
/// 0.
[[nodiscard]] Duration milliseconds(double ms);
[[nodiscard]] Duration microseconds(double us);
[[nodiscard]] Duration seconds(double s);

/// Shortest text of a number: "0.5", "-1".
[[nodiscard]] std::string shown(double value);

}  // namespace palpate
