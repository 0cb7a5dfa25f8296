// SPDX-License-Identifier: Apache-2.0
// The rules of each hop's messages.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <string>

#include "tests/unit/link/codec_test_support.h"

namespace palpate {
namespace {

using test::closed;
using test::decoded;
using test::encoded;
using test::expect_range;
using test::expect_refused;
using test::full_message;
using test::opened;
using test::same;

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

TEST(DeviceStateCodec, RefusesOrientationsThatAreNotUnitAndNormalisesAlmostUnitOnes) {
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

TEST(DeviceStateCodec, RefusesMoreThan64AppliedForces) {
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
  expect_range<DeviceState>(with(64), true);
  expect_range<DeviceState>(with(65), false);
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

TEST(DeviceStateCodec, RefusesALeaseThatEndedBeforeTheReadingOrOutlastsASecond) {
  auto until = [](std::int64_t after_ns) {
    return [=](v1::DeviceState& m) {
      m.mutable_header()->set_sampled_at_ns(1'000);
      m.set_acting_until_ns(1'000 + after_ns);
    };
  };
  expect_range<DeviceState>(until(0), true);
  expect_range<DeviceState>(until(1'000'000'000), true);
  expect_range<DeviceState>(until(-1), false);
  expect_range<DeviceState>(until(1'000'000'001), false);
  expect_range<DeviceState>(until(std::numeric_limits<std::int64_t>::max() - 1'000), false);
}

TEST(DeviceStateCodec, RefusesAnActingForceOfMoreThanAKilonewton) {
  auto force = [](double newton) {
    return [=](v1::DeviceState& m) { m.mutable_acting_force_on_hand_newton()->set_x(newton); };
  };
  expect_range<DeviceState>(force(-1000.0), true);
  expect_range<DeviceState>(force(1000.001), false);
}

TEST(ForceCommandCodec, RefusesAReadingOutsideTheRangeOfTimes) {
  auto at = [](std::int64_t ns) {
    return [=](v1::ForceCommand& m) { m.mutable_answers()->set_sampled_at_ns(ns); };
  };
  expect_range<ForceCommand>(at(std::int64_t{1} << 61), true);
  expect_range<ForceCommand>(at((std::int64_t{1} << 61) + 1), false);
  expect_range<ForceCommand>(at(std::numeric_limits<std::int64_t>::min()), false);
}

TEST(ForceCommandCodec, AllowsForcesUpToAKilonewton) {
  auto force = [](double newton) {
    return [=](v1::ForceCommand& m) { m.mutable_force_on_hand_newton()->set_y(newton); };
  };
  expect_range<ForceCommand>(force(1000.0), true);
  expect_range<ForceCommand>(force(1000.001), false);
  expect_range<ForceCommand>(force(-1000.001), false);
}

TEST(ForceCommandCodec, AllowsLeasesFromZeroToOneSecond) {
  auto lease = [](std::int64_t ns) { return [=](v1::ForceCommand& m) { m.set_valid_for_ns(ns); }; };
  expect_range<ForceCommand>(lease(0), true);
  expect_range<ForceCommand>(lease(1'000'000'000), true);
  expect_range<ForceCommand>(lease(1'000'000'001), false);
  expect_range<ForceCommand>(lease(-1), false);
}

TEST(ForceCommandCodec, AllowsDeadlinesFromZeroToOneSecond) {
  auto within = [](std::int64_t ns) {
    return [=](v1::ForceCommand& m) { m.set_begins_within_ns(ns); };
  };
  expect_range<ForceCommand>(within(0), true);
  expect_range<ForceCommand>(within(1'000'000'000), true);
  expect_range<ForceCommand>(within(1'000'000'001), false);
  expect_range<ForceCommand>(within(-1), false);
}

TEST(ForceCommandCodec, RefusesAnAnswerToSessionZero) {
  expect_range<ForceCommand>([](auto& m) { m.mutable_answers()->set_session_id(0); }, false);
}

template <class T>
void expect_wave_ranges() {
  const auto expect = [](auto&& change, bool is_allowed) {
    expect_range<T>(
        [&](auto& m) {
          auto& wave = *m.mutable_wave();
          wave.mutable_sum()->set_x(1.0);
          wave.set_energy_joule(1.0);
          wave.set_impedance_newton_s_per_m(2.0);
          change(wave);
        },
        is_allowed);
  };
  expect([](auto&) {}, true);
  expect([](auto& wave) { wave.mutable_sum()->set_y(-1e6); }, true);
  expect([](auto& wave) { wave.mutable_sum()->set_y(-1.1e6); }, false);
  expect([](auto& wave) { wave.set_energy_joule(-1e-12); }, false);
  expect([](auto& wave) { wave.set_energy_joule(1.1e9); }, false);
  expect([](auto& wave) { wave.set_impedance_newton_s_per_m(0.0); }, false);
  expect([](auto& wave) { wave.set_impedance_newton_s_per_m(1.1e4); }, false);
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
  expect_wave_ranges<ToolMotion>();
}

TEST(InteractionCodec, RefusesWhatIsOutOfRange) {
  expect_range<Interaction>([](auto& m) { m.mutable_answers()->set_session_id(0); }, false);
  expect_range<Interaction>([](auto& m) { m.mutable_tool_position_world_m()->set_z(1000.1); },
                            false);
  expect_range<Interaction>([](auto& m) { m.mutable_tool_orientation_world()->set_w(2.0); }, false);
  expect_range<Interaction>([](auto& m) { m.mutable_force_on_tool_newton()->set_z(1e4); }, true);
  expect_range<Interaction>([](auto& m) { m.mutable_force_on_tool_newton()->set_z(1.01e4); },
                            false);
  expect_range<Interaction>([](auto& m) { m.set_stored_energy_joule(0.0); }, true);
  expect_range<Interaction>([](auto& m) { m.set_stored_energy_joule(-1e-12); }, false);
  expect_range<Interaction>([](auto& m) { m.set_stored_energy_joule(1001.0); }, false);
  expect_wave_ranges<Interaction>();
}

TEST(ToolMotionCodec, RefusesAnInvalidReportOfTheJaws) {
  const auto report = [](auto&& change, bool is_allowed) {
    expect_range<ToolMotion>(
        [&](auto& m) {
          v1::GripReport& grip = *m.mutable_grip();
          grip.set_physics_session_id(1);
          grip.set_number(1);
          grip.mutable_slip_m()->set_x(0.01);
          change(grip);
        },
        is_allowed);
  };
  report([](v1::GripReport&) {}, true);
  report([](v1::GripReport& g) { g.set_physics_session_id(0); }, false);
  report([](v1::GripReport& g) { g.set_number(0); }, false);
  report([](v1::GripReport& g) { g.mutable_slip_m()->set_y(1000.1); }, false);
}

TEST(InteractionCodec, RefusesAnInvalidGrip) {
  const auto held = [](auto&& change, bool is_allowed) {
    expect_range<Interaction>(
        [&](auto& m) {
          v1::Contact& c = *m.mutable_contacts(0);
          const double penetration_m = std::abs(c.penetration_m());
          c.clear_curvature_per_m();
          c.clear_d_force_d_position();
          c.clear_d_force_d_velocity();
          for (int i = 0; i < 9; ++i) c.add_d_force_d_position(i % 4 == 0 ? -200.0 : -50.0);
          c.set_hunt_crossley_exponent(0.0);
          c.set_friction_coefficient(0.0);
          c.set_is_adhesive(true);
          c.set_penetration_m(penetration_m);
          v1::Grip& grip = *c.mutable_grip();
          grip.set_number(1);
          grip.set_buttons(1);
          grip.set_slip_newton(5.0);
          grip.set_tear_newton(8.0);
          grip.set_reach_m(0.01);
          grip.mutable_slip_m()->set_x(0.001);
          change(c);
        },
        is_allowed);
  };
  held([](v1::Contact&) {}, true);
  held([](v1::Contact& c) { c.mutable_grip()->set_number(0); }, false);
  held([](v1::Contact& c) { c.mutable_grip()->set_buttons(0); }, false);
  held([](v1::Contact& c) { c.mutable_grip()->set_slip_newton(0.0); }, false);
  held([](v1::Contact& c) { c.mutable_grip()->set_tear_newton(1.01e4); }, false);
  held([](v1::Contact& c) { c.mutable_grip()->set_reach_m(-1e-9); }, false);
  held([](v1::Contact& c) { c.mutable_grip()->mutable_slip_m()->set_z(1000.1); }, false);
  held([](v1::Contact& c) { c.set_is_adhesive(false); }, false);
  held([](v1::Contact& c) { c.set_friction_coefficient(0.1); }, false);
  // not symmetric, not positive definite, not there
  held([](v1::Contact& c) { c.set_d_force_d_position(1, -50.001); }, false);
  held([](v1::Contact& c) { c.set_d_force_d_position(0, -10.0); }, false);
  held([](v1::Contact& c) { c.set_d_force_d_position(0, 200.0); }, false);
  held([](v1::Contact& c) { c.clear_d_force_d_position(); }, false);
  // likewise the damping, which may be left out
  const auto damped = [](double along, double across) {
    return [=](v1::Contact& c) {
      for (int i = 0; i < 9; ++i) c.add_d_force_d_velocity(i % 4 == 0 ? along : across);
    };
  };
  held(damped(-1.0, -0.2), true);
  held(damped(1.0, 0.2), false);
  // a needle, which needs no button
  const auto pierced = [&](auto&& change, bool is_allowed) {
    held(
        [&](v1::Contact& c) {
          c.mutable_grip()->set_buttons(0);
          v1::Needle& needle = *c.mutable_grip()->mutable_needle();
          needle.mutable_inward_world()->set_z(-1.0);
          needle.set_cutting_newton(0.2);
          needle.set_friction_newton_per_m(10.0);
          change(needle);
        },
        is_allowed);
  };
  pierced([](v1::Needle&) {}, true);
  pierced([](v1::Needle& n) { n.set_deepest_m(1000.0); }, true);
  pierced([](v1::Needle& n) { n.mutable_inward_world()->set_x(0.01); }, false);
  pierced([](v1::Needle& n) { n.set_cutting_newton(1.01e4); }, false);
  pierced([](v1::Needle& n) { n.set_spreading_newton(-1e-9); }, false);
  pierced([](v1::Needle& n) { n.set_friction_newton_per_m(1.01e6); }, false);
  pierced([](v1::Needle& n) { n.set_deepest_m(-1e-9); }, false);
  pierced([](v1::Needle& n) { n.set_friction_newton(1e4); }, true);
  pierced([](v1::Needle& n) { n.set_friction_newton(1.01e4); }, false);
  pierced([](v1::Needle& n) { n.set_friction_newton(-1e-9); }, false);
  // a blade: its edge is at a right angle to where it cuts
  pierced([](v1::Needle& n) { n.mutable_edge_world()->set_x(1.0); }, true);
  pierced([](v1::Needle& n) { n.mutable_edge_world()->set_x(1.01); }, false);
  pierced([](v1::Needle& n) { n.mutable_edge_world(); }, false);
  pierced(
      [](v1::Needle& n) {
        n.mutable_edge_world()->set_x(std::sqrt(1.0 - 1e-10));
        n.mutable_edge_world()->set_z(1e-5);
      },
      false);
}

// What a needle says is what it said before there were blades.
TEST(InteractionCodec, ANeedleHasNothingOfABladeOnTheWire) {
  Random random(6);
  for (int i = 0; i < 100; ++i) {
    auto said = test::random_message<Interaction>(random);
    if (!said.contacts[0].grip.needle.is_there()) continue;
    said.contacts[0].grip.needle.edge_world.setZero();
    said.contacts[0].grip.needle.friction_newton = 0.0;
    const auto wire = opened<Interaction>(encoded(said));
    const v1::Needle& needle = wire.contacts(0).grip().needle();
    EXPECT_FALSE(needle.has_edge_world());
    EXPECT_EQ(needle.friction_newton(), 0.0);
    EXPECT_EQ(needle.GetReflection()->GetUnknownFields(needle).field_count(), 0);
  }
}

// Nothing of a gripper travels where none is: hops 2 and 3 are what they were, byte for byte.
TEST(InteractionCodec, ASessionWithoutAGripperHasNoneOnTheWire) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    auto said = test::random_message<Interaction>(random);
    for (Contact& contact : said.contacts) contact.grip = {};
    const auto wire = opened<Interaction>(encoded(said));
    for (const v1::Contact& contact : wire.contacts()) EXPECT_FALSE(contact.has_grip());
    auto motion = test::random_message<ToolMotion>(random);
    motion.grip.reset();
    EXPECT_FALSE(opened<ToolMotion>(encoded(motion)).has_grip());
  }
}

TEST(InteractionCodec, RefusesInvalidContacts) {
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
  contact([](v1::Contact& c) { c.mutable_force_on_tool_newton()->set_x(-1.01e4); }, false);
  contact([](v1::Contact& c) { c.mutable_elastic_force_on_tool_newton()->set_x(-1.01e4); }, false);
  contact([](v1::Contact& c) { c.set_curvature_per_m(4, 1.01e9); }, false);
  contact([](v1::Contact& c) { c.clear_curvature_per_m(); }, true);
  contact([](v1::Contact& c) { c.add_curvature_per_m(0.0); }, false);
  contact([](v1::Contact& c) { c.set_d_force_d_position(8, -1.01e7); }, false);
  contact([](v1::Contact& c) { c.mutable_d_force_d_position()->RemoveLast(); }, false);
  contact([](v1::Contact& c) { c.set_d_force_d_velocity(0, 1.01e4); }, false);
  contact([](v1::Contact& c) { c.mutable_surface_velocity_world_m_per_s()->set_y(10.1); }, false);
  contact([](v1::Contact& c) { c.set_stiffening_newton_per_m2(1.01e10); }, false);
  contact([](v1::Contact& c) { c.set_stiffening_newton_per_m3(-1.01e9); }, false);
  contact([](v1::Contact& c) { c.set_stored_energy_joule(-1e-12); }, false);
  contact([](v1::Contact& c) { c.set_stored_energy_joule(1001.0); }, false);
  contact([](v1::Contact& c) { c.set_trust_radius_m(0.0); }, false);
  contact([](v1::Contact& c) { c.set_trust_radius_m(1000.1); }, false);
  contact([](v1::Contact& c) { c.set_hunt_crossley_exponent(0.99); }, false);
  contact([](v1::Contact& c) { c.set_hunt_crossley_exponent(5.01); }, false);
  contact([](v1::Contact& c) { c.clear_hunt_crossley_exponent(); }, true);
  contact([](v1::Contact& c) { c.set_hunt_crossley_depth_m(0.9e-4); }, false);
  contact([](v1::Contact& c) { c.set_hunt_crossley_depth_m(0.11); }, false);
  contact([](v1::Contact& c) { c.set_hunt_crossley_stiffness_newton_per_m(-1e-9); }, false);
  contact([](v1::Contact& c) { c.set_hunt_crossley_stiffness_newton_per_m(1.01e6); }, false);
  contact([](v1::Contact& c) { c.set_hunt_crossley_damping_newton_s_per_m(1.01e4); }, false);
  contact([](v1::Contact& c) { c.set_friction_coefficient(-1e-9); }, false);
  contact([](v1::Contact& c) { c.set_friction_coefficient(10.1); }, false);
  contact([](v1::Contact& c) { c.set_friction_stiffness_newton_per_m(-1e-9); }, false);
  contact([](v1::Contact& c) { c.set_friction_stiffness_newton_per_m(1.01e6); }, false);
  contact([](v1::Contact& c) { c.mutable_stretch_m()->set_z(-1001); }, false);
}

TEST(InteractionCodec, ListsContactsThatTouchThenNearOnes) {
  Interaction sent = full_message<Interaction>();
  for (Contact& contact : sent.contacts) contact = sent.contacts[0];
  sent.contact_count = 20;
  sent.listed_count = kMaxContacts;

  Interaction received;
  ASSERT_EQ(decoded(encoded(sent), received), DecodeError::kNone);
  EXPECT_EQ(received.contact_count, 20u);
  EXPECT_TRUE(same(sent, received));

  // contacts that touch are listed as far as there is room
  auto with = [](int touching, int near, std::uint32_t count) {
    return [=](v1::Interaction& m) {
      v1::Contact one = m.contacts(0);
      one.clear_d_force_d_velocity();  // so that one contact too many still fits into the frame
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

TEST(TelemetryCodec, RefusesUnknownStates) {
  expect_range<DeviceBatch>([](auto& m) { m.set_guard(0, 5); }, true);
  expect_range<DeviceBatch>([](auto& m) { m.set_guard(0, 6); }, false);
  expect_range<DeviceBatch>([](auto& m) { m.mutable_counters()->set_last_fault(16); }, true);
  expect_range<DeviceBatch>([](auto& m) { m.mutable_counters()->set_last_fault(17); }, false);
  expect_range<DeviceBatch>([](auto& m) { m.mutable_counters()->set_phase(6); }, true);
  expect_range<DeviceBatch>([](auto& m) { m.mutable_counters()->set_phase(7); }, false);
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

TEST(TelemetryCodec, OmitsIdentityOrientations) {
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
    return [x](auto& mesh) {
      mesh.set_vertices_m(packed(x) + packed(0.0F) + packed(0.0F));
      mesh.set_vertex_strain(packed(0.1F));
    };
  };
  expect_range<MeshFrame>(at(1000.0F), true);
  expect_range<MeshFrame>(at(1001.0F), false);
}

TEST(SceneCodec, OmitsAZeroDisplacement) {
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

TEST(SceneCodec, RefusesTrianglesOfMissingVertices) {
  const auto with_triangle = [](std::uint32_t last) {
    return [last](auto& scene) {
      auto& tissue = *scene.mutable_tissues(0);
      tissue.set_vertices_m(std::string(std::size_t{3} * 12, '\0'));  // three vertices
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
        Alter([](auto& s) { s.mutable_reach()->mutable_half_extent_m()->set_y(0); }),
        Alter([](auto& s) { s.mutable_reach()->mutable_center_m()->set_z(1001); }),
        Alter([](auto& s) { s.mutable_pointer()->set_reach_m(0); }),
        Alter([](auto& s) { s.mutable_pointer()->set_speed_m_per_s(0); }),
        Alter([](auto& s) { s.mutable_pointer()->set_holder_timeout_ns(0); }),
        Alter([](auto& s) { s.mutable_tissues(0)->set_stiffness_newton_per_m(-1); })}) {
    expect_range<SceneState>(alter, false);
  }
}

TEST(SceneCodec, ReadsShapesOfNewerVersionsAsUnknown) {
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
  tissue.mesh.vertices_m.assign(std::size_t{3} * 300'000, 1.0F);
  tissue.mesh.triangles.assign(std::size_t{3} * 600'000, 7);
  EXPECT_LE(Codec<SceneState>().encode(scene), kMaxFrameBytes<SceneState>);
}

TEST(HandTargetCodec, RefusesATargetWithoutHolderOrTooFar) {
  expect_range<HandTarget>([](auto& t) { t.set_holder_id(0); }, false);
  expect_range<HandTarget>([](auto& t) { t.mutable_hand_position_m()->set_x(1001.0); }, false);
}

TEST(AcknowledgementCodec, RefusesOneOfNoDeviceOrOfADeviceThatWaitsForNone) {
  expect_range<Acknowledgement>([](auto& a) { a.set_device_session_id(0); }, false);
  for (const std::uint32_t phase : {2U, 3U, 5U}) {
    expect_range<Acknowledgement>([&](auto& a) { a.set_phase(phase); }, true);
  }
  for (const std::uint32_t phase : {0U, 1U, 4U, 6U, 7U, 258U, 0xFFFFFFFFU}) {
    expect_range<Acknowledgement>([&](auto& a) { a.set_phase(phase); }, false);
  }
}

TEST(TissueChangeCodec, RefusesConstantsThatNoTissueHas) {
  const auto change = [](double k, double b, bool is_accepted) {
    expect_range<TissueChange>(
        [&](auto& c) {
          c.set_stiffness_newton_per_m(k);
          c.set_damping_newton_s_per_m(b);
        },
        is_accepted);
  };
  change(1e6, 1e4, true);
  change(0.0, 1e-3, true);
  change(0.0, 0.0, false);
  change(-1.0, 1.0, false);
  change(1.0, -1.0, false);
  change(1.001e6, 0.0, false);
  change(1.0, 1.001e4, false);
}

TEST(TissueChangeCodec, RestoresABodyOrSetsConstants) {
  expect_range<TissueChange>([](auto& c) { c.set_restores(true); }, false);
  expect_range<TissueChange>(
      [](auto& c) {
        c.set_restores(true);
        c.set_stiffness_newton_per_m(0.0);
        c.set_damping_newton_s_per_m(0.0);
      },
      true);
}

TEST(WristOnTheWire, RangesAreThoseOfTheContract) {
  using Altered = std::function<void(v1::DeviceState&)>;
  const auto good = [](const Altered& alter) { expect_range<DeviceState>(alter, true); };
  const auto bad = [](const Altered& alter) { expect_range<DeviceState>(alter, false); };
  good([](auto& w) { w.mutable_wrist()->mutable_angle_rad()->set_x(1000.0); });
  bad([](auto& w) { w.mutable_wrist()->mutable_angle_rad()->set_x(1000.1); });
  bad([](auto& w) { w.mutable_wrist()->mutable_second_axis()->set_y(2.0); });
  good([](auto& w) { w.mutable_wrist()->mutable_acting_torque_on_hand_newton_m()->set_z(-100.0); });
  bad([](auto& w) { w.mutable_wrist()->mutable_acting_torque_on_hand_newton_m()->set_z(-100.1); });
  bad([](auto& w) { w.mutable_applied(0)->mutable_wrist_torque_on_hand_newton_m()->set_x(101.0); });
  expect_range<ForceCommand>(
      [](auto& w) { w.mutable_wrist_torque_on_hand_newton_m()->set_x(100.1); }, false);
  const auto turning = [](double rad_per_s, bool is_accepted) {
    expect_range<ToolMotion>(
        [&](auto& w) { w.mutable_tool_angular_velocity_world_rad_per_s()->set_y(rad_per_s); },
        is_accepted);
  };
  turning(-1000.0, true);
  turning(1000.1, false);
  expect_range<Interaction>([](auto& w) { w.mutable_contacts(0)->mutable_arm_m()->set_x(1000.1); },
                            false);
  expect_range<Interaction>([](auto& w) { w.mutable_torque_on_tool_newton_m()->set_x(10000.1); },
                            false);
}

// Without a wrist nothing is said of its torques, as before there were any.
TEST(WristOnTheWire, WithoutOneTheMessagesHaveNoneOfItsFields) {
  DeviceState state;
  state.header = {.session_id = 1};
  state.applied_count = 1;
  const auto wire = opened<DeviceState>(encoded(state));
  EXPECT_FALSE(wire.has_wrist());
  EXPECT_FALSE(wire.applied(0).has_wrist_torque_on_hand_newton_m());
  EXPECT_FALSE(wire.applied(0).has_wrist_angle_at_end_rad());
  ForceCommand command;
  command.header = {.session_id = 1};
  EXPECT_FALSE(opened<ForceCommand>(encoded(command)).has_wrist_torque_on_hand_newton_m());
}

}  // namespace
}  // namespace palpate
