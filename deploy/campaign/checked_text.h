// SPDX-License-Identifier: Apache-2.0
// checked_text.h — a description in protobuf text format, with the place of each of its fields.
#pragma once

#include <google/protobuf/message.h>
#include <google/protobuf/text_format.h>

#include <filesystem>
#include <map>
#include <string>

#include "common/core/problems.h"

namespace palpate::campaign {

class CheckedText {
 public:
  /// Reads the file into `written`, and checks required fields and ranges as the schema states
  /// them. Throws SetupError if it cannot be read as such a message.
  /// @param what      "campaign", for messages
  /// @param problems  of the file; must outlive it
  CheckedText(const std::filesystem::path& file, const char* what,
              google::protobuf::Message& written, Problems& problems);

  /// @param at  path of a field: "vary[1].values"
  void problem(const std::string& at, const std::string& rule) const;
  /// "plan.txtpb:12:3: staircase.field": where a field is, or the message that lacks it.
  [[nodiscard]] std::string where(const std::string& at) const;
  /// Whether a name is 1 … 64 letters, digits, '_' and '-'; else it is a problem. An empty one is
  /// one already.
  void check_name(const std::string& name) const;

 private:
  void check_rules(const google::protobuf::Message& message,
                   const google::protobuf::TextFormat::ParseInfoTree& places,
                   const std::string& path);
  void check_number(const google::protobuf::Message& message,
                    const google::protobuf::FieldDescriptor& field, const std::string& at) const;

  /// Of the field, or of the message that lacks it.
  [[nodiscard]] Place place_of(const std::string& at) const;

  std::string file_;
  Problems& problems_;
  std::map<std::string, Place> places_;
};

}  // namespace palpate::campaign
