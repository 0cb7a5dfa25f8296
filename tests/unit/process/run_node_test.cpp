// SPDX-License-Identifier: Apache-2.0
#include "common/process/run_node.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <CLI/CLI.hpp>

#include <stdexcept>

#include "common/core/check.h"
#include "common/core/version.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using testing::HasSubstr;
using testing::internal::CaptureStderr;
using testing::internal::CaptureStdout;
using testing::internal::GetCapturedStderr;
using testing::internal::GetCapturedStdout;

class RunNode : public testing::Test {
 protected:
  /// Exit status; what was printed is in `out` and `err`.
  int run(std::vector<std::string> arguments, const std::function<void(NodeContext&)>& body) {
    arguments.insert(arguments.begin(), "fake_node");
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    CaptureStdout();
    CaptureStderr();
    const int status =
        run_node(static_cast<int>(argv.size()), argv.data(),
                 {.name = "fake",
                  .description = "A node of this test",
                  .add_options = [this](CLI::App& app) { app.add_option("--extra", extra_); }},
                 body);
    out = GetCapturedStdout();
    err = GetCapturedStderr();
    return status;
  }
  static void must_not_run(NodeContext&) { FAIL() << "the body ran"; }

  test::TempFolder files_;
  std::string session_ = files_.write("session.txtpb", "name: \"run_node_test\"\n");
  std::string out;
  std::string err;
  int extra_ = 0;
};

TEST_F(RunNode, AnAdversaryIsRefusedOrLeftOutAndNeverReachesTheBody) {
  const std::vector<std::string> attack{"--session", session_, "--set",
                                        "adversary.clamp=full_force"};
  EXPECT_EQ(run(attack, must_not_run), kExitSetupError);
  EXPECT_THAT(err, testing::AllOf(HasSubstr("adversary"), HasSubstr("--no-adversary")));

  std::vector<std::string> without = attack;
  without.emplace_back("--no-adversary");
  bool is_any = true;
  EXPECT_EQ(
      run(without, [&](NodeContext& context) { is_any = context.session.adversary.is_any(); }), 0);
  EXPECT_FALSE(is_any);
}

TEST_F(RunNode, GivesTheBodyItsSessionAndEndsWithStatusZero) {
  std::string name;
  std::uint64_t session_id = 0;
  const int status = run({"--session", session_, "--extra", "3"}, [&](NodeContext& context) {
    name = context.session.name;
    session_id = context.session_id;
    EXPECT_FALSE(context.stop.stop_requested());
  });

  EXPECT_EQ(status, 0);
  EXPECT_EQ(name, "run_node_test");
  EXPECT_NE(session_id, 0u);
  EXPECT_EQ(extra_, 3);
  EXPECT_THAT(err, HasSubstr("info fake event=start session=run_node_test"));
  EXPECT_THAT(err, HasSubstr("info fake event=stop"));
}

TEST_F(RunNode, OverridesAreRepeatable) {
  double rate_hz = 0;
  const int status =
      run({"--session", session_, "--set", "device.rate_hz=500", "--set", "physics.rate_hz=250"},
          [&](NodeContext& context) {
            rate_hz = context.session.side().device.rate_hz + context.session.physics.rate_hz;
          });

  EXPECT_EQ(status, 0);
  EXPECT_EQ(rate_hz, 750.0);
}

TEST_F(RunNode, NoRealtimeRemovesTheRequestsForRealTime) {
  run({"--session", session_, "--no-realtime"}, [&](NodeContext& context) {
    EXPECT_EQ(context.session.side().realtime.priority, 0);
    EXPECT_EQ(context.session.side().realtime.cpu, -1);
    EXPECT_EQ(context.session.side().realtime.wait, WaitStrategy::kBlock);
  });
}

TEST_F(RunNode, ABadFlagIsStatusTwo) {
  EXPECT_EQ(run({"--session", session_, "--sesion"}, must_not_run), 2);
  EXPECT_THAT(err, HasSubstr("--sesion"));
}

TEST_F(RunNode, NoSessionIsStatusTwo) {
  EXPECT_EQ(run({}, must_not_run), 2);
  EXPECT_THAT(err, HasSubstr("--session"));
}

TEST_F(RunNode, NegativeSecondsAreStatusTwo) {
  EXPECT_EQ(run({"--session", session_, "--seconds", "-1"}, must_not_run), 2);
}

TEST_F(RunNode, AMissingSessionFileIsStatusTwoAndIsNamed) {
  EXPECT_EQ(run({"--session", "/no/such/file.txtpb"}, must_not_run), 2);
  EXPECT_THAT(err, HasSubstr("fake_node: "));
  EXPECT_THAT(err, HasSubstr("/no/such/file.txtpb"));
}

TEST_F(RunNode, ASetupErrorOfTheBodyIsPrintedOnceAndIsStatusTwo) {
  const int status =
      run({"--session", session_}, [](NodeContext&) { throw SetupError("endpoint in use"); });

  EXPECT_EQ(status, 2);
  EXPECT_THAT(err, HasSubstr("fake_node: endpoint in use\n"));
  EXPECT_EQ(err.find("endpoint in use"), err.rfind("endpoint in use"));
}

TEST_F(RunNode, AnyOtherExceptionIsStatusOne) {
  EXPECT_EQ(run({"--session", session_}, [](NodeContext&) { throw std::runtime_error("lost"); }),
            1);
  EXPECT_THAT(err, HasSubstr("fake_node: failed: lost\n"));
  EXPECT_EQ(run({"--session", session_}, [](NodeContext&) { throw 3; }), 1);
}

TEST_F(RunNode, VersionIsPrinted) {
  EXPECT_EQ(run({"--version"}, must_not_run), 0);
  EXPECT_EQ(out, std::string("fake_node ") + version() + "\n");
}

TEST_F(RunNode, HelpIsNoError) {
  EXPECT_EQ(run({"--help"}, must_not_run), 0);
  EXPECT_THAT(out, HasSubstr("--no-realtime"));
}

}  // namespace
}  // namespace palpate
