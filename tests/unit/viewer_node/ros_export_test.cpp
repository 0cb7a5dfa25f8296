// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/ros_export.h"

#include <gtest/gtest.h>

#include <bit>
#include <cstring>
#include <string>

namespace palpate::viewer::ros {
namespace {

constexpr std::uint64_t kWall_ns = 1'700'000'001'000'000'002;

template <class Number>
Number at(const std::string& bytes, std::size_t offset) {
  Number number{};
  EXPECT_LE(offset + sizeof(Number), bytes.size());
  std::memcpy(&number, bytes.data() + offset, sizeof(Number));
  return number;
}

// The first number of eight bytes begins at a multiple of eight after the encapsulation header:
// 4 + 4 + 4 + 6 ("world" and its end) = 18, so 24.
TEST(RosMessages, APoseIsHeaderPositionAndQuaternion) {
  const Quaternion turned(0.5, -0.5, 0.5, -0.5);
  const std::string bytes = pose_stamped({kWall_ns, "world"}, {1, 2, 3}, turned);

  EXPECT_EQ(bytes.substr(0, 4), std::string("\x00\x01\x00\x00", 4));
  EXPECT_EQ(at<std::int32_t>(bytes, 4), 1'700'000'001);
  EXPECT_EQ(at<std::uint32_t>(bytes, 8), 2U);
  EXPECT_EQ(at<std::uint32_t>(bytes, 12), 6U);
  EXPECT_EQ(bytes.substr(16, 6), std::string("world", 6));
  EXPECT_EQ(bytes.size(), 4U + 24U + 7U * 8U);
  const double expected[] = {1, 2, 3, -0.5, 0.5, -0.5, 0.5};
  for (std::size_t i = 0; i < 7; ++i) EXPECT_EQ(at<double>(bytes, 28 + 8 * i), expected[i]) << i;
}

TEST(RosMessages, AWrenchIsHeaderForceAndTorqueWhateverItsFrameIsCalled) {
  for (const std::string frame : {"", "base", "device_base", "left_device_base"}) {
    const std::string bytes = wrench_stamped({kWall_ns, frame}, {1, 2, 3}, {4, 5, 6});

    const std::size_t header = (12 + frame.size() + 1 + 7) / 8 * 8;
    ASSERT_EQ(bytes.size(), 4 + header + 6 * 8) << frame;
    for (std::size_t i = 0; i < 6; ++i) {
      EXPECT_EQ(at<double>(bytes, 4 + header + 8 * i), static_cast<double>(i + 1)) << frame;
    }
  }
}

}  // namespace
}  // namespace palpate::viewer::ros
