// SPDX-License-Identifier: Apache-2.0
// Rules that hold for every message: round trips, damaged frames, and each field, found by
// reflection.
#include <google/protobuf/message.h>
#include <google/protobuf/stubs/logging.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <set>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "tests/support/alloc_guard.h"
#include "tests/support/machine/places.h"
#include "tests/unit/link/codec_test_support.h"

namespace palpate {
namespace {

using test::closed;
using test::decoded;
using test::encoded;
using test::expect_refused;
using test::Frame;
using test::full_message;
using test::opened;
using test::random_message;
using test::same;
using test::Wire;

template <class T>
class CodecOf : public testing::Test {};
using Messages = testing::Types<DeviceState, ForceCommand, ToolMotion, Interaction, DeviceBatch,
                                MofcBatch, PhysicsBatch, SceneState, MeshFrame, HandTarget,
                                RunState, RunRequest, TissueChange, Acknowledgement>;
TYPED_TEST_SUITE(CodecOf, Messages);

TYPED_TEST(CodecOf, DecodesWhatWasEncodedBitByBit) {
  Codec<TypeParam> codec;  // one codec for all messages: nothing of one may remain in the next
  TypeParam received;
  for (std::uint64_t seed = 1; seed <= 500; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Random random(seed);
    const auto sent = random_message<TypeParam>(random);

    Frame frame(codec.encode(sent));
    codec.write(frame.data());
    ASSERT_LE(frame.size(), kMaxFrameBytes<TypeParam>);
    ASSERT_STREQ(name(codec.decode(frame, received)), "none");

    ASSERT_TRUE(same(sent, received));
  }
}

TYPED_TEST(CodecOf, DoesNotAllocateInSteadyState) {
  const auto sent = full_message<TypeParam>();
  Codec<TypeParam> codec;
  TypeParam received;
  Frame frame(codec.encode(sent));
  codec.write(frame.data());
  ASSERT_EQ(codec.decode(frame, received), DecodeError::kNone);

  const test::AllocGuard guard;
  for (int i = 0; i < 100; ++i) {
    frame.resize(codec.encode(sent));
    codec.write(frame.data());
    ASSERT_EQ(codec.decode(frame, received), DecodeError::kNone);
  }

  EXPECT_EQ(guard.count(), 0u);
}

TYPED_TEST(CodecOf, RefusesTruncatedFramesOrReadsThemConsistently) {
  const Frame frame = encoded(full_message<TypeParam>());
  TypeParam message;
  for (std::size_t size = 0; size < frame.size(); ++size) {
    const Frame cut(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(size));
    // a frame cut between two fields is a valid protobuf message in which fields are missing
    const DecodeError error = decoded(cut, message);
    ASSERT_TRUE(error == DecodeError::kMalformed || error == DecodeError::kMissingField ||
                error == DecodeError::kOutOfRange || error == DecodeError::kNone)
        << size << ": " << name(error);
    if (error != DecodeError::kNone) continue;
    // accepted: only trailing fields that are optional or have a default are missing
    ASSERT_EQ(decoded(closed<TypeParam>(opened<TypeParam>(cut)), message), DecodeError::kNone);
  }
}

/// The fuzzer does not get past the rules of the contract by itself.
TYPED_TEST(CodecOf, HasASeedInTheFuzzCorpusThatItAccepts) {
  namespace fs = std::filesystem;
  const fs::path corpus = test::source_dir() + "/tests/fuzz/corpus/codec";
  if (std::getenv("PALPATE_WRITE_CORPUS") != nullptr) {
    const Frame frame = encoded(full_message<TypeParam>());
    const int kind = static_cast<int>(kKindOf<TypeParam>);
    std::ofstream(corpus / ("seed_" + std::to_string(kind)), std::ios::binary)
        .write(reinterpret_cast<const char*>(frame.data()),
               static_cast<std::streamsize>(frame.size()));
  }
  bool has_seed = false;
  for (const fs::directory_entry& entry : fs::directory_iterator(corpus)) {
    std::ifstream file(entry.path(), std::ios::binary);
    const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
    const auto span = std::as_bytes(std::span(bytes));
    TypeParam message;
    has_seed = has_seed || decoded(Frame(span.begin(), span.end()), message) == DecodeError::kNone;
  }
  EXPECT_TRUE(has_seed) << "write the seeds anew: PALPATE_WRITE_CORPUS=1 link_test";
}

TYPED_TEST(CodecOf, RefusesEveryOtherKind) {
  Frame frame = encoded(full_message<TypeParam>());
  for (int kind = 0; kind < 256; ++kind) {
    if (kind == static_cast<int>(kKindOf<TypeParam>)) continue;
    frame[0] = static_cast<std::byte>(kind);
    expect_refused<TypeParam>(frame, DecodeError::kWrongKind);
  }
}

TYPED_TEST(CodecOf, RefusesTheEmptyFrame) {
  expect_refused<TypeParam>({}, DecodeError::kMalformed);
}

TYPED_TEST(CodecOf, ChecksTheLengthFirst) {
  Frame frame(kMaxFrameBytes<TypeParam> + 1, std::byte{0xff});
  expect_refused<TypeParam>(frame, DecodeError::kTooLarge);

  frame.pop_back();
  expect_refused<TypeParam>(frame, DecodeError::kWrongKind);
}

TYPED_TEST(CodecOf, RefusesInvalidProtobuf) {
  // field 1 with wire type 7, which does not exist
  expect_refused<TypeParam>({static_cast<std::byte>(kKindOf<TypeParam>), std::byte{0x0f}},
                            DecodeError::kMalformed);
}

TEST(ProtobufMessages, DoNotReachStandardError) {
  testing::internal::CaptureStderr();
  GOOGLE_LOG(ERROR) << "String field contains invalid UTF-8";
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

TYPED_TEST(CodecOf, ChecksTheVersionBeforeOtherFields) {
  typename Wire<TypeParam>::Message wire;
  wire.mutable_header()->set_protocol_major(2);
  const Frame frame = closed<TypeParam>(wire);
  expect_refused<TypeParam>(frame, DecodeError::kWrongVersion);

  Codec<TypeParam> codec;
  TypeParam message;
  ASSERT_EQ(codec.decode(frame, message), DecodeError::kWrongVersion);
  EXPECT_EQ(codec.peer_major(), 2u);
}

TYPED_TEST(CodecOf, IgnoresFieldsOfANewerMinorVersion) {
  const auto sent = full_message<TypeParam>();
  Frame frame = encoded(sent);
  // field 1000, varint 42: tag (1000 << 3) = 8000 = 0xc0 0x3e
  for (const int byte : {0xc0, 0x3e, 42}) frame.push_back(static_cast<std::byte>(byte));

  TypeParam received;
  ASSERT_STREQ(name(decoded(frame, received)), "none");
  EXPECT_TRUE(same(sent, received));
}

TYPED_TEST(CodecOf, RefusesSessionZero) {
  auto wire = opened<TypeParam>(encoded(full_message<TypeParam>()));
  wire.mutable_header()->set_session_id(0);
  expect_refused<TypeParam>(closed<TypeParam>(wire), DecodeError::kOutOfRange);
}

TYPED_TEST(CodecOf, SurvivesAnyDamage) {
  const Frame good = encoded(full_message<TypeParam>());
  Codec<TypeParam> codec;
  TypeParam message;
  for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
    Random random(seed);
    Frame frame = good;
    for (std::uint64_t i = 0; i <= random.below(8); ++i) {
      frame[random.below(frame.size())] = static_cast<std::byte>(random.below(256));
    }
    if (codec.decode(frame, message) == DecodeError::kNone) {
      // an accepted message can be sent on and is accepted again
      Frame again(codec.encode(message));
      codec.write(again.data());
      ASSERT_STREQ(name(codec.decode(again, message)), "none") << "seed=" << seed;
    }
  }
}

// --- every field, found by reflection ---------------------------------------------------------

using google::protobuf::FieldDescriptor;

/// Calls `visit` for every field of every message present, with its path.
void for_each_field(google::protobuf::Message& message, const std::string& path,
                    const std::function<void(google::protobuf::Message&, const FieldDescriptor*,
                                             const std::string&)>& visit) {
  const auto* descriptor = message.GetDescriptor();
  const auto* reflection = message.GetReflection();
  for (int i = 0; i < descriptor->field_count(); ++i) {
    const FieldDescriptor* field = descriptor->field(i);
    const std::string here = path + field->name();
    visit(message, field, here);
    if (field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) continue;
    if (field->is_repeated()) {
      for (int k = 0; k < reflection->FieldSize(message, field); ++k) {
        for_each_field(*reflection->MutableRepeatedMessage(&message, field, k), here + ".", visit);
      }
    } else if (reflection->HasField(message, field)) {
      for_each_field(*reflection->MutableMessage(&message, field), here + ".", visit);
    }
  }
}

/// Alters every field once, each in a new valid message, and passes on the altered frame.
template <class T>
void with_each_field(
    const std::function<bool(google::protobuf::Message&, const FieldDescriptor*)>& alter,
    const std::function<void(const Frame&, const std::string&)>& then) {
  const Frame good = encoded(full_message<T>());
  for (int index = 0;; ++index) {
    auto wire = opened<T>(good);
    int count = 0;
    bool is_altered = false;
    std::string path;
    // the order of the visits is fixed; the field number `index` is altered after the traversal
    google::protobuf::Message* target = nullptr;
    const FieldDescriptor* target_field = nullptr;
    for_each_field(wire, "", [&](auto& message, const auto* field, const std::string& here) {
      if (count++ == index) {
        target = &message;
        target_field = field;
        path = here;
      }
    });
    if (target == nullptr) return;
    is_altered = alter(*target, target_field);
    if (is_altered) then(closed<T>(wire), path);
  }
}

bool ends_with_one_of(const std::string& path, const std::set<std::string>& names) {
  for (const std::string& each : names) {
    if (path.size() >= each.size() &&
        path.compare(path.size() - each.size(), each.size(), each) == 0) {
      return true;
    }
  }
  return false;
}

TYPED_TEST(CodecOf, RefusesEachMissingMessageField) {
  int tried = 0;
  with_each_field<TypeParam>(
      [](auto& message, const auto* field) {
        if (field->is_repeated() || field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE ||
            !message.GetReflection()->HasField(message, field)) {
          return false;
        }
        message.GetReflection()->ClearField(&message, field);
        return true;
      },
      [&](const Frame& frame, const std::string& path) {
        SCOPED_TRACE(path);
        ++tried;
        if (path == "applied.hand_position_at_end_m" || path == "pointer" || path == "reach" ||
            path == "replay" || path == "displacement_world_m" || path == "receipts" ||
            path == "contacts.held_m" || path == "surface" || path == "surface.description" ||
            path == "surface.coverages.to_m" || path == "counters.standby_interaction" ||
            path == "wave" || path == "acted" || path == "elastic_receipts" || path == "elastic" ||
            path == "tool_angular_velocity_world_rad_per_s" || path == "grip" ||
            path == "contacts.arm_m" || path == "torque_on_tool_newton_m" ||
            path == "applied.wrist_torque_on_hand_newton_m" ||
            path == "wrist_torque_on_hand_newton_m" || path == "contacts.grip" ||
            path == "contacts.grip.needle" || path == "contacts.grip.needle.edge_world" ||
            path == "surface.description.motion_amplitude_m") {  // optional
          TypeParam message;
          EXPECT_EQ(decoded(frame, message), DecodeError::kNone);
        } else {
          expect_refused<TypeParam>(frame, DecodeError::kMissingField);
        }
      });
  EXPECT_GE(tried, 1);  // the header at least
}

TYPED_TEST(CodecOf, RefusesNaNAndInfinityExceptWhereDocumented) {
  const std::set<std::string> may_be_nan = {"true_tool_position_world_m",
                                            "true_tool_velocity_world_m_per_s",
                                            "true_energy_joule",
                                            "ledger_energy_joule",
                                            "f_max_newton",
                                            "true_wrist_angle_rad",
                                            "true_wrist_velocity_rad_per_s",
                                            "requested_wrist_torque_newton_m"};
  const double infinity = std::numeric_limits<double>::infinity();
  int tried = 0;
  for (const double bad : {kNaN, infinity, -infinity}) {
    with_each_field<TypeParam>(
        [&](auto& message, const auto* field) {
          if (field->cpp_type() != FieldDescriptor::CPPTYPE_DOUBLE) return false;
          const auto* reflection = message.GetReflection();
          if (field->is_repeated()) {
            const int last = reflection->FieldSize(message, field) - 1;
            reflection->SetRepeatedDouble(&message, field, last, bad);
          } else {
            reflection->SetDouble(&message, field, bad);
          }
          return true;
        },
        [&](const Frame& frame, const std::string& path) {
          SCOPED_TRACE(testing::Message() << path << " = " << bad);
          ++tried;
          const bool is_unknown_contact =
              std::is_same_v<TypeParam, PhysicsBatch> &&
              (path == "penetration_m" || path == "stiffness_newton_per_m");
          const bool is_unknown_torque =
              std::is_same_v<TypeParam, DeviceBatch> && path == "wrist_torque_on_hand_newton_m";
          const bool is_allowed =
              path == "f_max_newton" || (std::isnan(bad) && is_unknown_torque) ||
              (std::isnan(bad) && (is_unknown_contact || ends_with_one_of(path, may_be_nan)));
          if (is_allowed) {
            TypeParam message;
            EXPECT_STREQ(name(decoded(frame, message)), "none");
          } else {
            expect_refused<TypeParam>(frame, DecodeError::kNotFinite);
          }
        });
  }
  const bool has_none = std::is_same_v<TypeParam, Acknowledgement>;  // no number with a fraction
  EXPECT_GE(tried, has_none ? 0 : 3);
}

TYPED_TEST(CodecOf, RefusesTimesWhoseDifferenceCouldOverflow) {
  const std::int64_t limit = std::int64_t{1} << 61;
  int tried = 0;
  for (const std::int64_t bad : {limit + 1, -limit - 1, std::numeric_limits<std::int64_t>::min()}) {
    with_each_field<TypeParam>(
        [&](auto& message, const auto* field) {
          if (field->cpp_type() != FieldDescriptor::CPPTYPE_INT64) return false;
          const auto* reflection = message.GetReflection();
          if (field->is_repeated()) {
            reflection->SetRepeatedInt64(&message, field, 0, bad);
          } else {
            reflection->SetInt64(&message, field, bad);
          }
          return true;
        },
        [&](const Frame& frame, const std::string& path) {
          SCOPED_TRACE(testing::Message() << path << " = " << bad);
          ++tried;
          expect_refused<TypeParam>(frame, DecodeError::kOutOfRange);
        });
  }
  EXPECT_GE(tried, 3);
}

TYPED_TEST(CodecOf, RefusesColumnsOfUnequalLength) {
  with_each_field<TypeParam>(
      [](auto& message, const auto* field) {
        if (!field->is_repeated() || field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
          return false;
        }
        message.GetReflection()->RemoveLast(&message, field);
        return true;
      },
      [](const Frame& frame, const std::string& path) {
        SCOPED_TRACE(path);
        expect_refused<TypeParam>(frame, DecodeError::kOutOfRange);
      });
}

TEST(DecodeErrors, GiveTheRemedyForAnOlderPeer) {
  EXPECT_EQ(explain(DecodeError::kWrongVersion, 2),
            "peer speaks protocol 2, this program speaks 1: update the older one");
}

TEST(DecodeErrors, HaveDifferentNamesAndExplanations) {
  std::set<std::string> names;
  std::set<std::string> explanations;
  for (std::size_t i = 0; i < kDecodeErrors; ++i) {
    names.insert(name(static_cast<DecodeError>(i)));
    explanations.insert(explain(static_cast<DecodeError>(i)));
  }
  EXPECT_EQ(names.size(), kDecodeErrors);
  EXPECT_EQ(explanations.size(), kDecodeErrors);
}

}  // namespace
}  // namespace palpate
