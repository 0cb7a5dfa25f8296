// SPDX-License-Identifier: Apache-2.0
// Messages of OpenIGTLink as bytes; tests/loopback/audience judges them by another library.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "viewer_node/openigtlink/message.h"

namespace palpate::viewer::igtl {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

Pose some_pose() {
  Pose pose = Pose::Identity();
  pose.linear() = Eigen::AngleAxisd(0.7, Vector3(1, 2, 3).normalized()).toRotationMatrix();
  pose.translation() = Vector3(0.01, -0.02, 0.3);
  return pose;
}

Header header_of(const std::string& message) {
  const auto header =
      read_header(std::span<const char, kHeaderBytes>(message.data(), kHeaderBytes));
  EXPECT_TRUE(header.has_value());
  return header.value_or(Header{});
}
std::string body_of(const std::string& message) { return message.substr(kHeaderBytes); }

TEST(OpenIgtLink, HasTheChecksumOfEcma182) {
  EXPECT_EQ(crc64("123456789"), 0x6C40DF5F0B497347U);
  EXPECT_EQ(crc64(""), 0U);
}

TEST(OpenIgtLink, ATransformHasItsPlacesOnTheWire) {
  const std::string bytes = transform_message("Tool", 1'500'000'000, some_pose());
  ASSERT_EQ(bytes.size(), kHeaderBytes + 48);
  EXPECT_EQ(bytes.substr(0, 14), std::string("\0\1TRANSFORM\0\0\0", 14));
  EXPECT_EQ(bytes.substr(14, 20), "Tool" + std::string(16, '\0'));
  EXPECT_EQ(bytes.substr(34, 8), std::string("\0\0\0\1\x80\0\0\0", 8));  // 1.5 s
  EXPECT_EQ(bytes.substr(42, 8), std::string("\0\0\0\0\0\0\0\x30", 8));
  // the last: 300 mm = 0x43960000
  EXPECT_EQ(bytes.substr(bytes.size() - 4), std::string("\x43\x96\0\0", 4));
  const Header header = header_of(bytes);
  EXPECT_EQ(header.type, "TRANSFORM");
  EXPECT_EQ(header.device, "Tool");
  EXPECT_EQ(header.crc, crc64(body_of(bytes)));
}

TEST(OpenIgtLink, ATransformIsReadAsItWasWrittenInBothHeaders) {
  const std::string bytes = transform_message("ImageToPatient", 0, some_pose());
  Header header = header_of(bytes);
  const ReadTransform read = read_transform(header, body_of(bytes));
  EXPECT_THAT(read.complaint, IsEmpty());
  EXPECT_TRUE(read.pose.isApprox(some_pose(), 1e-6));

  // 12 bytes of the extended header; 8 of an index and 5 of metadata at the end
  header.version = 2;
  const std::string extended =
      std::string("\0\x0C\0\x08\0\0\0\5\0\0\0\1", 12) + body_of(bytes) + std::string(13, 'm');
  const ReadTransform again = read_transform(header, extended);
  EXPECT_THAT(again.complaint, IsEmpty());
  EXPECT_TRUE(again.pose.isApprox(some_pose(), 1e-6));
  for (std::size_t size = 0; size < extended.size(); ++size) {
    EXPECT_FALSE(read_transform(header, extended.substr(0, size)).complaint.empty()) << size;
  }
}

TEST(OpenIgtLink, ATransformThatIsNoRegistrationIsRefused) {
  const Header header{.version = 1, .type = "TRANSFORM"};
  const auto complaint = [&](const Matrix3& turn, const Vector3& place_m) {
    Pose pose = Pose::Identity();
    pose.linear() = turn;
    pose.translation() = place_m;
    return read_transform(header, body_of(transform_message("a", 0, pose))).complaint;
  };
  const Matrix3 mirror = Vector3(1, 1, -1).asDiagonal();
  EXPECT_THAT(complaint(mirror, Vector3::Zero()), HasSubstr("is not rigid"));
  EXPECT_THAT(complaint(2.0 * Matrix3::Identity(), Vector3::Zero()), HasSubstr("is not rigid"));
  EXPECT_THAT(complaint(Matrix3::Zero(), Vector3::Zero()), HasSubstr("is not rigid"));
  EXPECT_THAT(complaint(Matrix3::Identity(), Vector3(1e3, 0, 0)), HasSubstr("100 m away"));
  for (const double bad : {std::nan(""), std::numeric_limits<double>::infinity()}) {
    EXPECT_THAT(complaint(Matrix3::Constant(bad), Vector3::Zero()), HasSubstr("not finite"));
    EXPECT_THAT(complaint(Matrix3::Identity(), Vector3(0, bad, 0)), HasSubstr("not finite"));
  }
  EXPECT_THAT(read_transform(header, std::string(47, '\0')).complaint, HasSubstr("47 bytes"));
}

TEST(OpenIgtLink, WhatIsNoHeaderIsNotRead) {
  std::string bytes = transform_message("Tool", 0, some_pose()).substr(0, kHeaderBytes);
  const auto is_read = [&] {
    return read_header(std::span<const char, kHeaderBytes>(bytes.data(), kHeaderBytes)).has_value();
  };
  EXPECT_TRUE(is_read());
  bytes[1] = 3;
  EXPECT_FALSE(is_read());
  bytes[1] = 0;
  EXPECT_FALSE(is_read());
  bytes.replace(0, 14, "GET / HTTP/1.1");
  EXPECT_FALSE(is_read());
}

TEST(OpenIgtLink, NamesFitTheWire) {
  EXPECT_EQ(device_name("tum\xc3\xb6r"), "tum??r");
  EXPECT_EQ(device_name(std::string(30, 'x')), std::string(20, 'x'));
}

TEST(OpenIgtLink, ACloudIsSentAsPoints) {
  const std::vector<float> vertices_m{0, 0, 0, 0.001F, 0.002F, 0.003F};
  const std::string body = body_of(polydata_message("cloud", 0, vertices_m, {}, Pose::Identity()));
  // two points, two cells of 16 bytes
  EXPECT_EQ(body.substr(0, 12), std::string("\0\0\0\2\0\0\0\2\0\0\0\x10", 12));
  EXPECT_EQ(body.size(), 40U + 24U + 16U);
}

}  // namespace
}  // namespace palpate::viewer::igtl
