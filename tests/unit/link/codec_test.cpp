// Every message there and back, and every way to break one.
#include "common/link/codec/codec.h"

#include <google/protobuf/message.h>
#include <gtest/gtest.h>

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "palpate/v1/exchange.pb.h"
#include "palpate/v1/hand_target.pb.h"
#include "palpate/v1/interaction.pb.h"
#include "palpate/v1/scene.pb.h"
#include "palpate/v1/telemetry.pb.h"
#include "palpate/v1/tool_motion.pb.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/random_messages.h"

namespace palpate {
namespace {

using test::random_message;
using test::same;
using Frame = std::vector<std::byte>;

template <class T>
Frame encoded(const T& message) {
  Codec<T> codec;
  Frame frame(codec.encode(message));
  codec.write(frame.data());
  return frame;
}

template <class T>
DecodeError decoded(const Frame& frame, T& message) {
  Codec<T> codec;
  return codec.decode(frame, message);
}

template <class T>
struct Wire;
template <>
struct Wire<DeviceState> {
  using Message = v1::DeviceState;
};
template <>
struct Wire<ForceCommand> {
  using Message = v1::ForceCommand;
};
template <>
struct Wire<ToolMotion> {
  using Message = v1::ToolMotion;
};
template <>
struct Wire<Interaction> {
  using Message = v1::Interaction;
};
template <>
struct Wire<DeviceBatch> {
  using Message = v1::DeviceTelemetry;
};
template <>
struct Wire<MofcBatch> {
  using Message = v1::MofcTelemetry;
};
template <>
struct Wire<PhysicsBatch> {
  using Message = v1::PhysicsTelemetry;
};
template <>
struct Wire<SceneState> {
  using Message = v1::SceneState;
};
template <>
struct Wire<MeshFrame> {
  using Message = v1::MeshFrame;
};
template <>
struct Wire<HandTarget> {
  using Message = v1::HandTarget;
};

/// The protobuf message inside a frame, to be broken.
template <class T>
typename Wire<T>::Message opened(const Frame& frame) {
  typename Wire<T>::Message wire;
  EXPECT_TRUE(wire.ParseFromArray(frame.data() + 1, static_cast<int>(frame.size() - 1)));
  return wire;
}
template <class T>
Frame closed(const google::protobuf::Message& wire) {
  Frame frame(1 + wire.ByteSizeLong());
  frame[0] = static_cast<std::byte>(kKindOf<T>);
  EXPECT_TRUE(wire.SerializeToArray(frame.data() + 1, static_cast<int>(frame.size() - 1)));
  return frame;
}

/// A valid message with something in every part: at least two rows, touches and applied forces.
template <class T>
T full_message();
template <>
DeviceState full_message() {
  Random random(7);
  DeviceState m;
  do m = random_message<DeviceState>(random);
  while (m.applied_count < 2);
  m.applied[0].has_position_at_end = true;
  return m;
}
template <>
ForceCommand full_message() {
  Random random(7);
  return random_message<ForceCommand>(random);
}
template <>
ToolMotion full_message() {
  Random random(7);
  return random_message<ToolMotion>(random);
}
template <>
Interaction full_message() {
  Random random(7);
  Interaction m;
  do m = random_message<Interaction>(random);
  while (m.contact_count < 2);
  return m;
}
template <class Batch>
Batch full_batch() {
  Random random(7);
  Batch m;
  do m = random_message<Batch>(random);
  while (m.records.size() < 2);
  return m;
}
template <>
DeviceBatch full_message() {
  return full_batch<DeviceBatch>();
}
template <>
MofcBatch full_message() {
  return full_batch<MofcBatch>();
}
template <>
PhysicsBatch full_message() {
  return full_batch<PhysicsBatch>();
}
template <>
SceneState full_message() {
  Random random(7);
  SceneState m;
  do m = random_message<SceneState>(random);
  while (m.tissues.size() < 2 || m.tissues[0].mesh.triangles.empty() ||
         m.tissues[0].vertex_stiffness_newton_per_m.empty() || !m.pointer);
  return m;
}
template <>
MeshFrame full_message() {
  Random random(7);
  return random_message<MeshFrame>(random);
}
template <>
HandTarget full_message() {
  Random random(7);
  return random_message<HandTarget>(random);
}

/// The frame is refused for `error`, and the message it was to be read into is as before.
template <class T>
void expect_refused(const Frame& frame, DecodeError error) {
  Random random(99);
  const T before = random_message<T>(random);
  T message = before;
  EXPECT_STREQ(name(decoded(frame, message)), name(error));
  EXPECT_TRUE(same(message, before)) << "a refused frame changed the message";
}

template <class T>
class CodecOf : public testing::Test {};
using Messages = testing::Types<DeviceState, ForceCommand, ToolMotion, Interaction, DeviceBatch,
                                MofcBatch, PhysicsBatch, SceneState, MeshFrame, HandTarget>;
TYPED_TEST_SUITE(CodecOf, Messages);

TYPED_TEST(CodecOf, GivesBackWhatWasSentToTheBit) {
  Codec<TypeParam> codec;  // one codec for all: what it reuses must not leak into the next message
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

TYPED_TEST(CodecOf, IsNeverWholeWhenCutShort) {
  const Frame frame = encoded(full_message<TypeParam>());
  TypeParam message;
  for (std::size_t size = 0; size < frame.size(); ++size) {
    const Frame cut(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(size));
    // a cut between two fields leaves a valid protobuf message in which something is missing
    const DecodeError error = decoded(cut, message);
    ASSERT_TRUE(error == DecodeError::kMalformed || error == DecodeError::kMissingField ||
                error == DecodeError::kOutOfRange || error == DecodeError::kNone)
        << size << ": " << name(error);
    if (error != DecodeError::kNone) continue;
    // accepted: then only trailing fields with a default or optional ones are gone
    ASSERT_EQ(decoded(closed<TypeParam>(opened<TypeParam>(cut)), message), DecodeError::kNone);
  }
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

TYPED_TEST(CodecOf, RefusesByLengthBeforeAnythingElse) {
  Frame frame(kMaxFrameBytes<TypeParam> + 1, std::byte{0xff});
  expect_refused<TypeParam>(frame, DecodeError::kTooLarge);

  frame.pop_back();
  expect_refused<TypeParam>(frame, DecodeError::kWrongKind);
}

TYPED_TEST(CodecOf, RefusesWhatIsNotProtobuf) {
  // field 1 with wire type 7, which does not exist
  expect_refused<TypeParam>({static_cast<std::byte>(kKindOf<TypeParam>), std::byte{0x0f}},
                            DecodeError::kMalformed);
}

TYPED_TEST(CodecOf, RefusesAnotherVersionEvenIfNothingElseMakesSense) {
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
      // accepted means usable: it can be sent on, and is accepted again
      Frame again(codec.encode(message));
      codec.write(again.data());
      ASSERT_STREQ(name(codec.decode(again, message)), "none") << "seed=" << seed;
    }
  }
}

// --- every field, found by reflection ---------------------------------------------------------

using google::protobuf::FieldDescriptor;

/// Calls `visit` for every field of every message that is present, with its path.
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

/// Visits every field once on a fresh valid message and hands the altered frame on.
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
    // the visit is in the same order each time; alter number `index`, after the walk
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
        if (path == "applied.hand_position_at_end_m" || path == "pointer" ||
            path == "displacement_world_m") {  // optional
          TypeParam message;
          EXPECT_EQ(decoded(frame, message), DecodeError::kNone);
        } else {
          expect_refused<TypeParam>(frame, DecodeError::kMissingField);
        }
      });
  EXPECT_GE(tried, 1);  // the header at least
}

TYPED_TEST(CodecOf, RefusesNaNAndInfinityInEachNumberThatIsNotDocumentedAsUnknown) {
  const std::set<std::string> may_be_nan = {"true_tool_position_world_m",
                                            "true_tool_velocity_world_m_per_s", "true_energy_joule",
                                            "ledger_energy_joule", "f_max_newton"};
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
          const bool is_allowed =
              path == "f_max_newton" || (std::isnan(bad) && ends_with_one_of(path, may_be_nan));
          if (is_allowed) {
            TypeParam message;
            EXPECT_STREQ(name(decoded(frame, message)), "none");
          } else {
            expect_refused<TypeParam>(frame, DecodeError::kNotFinite);
          }
        });
  }
  EXPECT_GE(tried, 3);
}

TYPED_TEST(CodecOf, RefusesEachTimeThatCouldOverflowASubtraction) {
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

// --- ranges, one by one -----------------------------------------------------------------------

template <class T>
void expect_range(const std::function<void(typename Wire<T>::Message&)>& alter, bool is_good) {
  auto wire = opened<T>(encoded(full_message<T>()));
  alter(wire);
  if (is_good) {
    T message;
    EXPECT_STREQ(name(decoded(closed<T>(wire), message)), "none");
  } else {
    expect_refused<T>(closed<T>(wire), DecodeError::kOutOfRange);
  }
}

TEST(DeviceStateCodec, AllowsPositionsUpToAKilometre) {
  for (const double sign : {-1.0, 1.0}) {
    const double at = sign * 1000.0;
    const double beyond = sign * 1000.001;
    expect_range<DeviceState>([&](auto& m) { m.mutable_hand_position_m()->set_x(at); }, true);
    expect_range<DeviceState>([&](auto& m) { m.mutable_hand_position_m()->set_x(beyond); }, false);
    expect_range<DeviceState>([&](auto& m) { m.mutable_tool_position_world_m()->set_y(beyond); },
                              false);
    expect_range<DeviceState>(
        [&](auto& m) { m.mutable_applied(0)->mutable_hand_position_at_end_m()->set_z(beyond); },
        false);
  }
}

TEST(DeviceStateCodec, RefusesAnOrientationThatIsNotUnitAndMendsOneThatAlmostIs) {
  auto scaled = [](double s) {
    return [s](v1::DeviceState& m) {
      m.mutable_tool_orientation_world()->set_w(s);
      m.mutable_tool_orientation_world()->set_x(0);
      m.mutable_tool_orientation_world()->set_y(0);
      m.mutable_tool_orientation_world()->set_z(0);
    };
  };
  expect_range<DeviceState>(scaled(1.0 + 0.9e-6), true);
  expect_range<DeviceState>(scaled(1.0 - 0.9e-6), true);
  expect_range<DeviceState>(scaled(1.0 + 1.1e-6), false);
  expect_range<DeviceState>(scaled(1.0 - 1.1e-6), false);
  expect_range<DeviceState>(scaled(0.0), false);

  auto wire = opened<DeviceState>(encoded(full_message<DeviceState>()));
  scaled(1.0 + 0.9e-6)(wire);
  DeviceState message;
  ASSERT_EQ(decoded(closed<DeviceState>(wire), message), DecodeError::kNone);
  EXPECT_EQ(message.tool_orientation_world.w(), 1.0);
}

TEST(DeviceStateCodec, RefusesMoreThanFourAppliedForces) {
  auto with = [](int count) {
    return [count](v1::DeviceState& m) {
      const v1::AppliedForce one = m.applied(0);
      m.clear_applied();
      std::int64_t end = one.from_ns();
      for (int i = 0; i < count; ++i) {
        *m.add_applied() = one;
        m.mutable_applied(i)->set_from_ns(end);
        m.mutable_applied(i)->set_until_ns(++end);
      }
    };
  };
  expect_range<DeviceState>(with(4), true);
  expect_range<DeviceState>(with(5), false);
}

TEST(DeviceStateCodec, RefusesAppliedForcesWithAGapOrBackwardsInTime) {
  auto at = [](std::int64_t from, std::int64_t until) {
    return [=](v1::DeviceState& m) {
      while (m.applied_size() > 2) m.mutable_applied()->RemoveLast();
      m.mutable_applied(0)->set_from_ns(100);
      m.mutable_applied(0)->set_until_ns(200);
      m.mutable_applied(1)->set_from_ns(from);
      m.mutable_applied(1)->set_until_ns(until);
    };
  };
  expect_range<DeviceState>(at(200, 300), true);
  expect_range<DeviceState>(at(200, 200), true);  // of no length
  expect_range<DeviceState>(at(201, 300), false);
  expect_range<DeviceState>(at(199, 300), false);
  expect_range<DeviceState>(at(200, 199), false);
}

TEST(DeviceStateCodec, AllowsAppliedForcesUpToAKilonewton) {
  auto force = [](double newton) {
    return [=](v1::DeviceState& m) {
      m.mutable_applied(1)->mutable_force_on_hand_newton()->set_z(newton);
    };
  };
  expect_range<DeviceState>(force(-1000.0), true);
  expect_range<DeviceState>(force(-1000.001), false);
}

TEST(ForceCommandCodec, AllowsForcesUpToAKilonewton) {
  auto force = [](double newton) {
    return [=](v1::ForceCommand& m) { m.mutable_force_on_hand_newton()->set_y(newton); };
  };
  expect_range<ForceCommand>(force(1000.0), true);
  expect_range<ForceCommand>(force(1000.001), false);
  expect_range<ForceCommand>(force(-1000.001), false);
}

TEST(ForceCommandCodec, AllowsALeaseFromNothingToASecond) {
  auto lease = [](std::int64_t ns) { return [=](v1::ForceCommand& m) { m.set_valid_for_ns(ns); }; };
  expect_range<ForceCommand>(lease(0), true);
  expect_range<ForceCommand>(lease(1'000'000'000), true);
  expect_range<ForceCommand>(lease(1'000'000'001), false);
  expect_range<ForceCommand>(lease(-1), false);
}

TEST(ForceCommandCodec, RefusesAnAnswerToSessionZero) {
  expect_range<ForceCommand>([](auto& m) { m.mutable_answers()->set_session_id(0); }, false);
}

TEST(ToolMotionCodec, RefusesWhatIsOutOfRange) {
  expect_range<ToolMotion>([](auto& m) { m.mutable_device()->set_session_id(0); }, false);
  expect_range<ToolMotion>([](auto& m) { m.mutable_tool_position_world_m()->set_x(1000.1); },
                           false);
  expect_range<ToolMotion>([](auto& m) { m.mutable_tool_velocity_world_m_per_s()->set_x(-1000.1); },
                           false);
  expect_range<ToolMotion>([](auto& m) { m.mutable_tool_velocity_world_m_per_s()->set_x(-1000.0); },
                           true);
  expect_range<ToolMotion>([](auto& m) { m.mutable_tool_orientation_world()->set_w(2.0); }, false);
}

TEST(InteractionCodec, RefusesWhatIsOutOfRange) {
  expect_range<Interaction>([](auto& m) { m.mutable_answers()->set_session_id(0); }, false);
  expect_range<Interaction>([](auto& m) { m.mutable_tool_position_world_m()->set_z(1000.1); },
                            false);
  expect_range<Interaction>([](auto& m) { m.mutable_tool_orientation_world()->set_w(2.0); }, false);
  expect_range<Interaction>([](auto& m) { m.mutable_force_on_tool_newton()->set_z(1e6); }, true);
  expect_range<Interaction>([](auto& m) { m.mutable_force_on_tool_newton()->set_z(1.01e6); },
                            false);
  expect_range<Interaction>([](auto& m) { m.set_stored_energy_joule(0.0); }, true);
  expect_range<Interaction>([](auto& m) { m.set_stored_energy_joule(-1e-12); }, false);
}

TEST(InteractionCodec, RefusesAContactThatIsNone) {
  const auto contact = [](auto&& change, bool is_allowed) {
    expect_range<Interaction>([&](auto& m) { change(*m.mutable_contacts(1)); }, is_allowed);
  };
  contact([](v1::Contact& c) { c.set_penetration_m(1000.1); }, false);
  contact(
      [](v1::Contact& c) {
        c.mutable_normal_world()->set_x(0.0);
        c.mutable_normal_world()->set_y(0.0);
        c.mutable_normal_world()->set_z(1.0 + 1.1e-6);
      },
      false);
  contact([](v1::Contact& c) { c.mutable_force_on_tool_newton()->set_x(-1.01e6); }, false);
  contact([](v1::Contact& c) { c.mutable_elastic_force_on_tool_newton()->set_x(-1.01e12); }, false);
  contact([](v1::Contact& c) { c.set_curvature_per_m(4, 1.01e9); }, false);
  contact([](v1::Contact& c) { c.clear_curvature_per_m(); }, true);
  contact([](v1::Contact& c) { c.add_curvature_per_m(0.0); }, false);
  contact([](v1::Contact& c) { c.set_d_force_d_position(8, -1.01e12); }, false);
  contact([](v1::Contact& c) { c.mutable_d_force_d_position()->RemoveLast(); }, false);
  contact([](v1::Contact& c) { c.set_d_force_d_velocity(0, 1.01e12); }, false);
  contact([](v1::Contact& c) { c.mutable_surface_velocity_world_m_per_s()->set_y(1001); }, false);
  contact([](v1::Contact& c) { c.set_stiffening_newton_per_m2(1.01e18); }, false);
  contact([](v1::Contact& c) { c.set_stiffening_newton_per_m3(-1.01e18); }, false);
  contact([](v1::Contact& c) { c.set_stored_energy_joule(-1e-12); }, false);
  contact([](v1::Contact& c) { c.set_trust_radius_m(0.0); }, false);
  contact([](v1::Contact& c) { c.set_trust_radius_m(1000.1); }, false);
  contact([](v1::Contact& c) { c.set_friction_coefficient(-1e-9); }, false);
  contact([](v1::Contact& c) { c.set_friction_coefficient(1000.1); }, false);
  contact([](v1::Contact& c) { c.set_friction_stiffness_newton_per_m(-1e-9); }, false);
  contact([](v1::Contact& c) { c.set_friction_stiffness_newton_per_m(1.01e12); }, false);
  contact([](v1::Contact& c) { c.mutable_stretch_m()->set_z(-1001); }, false);
}

TEST(InteractionCodec, ListsWhatIsTouchedThenWhatIsNear) {
  Interaction sent = full_message<Interaction>();
  for (Contact& contact : sent.contacts) contact = sent.contacts[0];
  sent.contact_count = 20;
  sent.listed_count = kMaxContacts;

  Interaction received;
  ASSERT_EQ(decoded(encoded(sent), received), DecodeError::kNone);
  EXPECT_EQ(received.contact_count, 20u);
  EXPECT_TRUE(same(sent, received));

  // every touch that there is room for is listed
  auto with = [](int touching, int near, std::uint32_t count) {
    return [=](v1::Interaction& m) {
      v1::Contact one = m.contacts(0);
      one.clear_d_force_d_velocity();  // one more than there may be must fit the frame
      m.clear_contacts();
      for (int i = 0; i < touching; ++i) *m.add_contacts() = one;
      one.set_penetration_m(-0.01);
      for (int i = 0; i < near; ++i) *m.add_contacts() = one;
      m.set_contact_count(count);
    };
  };
  expect_range<Interaction>(with(0, 0, 0), true);
  expect_range<Interaction>(with(0, 8, 0), true);
  expect_range<Interaction>(with(8, 0, 9), true);
  expect_range<Interaction>(with(2, 3, 2), true);
  expect_range<Interaction>(with(2, 0, 1), false);
  expect_range<Interaction>(with(2, 1, 3), false);
  expect_range<Interaction>(with(7, 1, 8), false);
  expect_range<Interaction>(with(8, 1, 8), false);
}

TEST(InteractionCodec, FitsItsFrameWithEveryContactFull) {
  Interaction sent = full_message<Interaction>();
  sent.contact_count = sent.listed_count = kMaxContacts;
  for (Contact& contact : sent.contacts) {
    contact = sent.contacts[0];
    contact.tissue = ~0U;
    contact.is_adhesive = true;
  }
  EXPECT_LE(encoded(sent).size(), kMaxFrameBytes<Interaction>);
}

TEST(TelemetryCodec, RefusesStatesItDoesNotKnow) {
  expect_range<DeviceBatch>([](auto& m) { m.set_guard(0, 5); }, true);
  expect_range<DeviceBatch>([](auto& m) { m.set_guard(0, 6); }, false);
  expect_range<DeviceBatch>([](auto& m) { m.mutable_counters()->set_last_fault(4); }, true);
  expect_range<DeviceBatch>([](auto& m) { m.mutable_counters()->set_last_fault(5); }, false);
  expect_range<MofcBatch>([](auto& m) { m.set_state(1, 4); }, true);
  expect_range<MofcBatch>([](auto& m) { m.set_state(1, 5); }, false);
}

TEST(TelemetryCodec, CarriesABatchWithoutTicks) {
  DeviceBatch sent = full_message<DeviceBatch>();
  sent.records.clear();
  DeviceBatch received = full_message<DeviceBatch>();
  ASSERT_EQ(decoded(encoded(sent), received), DecodeError::kNone);
  EXPECT_TRUE(same(sent, received));
}

TEST(TelemetryCodec, FitsFourThousandTicksIntoOneBatch) {
  DeviceBatch sent = full_message<DeviceBatch>();
  sent.records.assign(4000, sent.records.front());
  EXPECT_LE(encoded(sent).size(), kMaxFrameBytes<DeviceBatch>);
}

TEST(TelemetryCodec, CarriesNoOrientationsOfAToolThatNeverTurns) {
  DeviceBatch sent = full_message<DeviceBatch>();
  for (DeviceTick& tick : sent.records) tick.measured_tool_orientation_world.setIdentity();
  EXPECT_TRUE(opened<DeviceBatch>(encoded(sent)).measured_tool_orientation_world().empty());
  DeviceBatch received = full_message<DeviceBatch>();
  ASSERT_EQ(decoded(encoded(sent), received), DecodeError::kNone);
  EXPECT_TRUE(same(sent, received));

  sent.records.back().measured_tool_orientation_world = Quaternion(0.6, 0.8, 0.0, 0.0);
  ASSERT_EQ(decoded(encoded(sent), received), DecodeError::kNone);
  EXPECT_TRUE(same(sent, received));
}

// --- packed arrays ----------------------------------------------------------------------------

std::string packed(float x) { return {reinterpret_cast<const char*>(&x), sizeof(x)}; }
std::string packed(std::uint32_t n) { return {reinterpret_cast<const char*>(&n), sizeof(n)}; }

TEST(SceneCodec, RefusesVerticesThatAreNotTriples) {
  expect_range<SceneState>(
      [](auto& scene) { scene.mutable_tissues(0)->mutable_vertices_m()->append(packed(0.0F)); },
      false);
  expect_range<MeshFrame>([](auto& mesh) { mesh.mutable_vertices_m()->append("abc"); }, false);
}

TEST(SceneCodec, RefusesVerticesThatAreNotFiniteOrTooFar) {
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    auto wire = opened<MeshFrame>(encoded(full_message<MeshFrame>()));
    wire.set_vertices_m(packed(0.0F) + packed(bad) + packed(0.0F));
    expect_refused<MeshFrame>(closed<MeshFrame>(wire), DecodeError::kNotFinite);
  }
  const auto at = [](float x) {
    return [x](auto& mesh) { mesh.set_vertices_m(packed(x) + packed(0.0F) + packed(0.0F)); };
  };
  expect_range<MeshFrame>(at(1000.0F), true);
  expect_range<MeshFrame>(at(1001.0F), false);
}

TEST(SceneCodec, CarriesADisplacementOnlyOfTissueThatHasOne) {
  MeshFrame sent = full_message<MeshFrame>();
  sent.displacement_world_m.setZero();
  EXPECT_FALSE(opened<MeshFrame>(encoded(sent)).has_displacement_world_m());
  MeshFrame received = full_message<MeshFrame>();
  ASSERT_EQ(decoded(encoded(sent), received), DecodeError::kNone);
  EXPECT_TRUE(same(sent, received));

  const auto by = [](double y) {
    return [y](auto& mesh) { mesh.mutable_displacement_world_m()->set_y(y); };
  };
  expect_range<MeshFrame>(by(-1000.0), true);
  expect_range<MeshFrame>(by(-1000.1), false);
}

TEST(SceneCodec, RefusesTrianglesOfVerticesThatAreNotThere) {
  const auto with_triangle = [](std::uint32_t last) {
    return [last](auto& scene) {
      auto& tissue = *scene.mutable_tissues(0);
      tissue.set_vertices_m(std::string(3 * 12, '\0'));  // three vertices
      tissue.clear_vertex_stiffness_newton_per_m();
      tissue.set_triangles(packed(0U) + packed(1U) + packed(last));
    };
  };
  expect_range<SceneState>(with_triangle(2), true);
  expect_range<SceneState>(with_triangle(3), false);
  expect_range<SceneState>([](auto& s) { s.mutable_tissues(0)->set_triangles(packed(0U)); }, false);
}

TEST(SceneCodec, RefusesAStiffnessThatIsNegativeOrNotOnePerVertex) {
  const auto with = [](const std::string& stiffness) {
    return [stiffness](auto& scene) {
      auto& tissue = *scene.mutable_tissues(0);
      tissue.set_vertices_m(std::string(12, '\0'));  // one vertex
      tissue.clear_triangles();
      tissue.set_vertex_stiffness_newton_per_m(stiffness);
    };
  };
  expect_range<SceneState>(with(packed(5.0F)), true);
  expect_range<SceneState>(with(packed(-5.0F)), false);
  expect_range<SceneState>(with(packed(5.0F) + packed(5.0F)), false);
}

TEST(SceneCodec, RefusesWhatIsOutOfRange) {
  using Alter = std::function<void(v1::SceneState&)>;
  for (const Alter& alter :
       {Alter([](auto& s) { s.set_revision(0); }),
        Alter([](auto& s) { s.set_session_name(std::string(65, 'a')); }),
        Alter([](auto& s) { s.set_device_rate_hz(0); }),
        Alter([](auto& s) { s.set_physics_rate_hz(-1); }),
        Alter([](auto& s) { s.set_peak_force_newton(0); }),
        Alter([](auto& s) { s.set_tip_radius_m(-1e-3); }),
        Alter([](auto& s) { s.set_shaft_length_m(-1e-3); }),
        Alter([](auto& s) { s.set_shaft_radius_m(-1e-3); }),
        Alter([](auto& s) { s.set_workspace_scale_ratio(0); }),
        Alter([](auto& s) { s.mutable_pointer()->set_reach_m(0); }),
        Alter([](auto& s) { s.mutable_pointer()->set_speed_m_per_s(0); }),
        Alter([](auto& s) { s.mutable_pointer()->set_holder_timeout_ns(0); }),
        Alter([](auto& s) { s.mutable_tissues(0)->set_stiffness_newton_per_m(-1); })}) {
    expect_range<SceneState>(alter, false);
  }
}

TEST(SceneCodec, TakesAShapeOfANewerVersionAsUnknown) {
  auto wire = opened<SceneState>(encoded(full_message<SceneState>()));
  wire.mutable_tissues(0)->set_shape(static_cast<v1::TissueSurface::Shape>(99));
  SceneState scene;

  ASSERT_STREQ(name(decoded(closed<SceneState>(wire), scene)), "none");

  EXPECT_EQ(scene.tissues[0].shape, TissueShape::kUnknown);
}

TEST(SceneCodec, FitsThreeHundredThousandVerticesAndTwiceAsManyTrianglesIntoOneScene) {
  SceneState scene = full_message<SceneState>();
  scene.tissues.resize(1);
  TissueSurface& tissue = scene.tissues[0];
  tissue.vertex_stiffness_newton_per_m.clear();
  tissue.mesh.vertices_m.assign(3 * 300'000, 1.0F);
  tissue.mesh.triangles.assign(3 * 600'000, 7);
  EXPECT_LE(Codec<SceneState>().encode(scene), kMaxFrameBytes<SceneState>);
}

TEST(HandTargetCodec, RefusesATargetOfNobodyOrTooFar) {
  expect_range<HandTarget>([](auto& t) { t.set_holder_id(0); }, false);
  expect_range<HandTarget>([](auto& t) { t.mutable_hand_position_m()->set_x(1001.0); }, false);
}

TEST(DecodeErrors, SayWhatToDoAboutAnOlderPeer) {
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
