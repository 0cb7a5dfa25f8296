// SPDX-License-Identifier: Apache-2.0
#include "common/session/reference/session_reference.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/descriptor.pb.h>

#include <algorithm>
#include <deque>
#include <sstream>
#include <stdexcept>
#include <utility>
#include <vector>

#include "common/session/file/session_rules.h"
#include "palpate/v1/session.pb.h"

namespace palpate {

namespace {

namespace pb = google::protobuf;

constexpr const char* kVectorType = "palpate.v1.Vector3d";
constexpr const char* kPackage = "palpate.v1.";

/// The comment above an element of the schema: paragraphs of one line each, without the last
/// newline.
template <class Descriptor>
std::string comment_of(const Descriptor& element) {
  pb::SourceLocation location;
  if (!element.GetSourceLocation(&location)) return {};
  std::istringstream lines(location.leading_comments);
  std::string text;
  bool is_new_paragraph = false;
  for (std::string line; std::getline(lines, line);) {
    line.erase(0, line.find_first_not_of(' '));
    if (line.empty()) {
      is_new_paragraph = true;
      continue;
    }
    if (!text.empty()) text += is_new_paragraph ? "\n\n" : " ";
    text += line;
    is_new_paragraph = false;
  }
  return text;
}

/// "Device.Workspace".
std::string short_name(const std::string& full_name) {
  return full_name.substr(std::string_view(kPackage).size());
}

/// Text as it may stand in a cell of a table.
std::string in_cell(const std::string& text) {
  std::string cell;
  for (const char c : text) {
    if (c == '|') cell += '\\';
    cell += c == '\n' ? ' ' : c;
  }
  return cell;
}

bool is_vector(const pb::FieldDescriptor& field) {
  return field.message_type() != nullptr && field.message_type()->full_name() == kVectorType;
}

bool is_section(const pb::FieldDescriptor& field) {
  return field.message_type() != nullptr && !is_vector(field);
}

std::string type_text(const pb::FieldDescriptor& field) {
  std::string text;
  if (is_vector(field)) {
    text = "vector";
  } else if (field.message_type() != nullptr) {
    const std::string name = short_name(field.message_type()->full_name());
    std::string anchor;
    for (const char c : name) {
      if (c != '.') anchor += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    }
    text = "[" + name + "](#" + anchor + ")";
  } else if (field.enum_type() != nullptr) {
    text = field.enum_type()->name();
  } else {
    text = field.cpp_type_name();
    if (field.cpp_type() == pb::FieldDescriptor::CPPTYPE_DOUBLE) text = "number";
    if (field.cpp_type() == pb::FieldDescriptor::CPPTYPE_STRING) text = "text";
  }
  return field.is_repeated() ? "list of " + text : text;
}

std::string default_text(const pb::FieldDescriptor& field, const v1::FieldRule& rule) {
  if (rule.required()) return "required";
  if (!rule.computed_default().empty()) return rule.computed_default();
  if (field.is_repeated()) return "none";
  if (is_vector(field)) {
    if (rule.default_vector_size() == 0) return "0, 0, 0";
    return shown(rule.default_vector(0)) + ", " + shown(rule.default_vector(1)) + ", " +
           shown(rule.default_vector(2));
  }
  if (field.message_type() != nullptr) return "–";
  if (field.enum_type() != nullptr) return comment_of(*field.enum_type()->value(0));
  if (field.cpp_type() == pb::FieldDescriptor::CPPTYPE_STRING) return "none";
  if (field.cpp_type() == pb::FieldDescriptor::CPPTYPE_BOOL) return "false";
  return shown(rule.default_value());
}

std::string row(const pb::FieldDescriptor& field, const v1::FieldRule& rule) {
  std::string meaning = comment_of(field);
  if (const pb::OneofDescriptor* oneof = field.real_containing_oneof()) {
    meaning = "one of `" + oneof->name() + "`" + (meaning.empty() ? "" : ": " + meaning);
  }
  const auto cell = [](const std::string& text) {
    return " " + in_cell(text.empty() ? "–" : text) + " |";
  };
  return "| `" + field.name() + "` |" + cell(type_text(field)) + cell(rule.unit()) +
         cell(range_text(rule)) + cell(default_text(field, rule)) + cell(meaning) + "\n";
}

std::string enums_text(const pb::Descriptor& message) {
  std::string text;
  for (int i = 0; i < message.enum_type_count(); ++i) {
    const pb::EnumDescriptor& type = *message.enum_type(i);
    const std::string comment = comment_of(type);
    text += "\n**" + type.name() + "**" + (comment.empty() ? "" : ": " + comment) + "\n\n";
    for (int v = 1; v < type.value_count(); ++v) {
      text += "- `" + type.value(v)->name() + "`: " + comment_of(*type.value(v)) + "\n";
    }
  }
  return text;
}

std::string oneofs_text(const pb::Descriptor& message) {
  std::string text;
  for (int i = 0; i < message.real_oneof_decl_count(); ++i) {
    const pb::OneofDescriptor& oneof = *message.oneof_decl(i);
    text += "\nOne of `" + oneof.name() + "`: " + comment_of(oneof) + "\n";
  }
  return text;
}

}  // namespace

std::string session_reference(std::string_view descriptor_set) {
  pb::FileDescriptorSet files;
  if (!files.ParseFromArray(descriptor_set.data(), static_cast<int>(descriptor_set.size()))) {
    throw std::runtime_error("the descriptor set cannot be read");
  }
  pb::DescriptorPool pool;
  for (const pb::FileDescriptorProto& file : files.file()) {
    if (pool.BuildFile(file) == nullptr) {
      throw std::runtime_error("the descriptor set lacks an import of " + file.name());
    }
  }
  const std::string root = v1::Session::descriptor()->full_name();
  const pb::Descriptor* session = pool.FindMessageTypeByName(root);
  if (session == nullptr) throw std::runtime_error("the descriptor set lacks " + root);

  std::string text =
      "# Session reference\n\n"
      "Generated from `proto/palpate/v1/session*.proto`; do not edit. To refresh it:\n"
      "`cmake --build build/release --target session_reference`.\n\n"
      "A field that is left out has its default; – stands for none. Of a vector the range holds "
      "for each "
      "component.\n";
  // each message once, in the order in which fields name them, with the first path that leads there
  std::vector<const pb::Descriptor*> known{session};
  std::deque<std::pair<const pb::Descriptor*, std::string>> next{{session, ""}};
  for (; !next.empty(); next.pop_front()) {
    const auto [message, path] = next.front();
    text += "\n## " + short_name(message->full_name()) + "\n\n";
    if (!path.empty()) text += "`" + path + "`\n\n";
    if (const std::string comment = comment_of(*message); !comment.empty())
      text += comment + "\n\n";
    text += "| field | type | unit | range | default | meaning |\n|---|---|---|---|---|---|\n";
    for (int i = 0; i < message->field_count(); ++i) {
      const pb::FieldDescriptor& field = *message->field(i);
      // only the descriptors compiled into the program know the options
      text +=
          row(field,
              rule_of(*pb::DescriptorPool::generated_pool()->FindFieldByName(field.full_name())));
      if (!is_section(field)) continue;
      if (std::find(known.begin(), known.end(), field.message_type()) != known.end()) continue;
      known.push_back(field.message_type());
      next.emplace_back(field.message_type(), (path.empty() ? "" : path + ".") + field.name() +
                                                  (field.is_repeated() ? "[]" : ""));
    }
    text += oneofs_text(*message) + enums_text(*message);
  }
  return text;
}

}  // namespace palpate
