// SPDX-License-Identifier: Apache-2.0
// `palpate ros`: a running session as topics of ROS 2, heard by another vendor's DDS.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "tests/loopback/ros/ros_support.h"
#include "tests/support/machine/places.h"
#include "tests/support/program.h"
#include "tests/support/resting_press.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using testing::HasSubstr;
using testing::Not;

/// What the peer printed last of a topic: how many messages, and the numbers of the newest.
struct Heard {
  unsigned long long count = 0;
  std::string frame;
  std::array<double, 7> numbers{};
};
Heard newest_of(const std::string& topic, const std::string& out) {
  Heard heard;
  std::istringstream lines(out);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with(topic + "=")) continue;
    std::istringstream words(line.substr(topic.size() + 1));
    std::string frame;
    words >> heard.count >> frame;
    heard.frame = frame.substr(frame.find('=') + 1);
    for (double& number : heard.numbers) words >> number;
  }
  return heard;
}

class RosOut : public testing::Test {
 protected:
  void start(const std::vector<std::string>& more = {}) {
    launch_.emplace("palpate",
                    std::vector<std::string>{"launch", file_, "--no-viewer", "--no-realtime"});
    std::vector<std::string> arguments{"--session", file_, "--domain", domain_};
    arguments.insert(arguments.end(), more.begin(), more.end());
    ros_.emplace("palpate_ros", arguments);
    ASSERT_FALSE(ros_->await_err("event=ros domain=").empty()) << ros_->err();
  }
  void stop() {
    ros_->send_signal(SIGTERM);
    EXPECT_EQ(ros_->wait(), 0) << ros_->err();
    launch_->send_signal(SIGTERM);
    EXPECT_EQ(launch_->wait(), 0) << launch_->err();
  }
  static void end(test::Program& peer) {
    peer.send_signal(SIGTERM);
    EXPECT_EQ(peer.wait(), 0) << peer.err();
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string file_ =
      files_.write("ros_out.txtpb", std::string("name: \"ros_out\"\n") +
                                        "realtime { priority: 0 cpu: -1 }\n" + test::kRestingPress);
  std::string domain_ = test::ros_domain();
  std::optional<test::Program> launch_;
  std::optional<test::Program> ros_;
};

// The hand rests 2.5 mm in the tissue, which pushes it with 1 N.
TEST_F(RosOut, AnotherVendorHearsPoseAndForce) {
  start();
  test::Program peer("fast_dds_peer", {domain_, "palpate", "listen"});
  ASSERT_TRUE(test::await([&] {
    return newest_of("measured_cp", peer.out()).count > 20 &&
           std::abs(newest_of("measured_cf", peer.out()).numbers[2] - test::kRestingNewton) <
               test::kStictionNewton;
  })) << peer.out()
      << ros_->err();

  const Heard pose = newest_of("measured_cp", peer.out());
  EXPECT_EQ(pose.frame, "world");
  EXPECT_NEAR(pose.numbers[2], -0.0025, 5e-4);
  EXPECT_NEAR(pose.numbers[6], 1.0, 1e-6);  // w of the quaternion
  EXPECT_EQ(newest_of("measured_cf", peer.out()).frame, "device_base");
  EXPECT_THAT(ros_->err(), Not(HasSubstr("event=ros_stranger")));
  end(peer);
  stop();
}

TEST_F(RosOut, NamesTheTopicsOfEachSideAndSaysThatNothingIsHeard) {
  test::Program alone(
      "palpate_ros",
      {"--session", test::source_dir() + "/deploy/sessions/two_hands.txtpb", "--domain", domain_});
  EXPECT_EQ(alone.await_err("event=ros domain=" + domain_ + " interface=127.0.0.1 out="),
            "palpate/left/measured_cp,palpate/right/measured_cp")
      << alone.err();
  EXPECT_FALSE(alone.await_err("event=nothing_heard").empty()) << alone.err();
}

/// What the peer has read last of a topic.
std::string last_line(const std::string& topic, const std::string& out) {
  std::string last;
  std::istringstream lines(out);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with(topic + ": ")) last = line.substr(topic.size() + 2);
  }
  return last;
}

// Every topic, with nothing left over, by the encoders of the other vendor. The energies are those
// of a press of 2.5 mm; without a controller there is no ledger.
TEST_F(RosOut, AnotherVendorReadsEveryTopic) {
  start();
  test::Program peer("fast_dds_peer", {domain_, "palpate", "read"});
  ASSERT_TRUE(test::await([&] {
    const std::string out = peer.out();
    return last_line("palpate/measured_js", out).find(" -0.002") != std::string::npos &&
           !last_line("palpate/tissues", out).empty() && !last_line("tf", out).empty() &&
           !last_line("tf_static", out).empty() &&
           last_line("palpate/operating_state", out).find("ENABLED") != std::string::npos &&
           !last_line("palpate/clamped_ratio", out).empty();
  })) << peer.out()
      << ros_->err();
  const std::string out = peer.out();
  EXPECT_THAT(out, Not(HasSubstr("left over")));
  EXPECT_THAT(out, Not(HasSubstr("unreadable")));
  EXPECT_THAT(last_line("palpate/operating_state", out), HasSubstr("device_base ENABLED homed"));
  EXPECT_THAT(last_line("palpate/measured_js", out), HasSubstr("x y z [ 0.0000 0.0000 -0.002"));
  EXPECT_THAT(last_line("tf", out), HasSubstr("frame=world child=tool 0.0000 0.0000 -0.002"));
  EXPECT_THAT(last_line("tf_static", out),
              HasSubstr("frame=world child=device_base 0.0000 0.0000 0.0000"));
  EXPECT_THAT(last_line("palpate/servo_cf", out), HasSubstr("frame=device_base 0.0000 0.0000 "));
  EXPECT_THAT(last_line("palpate/measured_cv", out), HasSubstr("frame=world "));
  EXPECT_THAT(last_line("palpate/true_energy_joule", out), HasSubstr("0.0"));
  const std::string marker = last_line("palpate/tissues", out);
  EXPECT_THAT(marker, HasSubstr("frame=world ns="));
  EXPECT_THAT(marker, HasSubstr(" id=0 type=11 action=0 "));
  EXPECT_THAT(marker, Not(HasSubstr(" points=0 ")));
  EXPECT_THAT(marker, Not(HasSubstr(" more")));
  end(peer);
  stop();
}

TEST_F(RosOut, ASubscriberThatAsksForReliableIsNamedWithARemedyAndHearsWhereItIsOffered) {
  start();
  {
    test::Program peer("fast_dds_peer", {domain_, "palpate", "listen", "reliable"});
    const std::string line =
        ros_->await_err("event=ros_stranger what=\"a subscriber of palpate/measured_c");
    EXPECT_THAT(line, HasSubstr("asks for reliable, offered is best effort"));
    EXPECT_THAT(line, HasSubstr("--reliable"));
    EXPECT_EQ(newest_of("measured_cp", peer.out()).count, 0U);
    end(peer);
  }
  stop();
  start({"--reliable"});
  test::Program peer("fast_dds_peer", {domain_, "palpate", "listen", "reliable"});
  EXPECT_TRUE(test::await([&] { return newest_of("measured_cp", peer.out()).count > 20; }))
      << peer.out() << ros_->err();
  end(peer);
  stop();
}

TEST_F(RosOut, ANetworkThatIsNotThisMachineIsAskedForByDomain) {
  const test::Outcome outcome =
      test::run_program("palpate_ros", {"--session", file_, "--interface", "192.0.2.1"});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("say which domain with --domain"));

  const test::Outcome absent = test::run_program(
      "palpate_ros", {"--session", file_, "--interface", "192.0.2.1", "--domain", domain_});
  EXPECT_EQ(absent.status, 2);
  EXPECT_THAT(absent.err, HasSubstr("is it an address or a name of this machine"));

  const test::Outcome wrong = test::run_program(
      "palpate_ros", {"--session", file_, "--interface", "<x>", "--domain", domain_});
  EXPECT_EQ(wrong.status, 2);
  EXPECT_THAT(wrong.err, HasSubstr("must be the address or the name of an interface"));
}

TEST_F(RosOut, HelpIsThatOfTheProgramAndABuildWithoutSaysWhatToDo) {
  const test::Outcome help = test::run_program("palpate", {"ros", "--help"});
  EXPECT_EQ(help.status, 0);
  EXPECT_THAT(help.out, HasSubstr("--every-tick"));

  const std::string alone = (files_.path() / "palpate_tools").string();
  std::filesystem::create_hard_link(test::binary_dir() + "/palpate_tools", alone);
  const test::Outcome without = test::run_program(alone, {"ros", "--session", file_});
  EXPECT_EQ(without.status, 2);
  EXPECT_THAT(without.err, HasSubstr("-DPALPATE_ROS=ON"));
}

/// Shared libraries that a program loads, by the loader itself.
std::string libraries_of(const std::string& program) {
  std::string text;
  std::FILE* pipe = popen(
      ("LD_TRACE_LOADED_OBJECTS=1 '" + test::binary_dir() + "/" + program + "'").c_str(), "r");
  if (pipe == nullptr) return text;
  for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) text += static_cast<char>(c);
  pclose(pipe);
  return text;
}

TEST(Ros, OnlyItsOwnProgramLoadsDds) {
  EXPECT_THAT(libraries_of("palpate_ros"), HasSubstr("libddsc"));
  for (const char* program :
       {"palpate", "palpate_tools", "device_node", "mofc_node", "physics_node", "viewer_node"}) {
    const std::string libraries = libraries_of(program);
    EXPECT_THAT(libraries, HasSubstr("libc.so")) << program;
    for (const char* dds : {"ddsc", "iceoryx", "fastrtps"}) {
      EXPECT_THAT(libraries, Not(HasSubstr(dds))) << program;
    }
  }
}

}  // namespace
}  // namespace palpate
