// SPDX-License-Identifier: Apache-2.0
// session_reference.h — docs/session.md from the schema: comments, units, ranges and defaults of
// all fields.
#pragma once

#include <string>
#include <string_view>

namespace palpate {

/// @param descriptor_set  serialized google.protobuf.FileDescriptorSet of session.proto and its
/// imports,
///                        with source info
/// @throws std::runtime_error if it is none
[[nodiscard]] std::string session_reference(std::string_view descriptor_set);

}  // namespace palpate
