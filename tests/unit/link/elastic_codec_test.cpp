// SPDX-License-Identifier: Apache-2.0
// Elastic bodies on hop 3: a hostile point or state is refused with its whole message.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>

#include "tests/unit/link/codec_test_support.h"

namespace palpate {
namespace {

using test::closed;
using test::decoded;
using test::encoded;
using test::opened;

/// With a point, or a state, and at least two entries in its list.
Interaction message_with(bool has_point) {
  Random random(11);
  Interaction m;
  do test::randomise(m, random);
  while (m.elastic.store_id == 0 || m.elastic.has_point != has_point);
  return m;
}

DecodeError read_after(bool has_point, const std::function<void(v1::Interaction&)>& change) {
  v1::Interaction wire = opened<Interaction>(encoded(message_with(has_point)));
  change(wire);
  Interaction read;
  return decoded(closed<Interaction>(wire), read);
}
void expect_point(const std::function<void(v1::ElasticPoint&)>& change, DecodeError error) {
  EXPECT_EQ(
      read_after(true, [&](v1::Interaction& m) { change(*m.mutable_elastic()->mutable_point()); }),
      error);
}
void expect_state(const std::function<void(v1::ElasticState&)>& change, DecodeError error) {
  EXPECT_EQ(
      read_after(false, [&](v1::Interaction& m) { change(*m.mutable_elastic()->mutable_state()); }),
      error);
}

std::string bytes_of(const std::vector<int>& integers) {
  std::string bytes;
  for (const int x : integers) {
    bytes.push_back(static_cast<char>(x & 0xff));
    bytes.push_back(static_cast<char>(x >> 8 & 0xff));
  }
  return bytes;
}

TEST(ElasticCodec, TakesPointsAndStates) {
  expect_point([](auto&) {}, DecodeError::kNone);
  expect_state([](auto&) {}, DecodeError::kNone);
}

TEST(ElasticCodec, TakesExactlyOneOfThem) {
  EXPECT_EQ(read_after(true, [](v1::Interaction& m) { m.mutable_elastic()->clear_point(); }),
            DecodeError::kMissingField);
  EXPECT_EQ(read_after(true,
                       [](v1::Interaction& m) {
                         *m.mutable_elastic()->mutable_state() =
                             opened<Interaction>(encoded(message_with(false))).elastic().state();
                       }),
            DecodeError::kOutOfRange);
}

TEST(ElasticCodec, RefusesAPointThatPullsItself) {
  const auto own = [](std::vector<int> entries) {
    return [bytes = bytes_of(entries)](v1::ElasticPoint& p) { p.set_own(bytes); };
  };
  expect_point(own({5, 0, 0, 5, 0, 5}), DecodeError::kNone);
  expect_point(own({0, 0, 0, 0, 0, 0}), DecodeError::kNone);
  expect_point(own({-1, 0, 0, 5, 0, 5}), DecodeError::kOutOfRange);
  expect_point(own({5, 6, 0, 5, 0, 5}), DecodeError::kOutOfRange);
  // every 2 × 2 minor is positive, the determinant −50
  expect_point(own({5, -3, -3, 5, -3, 5}), DecodeError::kOutOfRange);
  expect_point(own({32767, 32767, 32767, 32767, 32767, 32767}), DecodeError::kNone);
}

TEST(ElasticCodec, RefusesTornLists) {
  expect_point([](v1::ElasticPoint& p) { p.mutable_own()->pop_back(); }, DecodeError::kOutOfRange);
  expect_point([](v1::ElasticPoint& p) { p.mutable_others()->pop_back(); },
               DecodeError::kOutOfRange);
  expect_state([](v1::ElasticState& s) { s.mutable_places()->push_back('x'); },
               DecodeError::kOutOfRange);
}

TEST(ElasticCodec, RefusesASurfaceThatIsCarriedBeyondTheLimits) {
  const auto carried = [](double way_m, double m_per_s, double at_s) {
    return [=](v1::ElasticState& s) {
      s.mutable_carried_m()->set_x(way_m);
      s.mutable_carried_m_per_s()->set_z(m_per_s);
      s.set_carried_at_s(at_s);
    };
  };
  expect_state(carried(-1000.0, 10.0, -1.0), DecodeError::kNone);
  expect_state(carried(1000.1, 0.0, 0.0), DecodeError::kOutOfRange);
  expect_state(carried(0.0, -10.1, 0.0), DecodeError::kOutOfRange);
  expect_state(carried(0.0, 0.0, std::numeric_limits<double>::infinity()), DecodeError::kNotFinite);
}

TEST(ElasticCodec, RefusesPlacesOfRestThatAreNotOnePerPlaceOfAViscousBody) {
  const auto viscous = [](double relaxation_s, std::size_t rests) {
    return [=](v1::ElasticState& s) {
      s.set_relaxation_s(relaxation_s);
      s.set_rests(std::string(rests * s.places().size() / 17, 'x'));
    };
  };
  expect_state(viscous(0.1, 6), DecodeError::kNone);
  expect_state(viscous(10.0, 0), DecodeError::kNone);
  expect_state(viscous(0.0, 0), DecodeError::kNone);
  expect_state(viscous(0.0, 6), DecodeError::kOutOfRange);
  expect_state(viscous(0.1, 5), DecodeError::kOutOfRange);
  expect_state(viscous(0.1, 7), DecodeError::kOutOfRange);
  expect_state(viscous(10.1, 6), DecodeError::kOutOfRange);
  expect_state(viscous(-0.1, 6), DecodeError::kOutOfRange);
  expect_state(viscous(std::nan(""), 6), DecodeError::kNotFinite);
}

TEST(ElasticCodec, RefusesASlotThatIsNoneOrListedTwice) {
  expect_point([](v1::ElasticPoint& p) { p.mutable_others()->append(p.others().substr(0, 19)); },
               DecodeError::kOutOfRange);
  expect_point([](v1::ElasticPoint& p) { (*p.mutable_others())[0] = static_cast<char>(128); },
               DecodeError::kOutOfRange);
  expect_point([](v1::ElasticPoint& p) { (*p.mutable_others())[0] = static_cast<char>(p.slot()); },
               DecodeError::kOutOfRange);
  expect_state([](v1::ElasticState& s) { s.mutable_places()->append(s.places().substr(0, 17)); },
               DecodeError::kOutOfRange);
  expect_state([](v1::ElasticState& s) { s.mutable_places()->replace(1, 4, 4, '\0'); },
               DecodeError::kOutOfRange);
}

TEST(ElasticCodec, RefusesWhatIsNoStiffness) {
  for (const float x : {0.0F, -1.0F, 2000.0F}) {
    expect_point([&](v1::ElasticPoint& p) { p.set_step_m_per_newton(x); },
                 DecodeError::kOutOfRange);
    expect_point([&](v1::ElasticPoint& p) { p.set_rigid_give_m_per_newton(x); },
                 DecodeError::kOutOfRange);
  }
  expect_point([](v1::ElasticPoint& p) { p.set_step_m_per_newton(std::nanf("")); },
               DecodeError::kNotFinite);
  expect_state([](v1::ElasticState& s) { s.set_compliance_ratio(0.09); }, DecodeError::kOutOfRange);
  expect_state([](v1::ElasticState& s) { s.set_compliance_ratio(2.1); }, DecodeError::kOutOfRange);
  expect_state([](v1::ElasticState& s) { s.set_tip_radius_m(0.0); }, DecodeError::kOutOfRange);
  expect_state([](v1::ElasticState& s) { s.set_friction_stiffness_newton_per_m(0.0); },
               DecodeError::kOutOfRange);
  expect_state([](v1::ElasticState& s) { s.set_force_step_newton(1e5F); },
               DecodeError::kOutOfRange);
}

TEST(ElasticCodec, RefusesItBesideTiles) {
  EXPECT_EQ(
      read_after(true,
                 [](v1::Interaction& m) {
                   *m.mutable_surface() =
                       opened<Interaction>(encoded(test::full_message<Interaction>())).surface();
                 }),
      DecodeError::kOutOfRange);
}

TEST(ElasticCodec, FitsIntoAFrame) {
  for (const bool has_point : {true, false}) {
    Interaction m = message_with(has_point);
    Random random(3);
    m.listed_count = kMaxContactsWithElastic;
    m.contact_count = kMaxContactsWithElastic;
    for (Contact& contact : m.contacts) test::randomise(contact, random);
    m.surface.coverage_count = kMaxDescribed;
    m.surface.pending_count = kMaxPendingTiles;
    m.elastic.point.has_other.set();
    m.elastic.point.has_other.reset(m.elastic.point.slot);
    for (ElasticPlace& place : m.elastic.state.places) place.version = 0xffffffff;
    Interaction read;
    EXPECT_EQ(decoded(encoded(m), read), DecodeError::kNone) << encoded(m).size();
  }
}

}  // namespace
}  // namespace palpate
