// SPDX-License-Identifier: Apache-2.0
// Tiles and descriptions on hop 3: a hostile one is refused with its whole message.
#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "tests/unit/link/codec_test_support.h"

namespace palpate {
namespace {

using test::expect_range;

/// One triangle over three of four vertices.
v1::SurfaceTile tile_of(const std::vector<std::array<int, 3>>& vertices,
                        const std::vector<std::array<int, 3>>& facets) {
  v1::SurfaceTile tile;
  tile.mutable_origin_m()->set_x(0.1);
  tile.set_step_m(1e-6);
  std::string bytes;
  for (const auto& vertex : vertices) {
    for (const int x : vertex) {
      bytes.push_back(static_cast<char>(x % 256));
      bytes.push_back(static_cast<char>(x / 256));
    }
  }
  tile.set_vertices(bytes);
  bytes.clear();
  for (const auto& facet : facets) {
    for (const int corner : facet) bytes.push_back(static_cast<char>(corner));
  }
  tile.set_facets(bytes);
  return tile;
}

void expect_tile(const v1::SurfaceTile& tile, bool is_good) {
  expect_range<Interaction>(
      [&](v1::Interaction& m) { *m.mutable_surface()->mutable_tiles(0) = tile; }, is_good);
}

const std::vector<std::array<int, 3>> kCorners = {
    {0, 0, 0}, {65535, 0, 0}, {0, 65535, 0}, {2, 0, 0}};

TEST(SurfaceCodec, TakesATriangle) { expect_tile(tile_of(kCorners, {{0, 1, 2}}), true); }

TEST(SurfaceCodec, RefusesATriangleWithoutArea) {
  expect_tile(tile_of(kCorners, {{0, 1, 3}}), false);
  expect_tile(tile_of(kCorners, {{0, 1, 1}}), false);
  expect_tile(tile_of(kCorners, {{0, 1, 2}, {2, 2, 2}}), false);
}

TEST(SurfaceCodec, RefusesAnIndexWithoutVertex) {
  expect_tile(tile_of(kCorners, {{0, 1, 4}}), false);
  expect_tile(tile_of(kCorners, {{0, 1, 255}}), false);
}

TEST(SurfaceCodec, RefusesTornAndEmptyLists) {
  v1::SurfaceTile tile = tile_of(kCorners, {{0, 1, 2}});
  tile.mutable_vertices()->push_back('x');
  expect_tile(tile, false);
  tile = tile_of(kCorners, {{0, 1, 2}});
  tile.mutable_facets()->pop_back();
  expect_tile(tile, false);
  expect_tile(tile_of(kCorners, {}), false);
}

TEST(SurfaceCodec, RefusesMoreThanATileHolds) {
  std::vector<std::array<int, 3>> vertices = kCorners;
  while (vertices.size() < kMaxTileVertices) vertices.push_back({1, 2, 3});
  std::vector<std::array<int, 3>> facets(kMaxTileFacets, {0, 1, 2});
  expect_tile(tile_of(vertices, facets), true);
  facets.push_back({0, 1, 2});
  expect_tile(tile_of(vertices, facets), false);
  facets.pop_back();
  vertices.push_back({1, 2, 3});
  expect_tile(tile_of(vertices, facets), false);
}

/// A point of 32 bytes with the given reach, normal (times 32767) and bytes of the stiffness ratio.
std::string point_of(int reach, const std::array<int, 3>& normal, const std::string& ratio) {
  std::string bytes(6, '\0');
  const auto put = [&](int x) {
    bytes.push_back(static_cast<char>(x & 0xff));
    bytes.push_back(static_cast<char>(x >> 8 & 0xff));
  };
  put(reach);
  for (const int x : normal) put(x);
  return bytes + std::string(14, '\0') + ratio;
}
v1::SurfaceTile tile_of_points(const std::string& points) {
  v1::SurfaceTile tile;
  tile.mutable_origin_m()->set_x(0.1);
  tile.set_step_m(1e-6);
  tile.set_points(points);
  return tile;
}
const std::string kOne("\0\0\x80\x3f", 4);  // 1.0F

TEST(SurfaceCodec, RefusesPointsThatAreNone) {
  const std::string good = point_of(1000, {0, 0, -32767}, kOne);
  expect_tile(tile_of_points(good), true);
  expect_tile(tile_of_points(point_of(0, {0, 0, -32767}, kOne)), false);
  expect_tile(tile_of_points(point_of(1000, {0, 0, 0}, kOne)), false);
  expect_tile(tile_of_points(point_of(1000, {0, 0, 30000}, kOne)), false);
  expect_tile(tile_of_points(point_of(1000, {0, 0, 32767}, std::string("\x80\x96\x18\x4b", 4))),
              false);  // 1e7
  expect_tile(tile_of_points(point_of(1000, {0, 0, 32767}, std::string("\0\0\x80\xbf", 4))),
              false);  // −1
  expect_tile(tile_of_points(good.substr(1)), false);
  std::string many;
  for (std::size_t i = 0; i < kMaxTilePoints; ++i) many += good;
  expect_tile(tile_of_points(many), true);
  expect_tile(tile_of_points(many + good), false);
  v1::SurfaceTile both = tile_of(kCorners, {{0, 1, 2}});
  both.set_points(good);
  expect_tile(both, false);
}

TEST(SurfaceCodec, RefusesSlotsThatDoNotExist) {
  const auto altered = [](const auto& alter) {
    return [alter](v1::Interaction& m) { alter(*m.mutable_surface()); };
  };
  const auto refuse = [&](const auto& alter) { expect_range<Interaction>(altered(alter), false); };
  refuse([](v1::SurfaceNews& m) { m.mutable_tiles(0)->set_slot(kTileSlots); });
  refuse([](v1::SurfaceNews& m) { m.mutable_tiles(0)->set_described_slot(kMaxDescribed); });
  refuse([](v1::SurfaceNews& m) { m.mutable_description()->set_slot(kMaxDescribed); });
  refuse([](v1::SurfaceNews& m) { m.mutable_coverages(0)->set_described_slot(kMaxDescribed); });
  refuse([](v1::SurfaceNews& m) { m.mutable_coverages(0)->mutable_to_m()->set_x(2e3); });
  refuse([](v1::SurfaceNews& m) { m.mutable_pending(0)->set_slot(kTileSlots); });
  refuse([](v1::SurfaceNews& m) { m.mutable_pending(0)->set_described_slot(kMaxDescribed); });
}

// a program without these fields has 1024 slots and takes 4 tiles in a message
TEST(SurfaceCodec, ReceiptsOfAnOlderReceiverStandForItsLimits) {
  Codec<ToolMotion> codec;
  ToolMotion motion;
  motion.device_session_id = motion.header.session_id = 1;
  motion.receipts.store_id = 5;
  const auto arrives = [&](std::uint32_t slots, std::uint32_t tiles) {
    motion.receipts.tile_slots = slots;
    motion.receipts.tiles_per_message = tiles;
    std::vector<std::byte> frame(codec.encode(motion));
    codec.write(frame.data());
    ToolMotion read;
    EXPECT_EQ(codec.decode(frame, read), DecodeError::kNone);
    return std::pair(read.receipts.tile_slots, read.receipts.tiles_per_message);
  };
  EXPECT_EQ(arrives(0, 0), std::pair(1024U, 4U));
  EXPECT_EQ(arrives(2000, 7), std::pair(2000U, 7U));
  // more than this program has
  EXPECT_EQ(arrives(1000000, 1000), std::pair(static_cast<std::uint32_t>(kTileSlots),
                                              static_cast<std::uint32_t>(kMaxTilesPerMessage)));
}

TEST(SurfaceCodec, RefusesMoreThanAMessageHolds) {
  const auto refuse = [](const auto& alter) {
    expect_range<Interaction>([&](v1::Interaction& m) { alter(*m.mutable_surface()); }, false);
  };
  refuse([](v1::SurfaceNews& m) {
    *m.mutable_tiles(0) = tile_of(kCorners, {{0, 1, 2}});
    m.mutable_tiles()->DeleteSubrange(1, m.tiles_size() - 1);
    while (m.tiles_size() <= static_cast<int>(kMaxTilesPerMessage)) *m.add_tiles() = m.tiles(0);
  });
  refuse([](v1::SurfaceNews& m) {
    while (m.coverages_size() <= static_cast<int>(kMaxDescribed)) {
      *m.add_coverages() = m.coverages(0);
    }
  });
  refuse([](v1::SurfaceNews& m) {
    while (m.pending_size() <= static_cast<int>(kMaxPendingTiles)) *m.add_pending() = m.pending(0);
  });
  refuse([](v1::SurfaceNews& m) {
    while (m.description().inclusions_size() <= static_cast<int>(kMaxDescribedInclusions)) {
      *m.mutable_description()->add_inclusions() = m.description().inclusions(0);
    }
  });
}

// Number 0 is news that carries nothing but what is known; its receiver books no gap.
TEST(SurfaceCodec, NumbersTheNewsThatCarryADescriptionOrTilesAndNoOther) {
  const auto news = [](std::uint64_t number, bool has_description, bool has_tiles, bool is_good) {
    expect_range<Interaction>(
        [=](v1::Interaction& m) {
          v1::SurfaceNews& surface = *m.mutable_surface();
          surface.set_number(number);
          if (!has_description) surface.clear_description();
          if (!has_tiles) surface.clear_tiles();
        },
        is_good);
  };
  for (const bool is_numbered : {false, true}) {
    news(is_numbered ? 1 : 0, true, true, is_numbered);
    news(is_numbered ? 1 : 0, true, false, is_numbered);
    news(is_numbered ? 1 : 0, false, true, is_numbered);
    news(is_numbered ? 1 : 0, false, false, !is_numbered);
  }
  expect_range<Interaction>([](v1::Interaction& m) { m.mutable_surface()->set_store_id(0); },
                            false);
}

TEST(SurfaceCodec, RefusesADescriptionWithTwoShapes) {
  expect_range<Interaction>(
      [](v1::Interaction& m) {
        v1::TissueDescription& description = *m.mutable_surface()->mutable_description();
        description.mutable_sphere()->mutable_center_m();
        description.mutable_tiles();
      },
      false);
}

/// Sets one of the numbers of a valid description, which has no shape.
using SetNumber = std::function<void(v1::TissueDescription&, double)>;

void expect_range_of(const SetNumber& set, double low, double high) {
  const auto expect = [&](double x, bool is_good) {
    expect_range<Interaction>(
        [&](v1::Interaction& m) {
          v1::TissueDescription& d = *m.mutable_surface()->mutable_description();
          d.clear_half_space();
          d.clear_sphere();
          d.clear_box();
          d.clear_capsule();
          d.clear_tiles();
          set(d, x);
          const bool has_shape =
              d.has_half_space() || d.has_sphere() || d.has_box() || d.has_capsule();
          if (!has_shape) d.mutable_tiles();
        },
        is_good);
  };
  expect(low, true);
  expect(high, true);
  expect(low - 1e-3, false);
  expect(high + 1e-3, false);
}

TEST(SurfaceCodec, RefusesNumbersOfADescriptionThatAreOutOfRange) {
  using Description = v1::TissueDescription;
  const double km = 1e3;
  const auto space = [](Description& d) -> v1::DescribedHalfSpace& {
    d.mutable_half_space()->mutable_point_m();
    d.mutable_half_space()->mutable_normal()->set_z(1.0);
    return *d.mutable_half_space();
  };
  const auto sphere = [](Description& d) -> v1::DescribedSphere& {
    d.mutable_sphere()->mutable_center_m();
    return *d.mutable_sphere();
  };
  const auto box = [](Description& d) -> v1::DescribedBox& {
    d.mutable_box()->mutable_center_m();
    d.mutable_box()->mutable_size_m();
    return *d.mutable_box();
  };
  const auto capsule = [](Description& d) -> v1::DescribedCapsule& {
    d.mutable_capsule()->mutable_from_m();
    d.mutable_capsule()->mutable_to_m();
    return *d.mutable_capsule();
  };
  const std::vector<SetNumber> places{
      [&](Description& d, double x) { space(d).mutable_point_m()->set_x(x); },
      [&](Description& d, double x) { sphere(d).mutable_center_m()->set_y(x); },
      [&](Description& d, double x) { box(d).mutable_center_m()->set_z(x); },
      [&](Description& d, double x) { capsule(d).mutable_from_m()->set_x(x); },
      [&](Description& d, double x) { capsule(d).mutable_to_m()->set_y(x); },
      [](Description& d, double x) { d.mutable_inclusions(0)->mutable_center_m()->set_x(x); },
      [](Description& d, double x) {
        d.set_motion_frequency_hz(0.0);
        d.mutable_motion_amplitude_m()->set_x(x);
      }};
  for (const SetNumber& set : places) expect_range_of(set, -km, km);
  const std::vector<SetNumber> lengths{
      [&](Description& d, double x) { sphere(d).set_radius_m(x); },
      [&](Description& d, double x) { box(d).mutable_size_m()->set_x(x); },
      [&](Description& d, double x) { box(d).mutable_size_m()->set_y(x); },
      [&](Description& d, double x) { box(d).mutable_size_m()->set_z(x); },
      [&](Description& d, double x) { capsule(d).set_radius_m(x); },
      [](Description& d, double x) { d.mutable_inclusions(0)->set_radius_m(x); },
      [](Description& d, double x) { d.set_tip_radius_m(x); },
      [](Description& d, double x) { d.set_shaft_length_m(x); },
      [](Description& d, double x) { d.set_shaft_radius_m(x); }};
  for (const SetNumber& set : lengths) expect_range_of(set, 0.0, km);
  expect_range_of([](Description& d, double x) { d.mutable_inclusions(0)->set_transition_m(x); },
                  1e-4, km);
  expect_range_of([](Description& d, double x) { d.set_motion_phase_rad(x); }, -1e6, 1e6);
  expect_range_of(
      [](Description& d, double x) { d.mutable_inclusions(0)->set_stiffness_newton_per_m(x); }, 0.0,
      1e6);
  expect_range_of(
      [](Description& d, double x) { d.mutable_inclusions(0)->set_damping_newton_s_per_m(x); }, 0.0,
      1e4);
  expect_range_of([](Description& d, double x) { d.set_damping_newton_s_per_m(x); }, 0.0, 1e4);
  expect_range_of([](Description& d, double x) { d.set_puncture_newton(x); }, 0.0, 1e4);
  expect_range_of([](Description& d, double x) { d.set_cutting_newton(x); }, 0.0, 1e4);
  expect_range_of([&](Description& d, double x) { space(d).mutable_normal()->set_z(x); },
                  1.0 - 0.9e-6, 1.0 + 0.9e-6);
}

TEST(SurfaceCodec, RefusesNumbersOfTilesAndCoverageThatAreOutOfRange) {
  const auto range = [](const std::function<void(v1::SurfaceNews&, double)>& set, double low,
                        double high) {
    const auto expect = [&](double x, bool is_good) {
      expect_range<Interaction>([&](v1::Interaction& m) { set(*m.mutable_surface(), x); }, is_good);
    };
    expect(low, true);
    expect(high, true);
    expect(low - 1e-3, false);
    expect(high + 1e-3, false);
  };
  using News = v1::SurfaceNews;
  const auto tile = [](News& m) -> v1::SurfaceTile& {
    *m.mutable_tiles(0) = tile_of(kCorners, {{0, 1, 2}});
    return *m.mutable_tiles(0);
  };
  range([&](News& m, double x) { tile(m).mutable_origin_m()->set_x(x); }, -1e3, 1e3);
  range([&](News& m, double x) { tile(m).set_step_m(x); }, 1e-9, 1.0);
  expect_tile(
      [&] {
        v1::SurfaceTile flat = tile_of(kCorners, {{0, 1, 2}});
        flat.set_step_m(0.0);
        return flat;
      }(),
      false);
  range([](News& m, double x) { m.mutable_coverages(0)->mutable_center_m()->set_y(x); }, -1e3, 1e3);
  range([](News& m, double x) { m.mutable_coverages(0)->set_radius_m(x); }, 0.0, 1e3);
  range([](News& m, double x) { m.mutable_pending(0)->set_center_x_m(static_cast<float>(x)); },
        -1e3, 1e3);
  range([](News& m, double x) { m.mutable_pending(0)->set_center_y_m(static_cast<float>(x)); },
        -1e3, 1e3);
  range([](News& m, double x) { m.mutable_pending(0)->set_center_z_m(static_cast<float>(x)); },
        -1e3, 1e3);
  range([](News& m, double x) { m.mutable_pending(0)->set_radius_m(static_cast<float>(x)); }, 0.0,
        1e3);
}

TEST(SurfaceCodec, RefusesALawThatDividesByZero) {
  const auto refuse = [](const auto& alter) {
    expect_range<Interaction>(
        [&](v1::Interaction& m) { alter(*m.mutable_surface()->mutable_description()); }, false);
  };
  refuse([](v1::TissueDescription& m) { m.mutable_inclusions(0)->set_transition_m(0.0); });
  refuse([](v1::TissueDescription& m) { m.set_relaxation_time_s(0.0); });
  refuse([](v1::TissueDescription& m) {
    m.set_friction_coefficient(0.5);
    m.set_friction_stiffness_newton_per_m(0.0);
  });
  refuse([](v1::TissueDescription& m) { m.set_stiffness_newton_per_m(-1.0); });
}

TEST(SurfaceCodec, RefusesTissueThatDoesNotExist) {
  const auto description = [](const auto& alter, bool is_good) {
    expect_range<Interaction>(
        [&](v1::Interaction& m) { alter(*m.mutable_surface()->mutable_description()); }, is_good);
  };
  using Description = v1::TissueDescription;
  const auto limit = [&](void (Description::*set)(double), double most) {
    description([&](Description& m) { (m.*set)(most); }, true);
    description([&](Description& m) { (m.*set)(1.001 * most); }, false);
  };
  limit(&Description::set_stiffness_newton_per_m, 1e6);
  limit(&Description::set_damping_newton_s_per_m, 1e4);
  limit(&Description::set_relaxing_stiffness_newton_per_m, 1e6);
  limit(&Description::set_friction_stiffness_newton_per_m, 1e6);
  limit(&Description::set_stiffening_newton_per_m3, 1e9);
  limit(&Description::set_friction_coefficient, 10.0);
  limit(&Description::set_relaxation_time_s, 1e3);
  limit(&Description::set_puncture_newton, 1e4);
  limit(&Description::set_cutting_newton, 1e4);
  description([](Description& m) { m.set_relaxation_time_s(0.9e-3); }, false);
  const auto power = [&](double exponent, double depth_m, bool is_good) {
    description(
        [&](Description& m) {
          m.set_exponent(exponent);
          m.set_exponent_depth_m(depth_m);
        },
        is_good);
  };
  power(5.0, 1e-4, true);
  power(5.01, 1e-3, false);
  power(2.0, 0.9e-4, false);
  power(2.0, 0.11, false);
  const auto moving = [&](double amplitude_m, double frequency_hz, bool is_good) {
    description(
        [&](Description& m) {
          m.clear_motion_amplitude_m();
          m.mutable_motion_amplitude_m()->set_y(amplitude_m);
          m.set_motion_frequency_hz(frequency_hz);
        },
        is_good);
  };
  moving(0.07, 20.0, true);  // 8.8 m/s
  moving(-0.09, 20.0, false);
  moving(0.001, 20.1, false);
  description([](Description& m) { m.mutable_inclusions(0)->set_stiffness_newton_per_m(1.01e6); },
              false);
  description([](Description& m) { m.mutable_inclusions(0)->set_damping_newton_s_per_m(1.01e4); },
              false);
}

TEST(SurfaceCodec, RefusesAnAgeOfTheLoopBeyondTenSeconds) {
  const auto age = [](std::int64_t ns) {
    return [ns](v1::ToolMotion& m) { m.mutable_receipts()->set_loop_age_ns(ns); };
  };
  expect_range<ToolMotion>(age(10'000'000'000), true);
  expect_range<ToolMotion>(age(10'000'000'001), false);
  expect_range<ToolMotion>(age(-1), false);
}

}  // namespace
}  // namespace palpate
