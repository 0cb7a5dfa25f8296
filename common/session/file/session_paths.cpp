// SPDX-License-Identifier: Apache-2.0
#include "common/session/file/session_paths.h"

#include <google/protobuf/descriptor.h>

#include "palpate/v1/session.pb.h"

namespace palpate {
namespace {

namespace pb = google::protobuf;

constexpr int kDeepest = 8;

void add(const pb::Descriptor& message, const std::string& before, int depth,
         std::vector<std::string>& paths) {
  for (int i = 0; i < message.field_count() && depth < kDeepest; ++i) {
    const pb::FieldDescriptor& field = *message.field(i);
    const std::string path = before + field.name();
    if (field.cpp_type() == pb::FieldDescriptor::CPPTYPE_MESSAGE) {
      if (!field.is_repeated()) add(*field.message_type(), path + ".", depth + 1, paths);
      continue;
    }
    paths.push_back(path + "=");
    if (field.cpp_type() == pb::FieldDescriptor::CPPTYPE_BOOL) {
      paths.push_back(path + "=false");
      paths.push_back(path + "=true");
    }
    if (field.enum_type() == nullptr) continue;
    for (int value = 1; value < field.enum_type()->value_count(); ++value) {
      paths.push_back(path + "=" + field.enum_type()->value(value)->name());
    }
  }
}

}  // namespace

std::vector<std::string> session_paths() {
  std::vector<std::string> paths;
  add(*v1::Session::descriptor(), "", 0, paths);
  return paths;
}

}  // namespace palpate
