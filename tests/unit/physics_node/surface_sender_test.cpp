// SPDX-License-Identifier: Apache-2.0
// What physics_node sends of a surface, to a receiver that takes everything and answers late.
#include "physics_node/answer/surface_sender.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <vector>

#include "common/link/codec/codec.h"
#include "physics_node/surfaces/triangle_surface.h"
#include "tests/unit/physics_node/test_meshes.h"

namespace palpate::physics {
namespace {

using namespace std::chrono_literals;

constexpr double kRadius_m = 0.05;
constexpr int kBands = 90;

/// A ball under a tool, and the two ends of hop 3 with a delay.
class Sent : public testing::Test {
 protected:
  explicit Sent(double rate_hz = 90.0, double radius_m = kRadius_m)
      : tissues_(1), period_(from_seconds(1.0 / rate_hz)) {
    const Shape shape(PlacedSurface{std::make_shared<TriangleSurface>(ball_mesh(radius_m, kBands)),
                                    Vector3::Zero(), Quaternion::Identity()});
    tissues_[0] = described(shape, {}, {}, {.tip_radius_m = 3e-3}, 0);
    sender_ = std::make_unique<SurfaceSender>(tissues_, rate_hz);
    motion_.receipts.store_id = 5;
    motion_.tool_position_world_m = {0.0, 0.0, radius_m};
    times_sent_.resize(tissues_[0].tiles.size());
  }

  /// One step of physics. What it sends arrives, and is acknowledged a loop later.
  const Interaction& step() {
    now_ += period_;
    while (!receipts_.empty() && receipts_.front().at <= now_) {
      motion_.receipts.newest = receipts_.front().newest;
      motion_.receipts.received = ~std::uint64_t{0};
      motion_.receipts.loop_age = kLoop;
      receipts_.pop_front();
    }
    interaction_ = {};
    interaction_.device_session_id = 1;
    interaction_.listed_count = 1;
    interaction_.contacts[0].trust_radius_m = 1.0;
    sender_->fill(motion_, now_, interaction_);
    const SurfaceNews& news = interaction_.surface;
    if (news.number > 0) receipts_.push_back({now_ + kLoop, news.number});
    for (std::uint32_t i = 0; i < news.tile_count; ++i) {
      for (std::size_t k = 0; k < tissues_[0].tiles.size(); ++k) {
        if (tissues_[0].tiles[k].vertices == news.tiles[i].vertices) ++times_sent_[k];
      }
    }
    return interaction_;
  }
  [[nodiscard]] bool is_whole() const {
    const SurfaceNews& news = interaction_.surface;
    return news.coverage_count == 1 && news.coverages[0].region.radius_m >= 1000.0;
  }

  static constexpr Duration kLoop = 110ms;
  struct Receipt {
    TimePoint at;
    std::uint64_t newest;
  };
  std::vector<DescribedTissue> tissues_;
  std::unique_ptr<SurfaceSender> sender_;
  Duration period_;
  TimePoint now_{1s};
  ToolMotion motion_;
  Interaction interaction_;
  std::deque<Receipt> receipts_;
  std::vector<int> times_sent_;
};

TEST_F(Sent, AWholeOrganIsKnownSoonAndEachTileIsSentOnce) {
  motion_.receipts.tile_slots = kTileSlots;
  motion_.receipts.tiles_per_message = kMaxTilesPerMessage;
  ASSERT_GT(tissues_[0].tiles.size(), 800u);
  int steps = 0;
  while (!is_whole() && steps < 900) {
    step();
    ++steps;
  }
  // 290 kB, of which the tool's surroundings go first, the rest at 200 kB/s
  EXPECT_LE(steps, 270) << "3 s at 90 Hz";
  // until the first receipt the age of the loop is not known
  EXPECT_EQ(std::count(times_sent_.begin(), times_sent_.end(), 0), 0);
  EXPECT_LE(std::count_if(times_sent_.begin(), times_sent_.end(), [](int n) { return n > 1; }),
            200);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(step().surface.number, 0u);  // nothing more
}

TEST_F(Sent, AnOlderReceiverGetsWhatItAccepts) {
  for (int i = 0; i < 900; ++i) {
    const SurfaceNews& news = step().surface;
    ASSERT_LE(news.tile_count, 4u);
    for (std::uint32_t k = 0; k < news.tile_count; ++k) ASSERT_LT(news.tiles[k].slot, 1024u);
  }
}

TEST_F(Sent, AMessageFitsIntoItsFrame) {
  motion_.receipts.tile_slots = kTileSlots;
  motion_.receipts.tiles_per_message = kMaxTilesPerMessage;
  Codec<Interaction> codec;
  std::uint32_t most = 0;
  for (int i = 0; i < 100; ++i) {
    ASSERT_LE(codec.encode(step()), kMaxFrameBytes<Interaction>);
    most = std::max(most, interaction_.surface.tile_count);
  }
  EXPECT_GE(most, 12u);
}

class SentSeldom : public Sent {
 protected:
  // beside a ball whose tiles are 2 mm wide there
  SentSeldom() : Sent(30.0, 0.02) { motion_.tool_position_world_m = {0.02, 0.0, 0.0}; }
};

// which of the first messages have arrived is not known yet: under a tool that is about to touch
// it matters more to have the nearest tiles than some more of those behind them
TEST_F(SentSeldom, TheNearestTilesGoTwiceBeforeTheFirstReceipt) {
  motion_.receipts.tile_slots = kTileSlots;
  motion_.receipts.tiles_per_message = kMaxTilesPerMessage;
  std::vector<std::size_t> first;
  for (int i = 0; i < 3; ++i) {
    step();
    for (std::size_t k = 0; i == 0 && k < times_sent_.size(); ++k) {
      if (times_sent_[k] > 0) first.push_back(k);
    }
  }
  ASSERT_EQ(motion_.receipts.newest, 0u);
  ASSERT_GE(first.size(), 8u);
  const auto again = std::count_if(first.begin(), first.end(),
                                   [&](std::size_t tile) { return times_sent_[tile] == 2; });
  EXPECT_GE(again, static_cast<std::ptrdiff_t>(first.size() / 2));
}

// a tool that is still far away
TEST_F(Sent, ATissueIsDescribedBeforeTheToolIsNear) {
  motion_.tool_position_world_m = {0.0, 0.0, 0.5};
  now_ += period_;
  interaction_ = {};
  sender_->fill(motion_, now_, interaction_);
  EXPECT_TRUE(interaction_.surface.has_description);
}

}  // namespace
}  // namespace palpate::physics
