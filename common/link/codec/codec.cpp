// SPDX-License-Identifier: Apache-2.0
#include "common/link/codec/codec.h"

#include <google/protobuf/stubs/logging.h>

namespace palpate {
namespace {

/// Protobuf writes to stderr what it thinks of a bad message, from the thread that decodes, which
/// may be the tick. The codecs refuse such a message, and the links count and explain it.
[[maybe_unused]] auto* const former_handler = google::protobuf::SetLogHandler(nullptr);

}  // namespace

const char* name(DecodeError error) {
  switch (error) {
    case DecodeError::kNone:
      return "none";
    case DecodeError::kTooLarge:
      return "too_large";
    case DecodeError::kWrongKind:
      return "wrong_kind";
    case DecodeError::kMalformed:
      return "malformed";
    case DecodeError::kWrongVersion:
      return "wrong_version";
    case DecodeError::kMissingField:
      return "missing_field";
    case DecodeError::kNotFinite:
      return "not_finite";
    case DecodeError::kOutOfRange:
      return "out_of_range";
  }
  return "?";
}

std::string explain(DecodeError error, std::uint32_t peer_major) {
  switch (error) {
    case DecodeError::kNone:
      return "frame accepted";
    case DecodeError::kTooLarge:
      return "frame longer than any message of this link: the peer is not a Palpate node";
    case DecodeError::kWrongKind:
      return "frame of another hop: two endpoints in links {} of the session are mixed up";
    case DecodeError::kMalformed:
      return "frame is not a Palpate message: the peer is not a Palpate node, or damages frames";
    case DecodeError::kWrongVersion:
      return "peer speaks protocol " + std::to_string(peer_major) + ", this program speaks " +
             std::to_string(kProtocolMajor) + ": update the older one";
    case DecodeError::kMissingField:
      return "a required field is missing: the peer violates proto/palpate/v1";
    case DecodeError::kNotFinite:
      return "a number is NaN or infinite: look for an error in the peer's computation";
    case DecodeError::kOutOfRange:
      return "a value is outside the range given in proto/palpate/v1: look for an error in the "
             "peer's computation";
  }
  return "?";
}

}  // namespace palpate
