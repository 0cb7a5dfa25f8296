// session_text.h — a session as it was written: the protobuf message, the place of every field, and
// the overrides of the command line laid over it. What the fields may say: session_convert.cpp.
#pragma once

#include <google/protobuf/message.h>
#include <google/protobuf/text_format.h>

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/session/session_problems.h"
#include "palpate/v1/session.pb.h"

namespace palpate {

/// What is wrong with a number whatever its field: not finite, beyond 1e9, a time beyond 1e6 s (the
/// unit is told by the field's name). Empty if nothing.
[[nodiscard]] std::string number_complaint(const std::string& field_name, double value);

class SessionText {
 public:
  explicit SessionText(Problems& problems) : problems_(problems) {}

  /// Reads protobuf text format. False if it cannot be read at all; a field that does not exist is
  /// a problem, and reading goes on.
  [[nodiscard]] bool read(std::string_view text);

  /// Applies "path=value"; `number` counts the overrides from 1. One that cannot be applied is a
  /// problem and changes nothing.
  void apply_override(int number, const std::string& assignment);

  /// Makes a problem of each number that has a `number_complaint`.
  void check_numbers() { check_numbers(message_, ""); }

  [[nodiscard]] const v1::Session& message() const { return message_; }

  /// Where the field was written; where the message around it was, if it is left out.
  /// @param path  e.g. "scene.tissue[0].sphere.radius_m"; "" for the session itself
  [[nodiscard]] Place place(std::string path) const;

  /// The session as it is for one side: side[index] laid over it. Its paths are those of a session
  /// of one device; places and written paths stay those of the file.
  [[nodiscard]] SessionText for_side(int index) const;

  /// Where the field of this path really stands: "side[1].hand.mass_kg" if the side gives it, or
  /// the message around it.
  [[nodiscard]] std::string written_path(const std::string& path) const;

 private:
  /// A message of the file: its path and where it stands.
  struct Span {
    std::string path;
    std::size_t begin = 0;
    std::size_t end = 0;
  };

  /// A byte whose place as the tokenizer counts, lines from 0 and tabs as up to 8, is known.
  struct Anchor {
    int line = 0;
    int column = 0;
    std::size_t offset = 0;
  };

  void note_lines();
  [[nodiscard]] bool is_too_deep(std::string_view text);
  [[nodiscard]] std::size_t offset_of(int line, int column) const;
  [[nodiscard]] Place place_of(std::size_t offset) const;
  void record(const google::protobuf::Message& message,
              const google::protobuf::TextFormat::ParseInfoTree& tree, const std::string& path);
  void report_unknown(int line, int column, const std::string& complaint);
  [[nodiscard]] std::string assign(const std::string& path, const std::string& value,
                                   const Place& place);
  void forget(const std::string& path);
  void check_numbers(const google::protobuf::Message& message, const std::string& path);

  Problems& problems_;
  std::string_view text_;  // valid during read()
  std::vector<std::size_t> line_begins_;
  std::vector<Anchor> anchors_;  // each line's begin and the end of each tab
  std::vector<Span> spans_;
  v1::Session message_;
  std::string side_;  // "side[1]."; empty: the whole session
  std::map<std::string, Place, std::less<>> places_;
};

/// "tissue", 2 below "scene" → "scene.tissue[2]"; an index < 0 is left out.
[[nodiscard]] std::string child_path(const std::string& path, const std::string& name, int index);

}  // namespace palpate
