// SPDX-License-Identifier: Apache-2.0
// session_text.h — a session as it was written: the protobuf message, the place of every field, and
// the overrides of the command line applied to it. Values are checked by session_fields.h.
#pragma once

#include <google/protobuf/message.h>
#include <google/protobuf/text_format.h>

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "common/core/problems.h"
#include "common/session/file/session_outline.h"
#include "palpate/v1/session.pb.h"

namespace palpate {

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

  /// Where the field is written; if it is left out, where the message around it is.
  /// @param path  e.g. "scene.tissue[0].sphere.radius_m"; "" for the session itself
  [[nodiscard]] Place place(std::string path) const;

  /// The session of one side: side[index] merged over the session. Its paths are those of a session
  /// with one device; places and written paths remain those of the file.
  [[nodiscard]] SessionText for_side(int index) const;

  /// The path of the field in the file: "side[1].hand.mass_kg" if the side gives the field or the
  /// message around it.
  [[nodiscard]] std::string written_path(const std::string& path) const;

 private:
  /// A byte of the text whose position as the tokenizer counts is known.
  struct Anchor {
    TokenPosition position;
    std::size_t offset = 0;
  };

  void note_lines();
  [[nodiscard]] std::size_t offset_of(TokenPosition position) const;
  [[nodiscard]] Place place_of(std::size_t offset) const;
  void record(const google::protobuf::Message& message,
              const google::protobuf::TextFormat::ParseInfoTree& tree, const std::string& path);
  [[nodiscard]] std::string assign(const std::string& path, const std::string& value,
                                   const Place& place);
  void forget(const std::string& path);
  void check_numbers(const google::protobuf::Message& message, const std::string& path);

  Problems& problems_;
  std::string_view text_;  // valid during read()
  std::vector<std::size_t> line_begins_;
  std::vector<Anchor> anchors_;  // each line's begin and the end of each tab
  v1::Session message_;
  std::string side_;  // "side[1]."; empty: the whole session
  std::map<std::string, Place, std::less<>> places_;
};

/// "tissue", 2 below "scene" → "scene.tissue[2]"; an index < 0 is left out.
[[nodiscard]] std::string child_path(const std::string& path, const std::string& name, int index);

}  // namespace palpate
