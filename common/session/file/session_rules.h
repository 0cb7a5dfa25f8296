// SPDX-License-Identifier: Apache-2.0
// session_rules.h — the rule of each field as the schema states it
// (proto/palpate/v1/session_options.proto).
#pragma once

#include <google/protobuf/descriptor.h>

#include <string>

#include "palpate/v1/session_options.pb.h"

namespace palpate {

/// The rule of the field; an empty one if the schema states none.
[[nodiscard]] const v1::FieldRule& rule_of(const google::protobuf::FieldDescriptor& field);

/// "> 0", "≥ 5", "0 … 1", "> 0, ≤ 20"; empty if the rule allows every value.
[[nodiscard]] std::string range_text(const v1::FieldRule& rule);

/// What is wrong with a finite value; empty if nothing: "must be > 0; give the mass …". Lengths,
/// forces, stiffness and damping have limits whatever the rule.
[[nodiscard]] std::string range_complaint(const v1::FieldRule& rule, double value);

/// What is wrong with a number of any field: not finite, beyond 1e9, a time beyond 1e6 s. Empty if
/// nothing.
[[nodiscard]] std::string number_complaint(const google::protobuf::FieldDescriptor& field,
                                           double value);

/// "required; give the radius in m".
[[nodiscard]] std::string required_complaint(const v1::FieldRule& rule);

/// Names of the values of an enum, without that of 0, which stands for the default.
[[nodiscard]] std::string choices_text(const google::protobuf::EnumDescriptor& type);

/// Shortest text of a number: "0.5", "-1".
[[nodiscard]] std::string shown(double value);

}  // namespace palpate
