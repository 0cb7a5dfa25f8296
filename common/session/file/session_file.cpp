// SPDX-License-Identifier: Apache-2.0
#include "common/session/session_file.h"

#include <google/protobuf/message.h>
#include <google/protobuf/stubs/logging.h>
#include <google/protobuf/text_format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>

#include "common/core/check.h"
#include "common/core/problems.h"
#include "common/core/user/files.h"
#include "common/session/file/convert.h"
#include "common/session/file/session_outline.h"
#include "common/session/file/session_text.h"

namespace palpate {

namespace {

constexpr std::uintmax_t kMaxSessionFileBytes = 16'000'000;  // 10,000 tissues take 2 MB

/// Whether the field names a file: those are called …file or …folder.
bool is_file(const google::protobuf::FieldDescriptor& field) {
  return field.name().ends_with("file") || field.name().ends_with("folder");
}

/// Calls visit(path, file) for the fields that name a file.
template <class Visit>
void for_each_file(const google::protobuf::Message& message, const std::string& path,
                   const Visit& visit) {
  using google::protobuf::FieldDescriptor;
  const auto& reflection = *message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    const std::string child = child_path(path, field->name(), -1);
    if (field->type() == FieldDescriptor::TYPE_MESSAGE) {
      if (!field->is_repeated()) {
        for_each_file(reflection.GetMessage(message, field), child, visit);
        continue;
      }
      for (int i = 0; i < reflection.FieldSize(message, field); ++i) {
        for_each_file(reflection.GetRepeatedMessage(message, field, i),
                      child_path(path, field->name(), i), visit);
      }
    } else if (is_file(*field)) {
      const std::string file = reflection.GetString(message, field);
      if (!file.empty()) visit(child, file);
    }
  }
}

/// Of the environment; empty if it is not set.
std::string variable(const char* name) {
  const char* value = std::getenv(name);  // NOLINT(concurrency-mt-unsafe): nothing sets it
  return value == nullptr ? "" : value;
}

}  // namespace

Session load_session(const std::filesystem::path& file, const std::vector<std::string>& overrides) {
  const FileContent content = read_text_file(file, kMaxSessionFileBytes);
  if (!content.complaint.empty()) {
    throw SetupError("session " + one_line(file.string()) + ": " + content.complaint);
  }
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  return parse_session(content.bytes, file.string(), overrides, folder);
}

Session parse_session(std::string_view text, const std::string& file_name,
                      const std::vector<std::string>& overrides,
                      const std::filesystem::path& base_dir) {
  Problems problems(file_name, overrides);
  SessionText written(problems);
  const bool is_read = written.read(text);
  if (!is_read) problems.throw_if_any();  // what was read of it is not worth judging

  for (std::size_t i = 0; i < overrides.size(); ++i) {
    written.apply_override(static_cast<int>(i) + 1, overrides[i]);
  }
  written.check_numbers();
  Session session = to_session(written, base_dir, problems);
  problems.throw_if_any();
  session.file = file_name;
  google::protobuf::TextFormat::PrintToString(written.message(), &session.text);
  return session;
}

std::string without_targets(std::string_view text) {
  v1::Session message;
  const google::protobuf::LogSilencer silence;
  if (!google::protobuf::TextFormat::ParseFromString(std::string(text), &message)) return "";
  v1::Task::Palpation& task = *message.mutable_task()->mutable_palpation();
  std::vector<int> lesions;
  for (const auto& target : task.target()) lesions.push_back(static_cast<int>(target.lesion()));
  std::sort(lesions.rbegin(), lesions.rend());
  const auto take_out = [&](auto& list) {
    for (const int lesion : lesions) {
      if (lesion < list.size()) list.DeleteSubrange(lesion, 1);
    }
  };
  for (auto& tissue : *message.mutable_scene()->mutable_tissue()) {
    if (tissue.name() != task.tissue()) continue;
    if (tissue.has_elastic()) take_out(*tissue.mutable_elastic()->mutable_part());
    if (tissue.has_kelvin_voigt()) take_out(*tissue.mutable_kelvin_voigt()->mutable_inclusion());
  }
  task.clear_target();
  if (message.has_hand()) {
    message.mutable_hand()->clear_recorded();
    message.mutable_hand()->clear_press();
  }
  std::string cleared;
  google::protobuf::TextFormat::PrintToString(message, &cleared);
  return cleared;
}

std::vector<std::string> files_of(const Session& session) {
  std::vector<std::string> files{session.file};
  v1::Session message;
  google::protobuf::TextFormat::ParseFromString(session.text, &message);
  const std::filesystem::path folder = std::filesystem::path(session.file).parent_path();
  for_each_file(message, "", [&](const std::string& /*path*/, const std::string& file) {
    files.push_back((folder / file).string());
  });
  return files;
}

namespace {

/// Calls visit(path, file) for the files that an override names, whatever it is applied to.
template <class Visit>
void for_each_file_of_override(const std::string& assignment, const Visit& visit) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos) return;
  const std::string path = assignment.substr(0, equals);
  const std::string value = assignment.substr(equals + 1);

  const google::protobuf::Descriptor* type = v1::Session::descriptor();
  const google::protobuf::FieldDescriptor* field = nullptr;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('.', begin), path.size());
    const std::string name = path.substr(begin, end - begin);
    field = type == nullptr ? nullptr : type->FindFieldByName(name.substr(0, name.find('[')));
    if (field == nullptr) return;  // refused where it is applied
    type = field->message_type();
    begin = end + 1;
  }

  const auto& holder = *google::protobuf::MessageFactory::generated_factory()->GetPrototype(
      field->containing_type());
  const std::unique_ptr<google::protobuf::Message> scratch(holder.New());
  const bool is_text = field->cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_STRING;
  if (is_text && !value.starts_with('"') && !value.starts_with('\'')) {
    if (is_file(*field)) visit(path, value);
    return;
  }
  const google::protobuf::LogSilencer silence;  // what cannot be read is refused, too
  google::protobuf::TextFormat::Parser parser;
  parser.SetRecursionLimit(2 * SessionOutline::kMaxDepth);
  static_cast<void>(parser.ParseFieldValueFromString(value, field, scratch.get()));
  for_each_file(*scratch, "", visit);
}

}  // namespace

std::vector<std::string> files_of_any(const std::filesystem::path& file,
                                      const std::vector<std::string>& overrides) {
  std::vector<std::string> files{file.string()};
  const auto add = [&](const std::string& /*path*/, const std::string& name) {
    files.push_back((file.parent_path() / name).string());
  };
  const FileContent content = read_text_file(file, kMaxSessionFileBytes);
  Problems ignored(file.string());
  SessionText written(ignored);
  if (written.read(content.bytes)) for_each_file(written.message(), "", add);
  for (const std::string& assignment : overrides) for_each_file_of_override(assignment, add);
  return files;
}

std::string with_place(const Session& session, const std::string& complaint) {
  const FileContent content = read_text_file(session.file, kMaxSessionFileBytes);
  Problems ignored(session.file);
  SessionText written(ignored);
  if (!content.complaint.empty() || !written.read(content.bytes)) return complaint;
  const std::filesystem::path folder = std::filesystem::path(session.file).parent_path();
  std::string found;
  for_each_file(written.message(), "", [&](const std::string& path, const std::string& file) {
    // as the structs of the session have it
    for (const std::filesystem::path& base : {folder, std::filesystem::path(".")}) {
      if (!found.empty() || !complaint.starts_with((base / file).string() + ":")) continue;
      const Place place = written.place(path);
      found = session.file + ":" + std::to_string(place.line) + ":" + std::to_string(place.column);
      found.append(": ").append(path).append(" = \"").append(one_line(file)).append("\": ");
      found += complaint;
      if (std::filesystem::path(file).is_relative()) {
        found += " (relative to the folder of the session)";
      }
    }
  });
  return found.empty() ? complaint : found;
}

std::filesystem::path run_folder(const std::string& session_name) {
  if (const std::string folder = variable("PALPATE_RUN_DIR"); !folder.empty()) {
    return std::filesystem::path(folder) / session_name;
  }
  if (const std::string folder = variable("XDG_RUNTIME_DIR"); !folder.empty()) {
    return std::filesystem::path(folder) / "palpate" / session_name;
  }
  return std::filesystem::path("/tmp/palpate-" + std::to_string(::getuid())) / session_name;
}

namespace {

/// The folder of the project, of systemd, of the desktop or in the user's home; empty: none.
std::filesystem::path user_folder(const char* own, const char* systemd, const char* desktop,
                                  const char* in_home) {
  for (const char* name : {own, systemd}) {
    if (const std::string folder = variable(name); !folder.empty()) return folder;
  }
  if (const std::string folder = variable(desktop); !folder.empty()) {
    return std::filesystem::path(folder) / "palpate";
  }
  if (const std::string folder = variable("HOME"); !folder.empty()) {
    return std::filesystem::path(folder) / in_home / "palpate";
  }
  return {};
}

}  // namespace

std::filesystem::path cache_folder() {
  return user_folder("PALPATE_CACHE_DIR", "CACHE_DIRECTORY", "XDG_CACHE_HOME", ".cache");
}

std::filesystem::path state_folder() {
  return user_folder("PALPATE_STATE_DIR", "STATE_DIRECTORY", "XDG_STATE_HOME", ".local/state");
}

}  // namespace palpate
