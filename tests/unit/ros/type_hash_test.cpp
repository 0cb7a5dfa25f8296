// SPDX-License-Identifier: Apache-2.0
// The type hashes of ROS 2 follow from our definitions of the messages, and are those of ROS 2.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "deploy/ros/dds/type_hashes.h"
#include "tests/support/machine/places.h"
#include "tests/unit/build/run_command.h"

namespace palpate::ros {
namespace {

const std::string kScript = test::source_dir() + "/deploy/ros/dds/type_hashes.py";

class TypeHashes : public testing::Test {
 protected:
  void SetUp() override {
    if (test::run_command("python3 --version").status != 0) GTEST_SKIP() << "no python3";
  }
};

TEST_F(TypeHashes, AreThoseOfTheDefinitions) {
  const test::CommandResult made = test::run_command("python3 '" + kScript + "' --header");
  ASSERT_EQ(made.status, 0) << made.output;
  // run_command makes white space single blanks
  const test::CommandResult kept =
      test::run_command("cat '" + test::source_dir() + "/deploy/ros/dds/type_hashes.h'");
  EXPECT_EQ(made.output, kept.output);
}

// What nodes of ROS 2 (Iron to Jazzy) show as "Topic type hash", as read in public logs and sources
// of others (among them `ros2 topic info --verbose` of joint_state_broadcaster and CARLA's list).
TEST(PublishedTypeHashes, AreOurs) {
  EXPECT_STREQ(kPoseStampedHash,
               "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8");
  EXPECT_STREQ(kTwistStampedHash,
               "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64");
  EXPECT_STREQ(kWrenchStampedHash,
               "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77");
  EXPECT_STREQ(kJointStateHash,
               "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e");
  EXPECT_STREQ(kJoyHash, "RIHS01_0d356c79cad3401e35ffeb75a96a96e08be3ef896b8b83841d73e890989372c5");
  EXPECT_STREQ(kFloat64Hash,
               "RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a");
  EXPECT_STREQ(kTFMessageHash,
               "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087");
  EXPECT_STREQ(kMarkerHash,
               "RIHS01_45b13ccf791f225962bf74e746f9644518855d783a6f42ba0cc14fde2b4f3ce0");
}

// A field more, and it is another type.
TEST_F(TypeHashes, ChangeWithADefinition) {
  const std::string folder = testing::TempDir() + "/type_hashes";
  std::filesystem::create_directories(folder);
  const auto copy = std::filesystem::copy_options::overwrite_existing;
  std::filesystem::copy_file(kScript, folder + "/type_hashes.py", copy);
  std::ifstream in(test::source_dir() + "/deploy/ros/dds/ros_messages.idl");
  std::string idl((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  const std::string field = "struct Wrench_ { Vector3_ force;";
  ASSERT_NE(idl.find(field), std::string::npos);
  idl.replace(idl.find(field), field.size(), field + " double more;");
  std::ofstream(folder + "/ros_messages.idl") << idl;

  const test::CommandResult made = test::run_command("python3 '" + folder + "/type_hashes.py'");

  EXPECT_EQ(made.status, 0);
  EXPECT_EQ(made.output.find(kWrenchStampedHash), std::string::npos) << made.output;
  EXPECT_NE(made.output.find(kPoseStampedHash), std::string::npos) << made.output;
}

}  // namespace
}  // namespace palpate::ros
