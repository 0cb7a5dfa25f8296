// SPDX-License-Identifier: Apache-2.0
// Who may know whom: the checks of cmake/boundaries.cmake hold on this tree and find what they are
// for in trees that break the rules.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/support/machine/places.h"
#include "tests/support/parameter_words.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/build/run_command.h"

namespace palpate {
namespace {

using test::CommandResult;
using test::run_cmake;
using test::TempFolder;
using testing::AllOf;
using testing::HasSubstr;

/// check_includes.cmake with the project's own rules on another tree.
CommandResult check_includes(const std::string& root) {
  const TempFolder script;
  script.write("check.cmake", "include(" + test::source_dir() +
                                  "/cmake/boundaries.cmake)\n"
                                  "set(RULES ${PALPATE_BOUNDARIES})\n"
                                  "set(ROOT " +
                                  root +
                                  ")\n"
                                  "include(" +
                                  test::source_dir() + "/cmake/check_includes.cmake)\n");
  return run_cmake("-P '" + (script.path() / "check.cmake").string() + "'");
}

/// A tree with one source.
CommandResult check_source(const std::string& file, const std::string& text) {
  const TempFolder tree;
  tree.write(file, text);
  return check_includes(tree.path().string());
}

TEST(IncludeBoundaries, HoldOnThisTree) {
  const CommandResult result = check_includes(test::source_dir());
  EXPECT_EQ(result.status, 0) << result.output;
}

TEST(IncludeBoundaries, LetAllowedIncludesPass) {
  const CommandResult result =
      check_source("mofc_node/mofc_node.h",
                   "#include <vector>\n"
                   "#include <Eigen/Core>\n"
                   "#include \"common/core/messages.h\"\n"
                   "#include \"mofc_node/controllers/vector_mofc.h\"\n"
                   "// physics_node/scene/scene.h in a comment is no include\n");
  EXPECT_EQ(result.status, 0) << result.output;
}

struct Forbidden {
  const char* file;
  const char* header;
  const char* rule;
};

void PrintTo(const Forbidden& include, std::ostream* out) {
  *out << include.file << " " << include.header;
}

class ForbiddenInclude : public testing::TestWithParam<Forbidden> {};

TEST_P(ForbiddenInclude, IsRefusedNamingFileHeaderAndRule) {
  const CommandResult result =
      check_source(GetParam().file, std::string("#include \"") + GetParam().header + "\"\n");

  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.output, AllOf(HasSubstr("cmake/boundaries.cmake"), HasSubstr(GetParam().file),
                                   HasSubstr(GetParam().header), HasSubstr(GetParam().rule)));
}

INSTANTIATE_TEST_SUITE_P(
    OfEachKind, ForbiddenInclude,
    testing::Values(
        Forbidden{"mofc_node/mofc_node.cpp", "physics_node/scene/scene.h", "mofc_node may include"},
        Forbidden{"mofc_node/mofc_node.cpp", "palpate/v1/messages.pb.h", "mofc_node may include"},
        Forbidden{"mofc_node/mofc_node.cpp", "common/link/codec/codec.h", "mofc_node may include"},
        Forbidden{"mofc_node/mofc_node.cpp", "mofc_node/../physics_node/scene.h",
                  "mofc_node may include"},
        Forbidden{"mofc_node/controllers/vector_mofc.h", "common/core/messages.h",
                  "mofc_node/controllers may include"},
        Forbidden{"physics_node/step.cpp", "mofc_node/mofc_node.h", "physics_node may include"},
        Forbidden{"device_node/device_node.h", "physics_node/physics_node.h",
                  "device_node may include"},
        Forbidden{"viewer_node/feed/mirror.cpp", "device_node/device_node.h",
                  "viewer_node/feed may include"},
        Forbidden{"common/core/clock.cpp", "common/process/log.h", "common/core may include"},
        Forbidden{"common/core/clock.cpp", "palpate/v1/messages.pb.h", "common/core may include"},
        Forbidden{"common/core/clock.cpp", "common/session/session.h", "common/core may include"},
        Forbidden{"common/session/session.cpp", "palpate/v1/session.pb.h",
                  "common/session may include"},
        Forbidden{"common/session/session.cpp", "common/session/file/session_rules.h",
                  "common/session may include"},
        Forbidden{"common/telemetry/event_log.h", "common/link/zmq_sender.h",
                  "common/telemetry may include"},
        Forbidden{"common/link/zmq_sender.cpp", "common/process/log.h", "common/link may include"},
        Forbidden{"common/link/zmq_sender.cpp", "palpate/v1/scene.pb.h", "common/link may include"},
        Forbidden{"common/link/codec/codec.cpp", "common/link/socket/link_socket.h",
                  "common/link/codec may include"},
        Forbidden{"common/link/codec/codec.cpp", "zmq.hpp", "common/link/codec may include"},
        Forbidden{"common/link/security/keys.cpp", "common/link/socket/endpoint.h",
                  "common/link/security may include"},
        Forbidden{"common/link/socket/link_socket.h", "common/link/zmq_sender.h",
                  "common/link/socket may include"},
        Forbidden{"viewer_node/feed/scene_mirror.h", "viewer_node/server/web_server.h",
                  "viewer_node/feed may include"},
        Forbidden{"viewer_node/feed/scene_mirror.h", "common/link/codec.h",
                  "viewer_node/feed may include"},
        Forbidden{"viewer_node/feed/scene_mirror.h", "viewer_node/recording/recording_file.h",
                  "viewer_node/feed may include"},
        Forbidden{"viewer_node/server/web_server.h", "viewer_node/process.h",
                  "viewer_node/server may include"},
        Forbidden{"viewer_node/server/web_server.cpp", "viewer_node/recording/recording_file.h",
                  "viewer_node/server may include"},
        Forbidden{"viewer_node/server/web_server.cpp", "common/link/codec.h",
                  "viewer_node/server may include"},
        Forbidden{"viewer_node/recording/replay.cpp", "viewer_node/server/web_server.h",
                  "viewer_node/recording may include"},
        Forbidden{"viewer_node/recording/replay.cpp", "viewer_node/live/feed.h",
                  "viewer_node/recording may include"},
        Forbidden{"viewer_node/live/feed.cpp", "mofc_node/mofc_node.h",
                  "viewer_node/live may include"},
        Forbidden{"viewer_node/live/feed.cpp", "dds/dds.h", "viewer_node/live may include"},
        Forbidden{"viewer_node/process_links.cpp", "deploy/ros/dds/node.h",
                  "viewer_node may include"},
        Forbidden{"mofc_node/mofc_node.cpp", "ros_messages.h", "mofc_node may include"},
        Forbidden{"deploy/palpate/tools.cpp", "deploy/ros/dds/node.h",
                  "deploy/palpate may include"},
        Forbidden{"deploy/lockstep/lockstep.h", "deploy/palpate/options.h",
                  "deploy/lockstep may include"},
        Forbidden{"deploy/lockstep/loopback.h", "CLI/CLI.hpp", "deploy/lockstep may include"},
        Forbidden{"deploy/palpate/options.h", "viewer_node/server/web_server.h",
                  "deploy/palpate may include"}),
    test::parameter_words<Forbidden>);

// surfaces ← files ← scene ← display
INSTANTIATE_TEST_SUITE_P(
    InsidePhysicsNode, ForbiddenInclude,
    testing::Values(
        Forbidden{"common/contact/proxy.h", "physics_node/surfaces/shape.h",
                  "common/contact may include"},
        Forbidden{"physics_node/surfaces/shape.cpp", "physics_node/files/surface_files.h",
                  "physics_node/surfaces may include"},
        Forbidden{"physics_node/surfaces/file_surface.h", "common/telemetry/physics_telemetry.h",
                  "physics_node/surfaces may include"},
        Forbidden{"physics_node/files/ply.cpp", "physics_node/scene/scene.h",
                  "physics_node/files may include"},
        Forbidden{"physics_node/scene/scene.cpp", "physics_node/display/display_mesh.h",
                  "physics_node/scene may include"},
        Forbidden{"physics_node/scene/scene.h", "mutex", "physics_node/scene may include"},
        Forbidden{"physics_node/display/scene_display.h", "physics_node/physics_node.h",
                  "physics_node/display may include"},
        Forbidden{"physics_node/physics_node.cpp", "physics_node/display/scene_display.h",
                  "physics_node may include"},
        Forbidden{"physics_node/physics_node.cpp", "common/session/session.h",
                  "physics_node may include"}),
    test::parameter_words<Forbidden>);

// What only a simulation knows, and what only the simulated device is told.
INSTANTIATE_TEST_SUITE_P(
    OfTheSimulatedTruth, ForbiddenInclude,
    testing::Values(
        Forbidden{"mofc_node/mofc_node.cpp", "device_node/simulation/simulated_device.h",
                  "mofc_node may include"},
        Forbidden{"mofc_node/mofc_node.cpp", "common/session/simulation_config.h",
                  "mofc_node may include"},
        Forbidden{"mofc_node/mofc_node.cpp", "common/session/session.h", "mofc_node may include"},
        Forbidden{"mofc_node/mofc_node.cpp", "common/session/device_config.h",
                  "mofc_node may include"},
        Forbidden{"device_node/device.h", "device_node/simulation/true_state.h",
                  "device_node may include"},
        Forbidden{"device_node/drivers/driver_registry.cpp", "device_node/simulation/hand.h",
                  "device_node/drivers may include"},
        Forbidden{"device_node/drivers/omni/omni_driver.h", "common/session/simulation_config.h",
                  "device_node/drivers may include"},
        Forbidden{"mofc_node/mofc_node.cpp", "common/telemetry/device_telemetry.h",
                  "mofc_node may include"},
        Forbidden{"mofc_node/mofc_node.cpp", "common/telemetry/telemetry.h",
                  "mofc_node may include"},
        Forbidden{"device_node/device_node.cpp", "device_node/simulation/plant.h",
                  "device_node may include"},
        Forbidden{"device_node/device_node.cpp", "common/session/simulation_config.h",
                  "device_node may include"},
        Forbidden{"device_node/device_node.cpp", "device_node/drivers/driver_registry.h",
                  "device_node may include"}),
    test::parameter_words<Forbidden>);

TEST(IncludeBoundaries, AreNotEvadedByAngleBrackets) {
  for (const char* header : {"physics_node/scene/scene.h", "palpate/v1/messages.pb.h", "zmq.hpp",
                             "spdlog/spdlog.h", "google/protobuf/message.h"}) {
    const CommandResult result =
        check_source("mofc_node/mofc_node.cpp", std::string("  #  include <") + header + ">\n");
    EXPECT_EQ(result.status, 1) << header;
    EXPECT_THAT(result.output, HasSubstr(header));
  }
}

// Headers that are installed include their neighbours without a folder.
TEST(IncludeBoundaries, LetAFileIncludeItsNeighbours) {
  const TempFolder tree;
  tree.write("mofc_node/controllers/energy_ledger.h", "");
  tree.write("mofc_node/controllers/guard_mofc.h", "#include \"energy_ledger.h\"\n");
  EXPECT_EQ(check_includes(tree.path().string()).status, 0);
  tree.write("mofc_node/controllers/vector_mofc.h", "#include \"zmq.h\"\n");
  EXPECT_EQ(check_includes(tree.path().string()).status, 1);
}

TEST(IncludeBoundaries, KeepLocksOutOfTheTickAndTheClamp) {
  for (const char* file :
       {"device_node/force_guard.h", "mofc_node/mofc_node.cpp",
        "mofc_node/controllers/energy_ledger.cpp", "common/core/inbox.h",
        "physics_node/physics_node.cpp", "common/contact/touch.cpp", "common/contact/proxy.cpp"}) {
    for (const char* header : {"mutex", "condition_variable", "future", "pthread.h"}) {
      EXPECT_EQ(check_source(file, std::string("#include <") + header + ">\n").status, 1)
          << file << " " << header;
    }
  }
  EXPECT_EQ(check_source("viewer_node/server/web_server.cpp", "#include <mutex>\n").status, 0);
  EXPECT_EQ(check_source("mofc_node/mofc_node.cpp", "#include <atomic>\n").status, 0);
}

TEST(IncludeBoundaries, LetCodecAndSessionFileSeeTheWire) {
  for (const char* file : {"common/link/codec/codec.cpp", "common/session/file/session_file.cpp"}) {
    const CommandResult result = check_source(file, "#include \"palpate/v1/messages.pb.h\"\n");
    EXPECT_EQ(result.status, 0) << result.output;
  }
  EXPECT_EQ(check_source("common/link/socket/zmq_context.cpp", "#include <zmq.hpp>\n").status, 0);
  EXPECT_EQ(check_source("common/session/file/session_file.cpp", "#include <zmq.hpp>\n").status, 1);
}

TEST(IncludeBoundaries, LetTheProgramsConnectNodesToTheWorld) {
  for (const char* file : {"mofc_node/main.cpp", "mofc_node/process.h", "mofc_node/process.cpp"}) {
    const CommandResult result = check_source(file, "#include \"common/link/device_links.h\"\n");
    EXPECT_EQ(result.status, 0) << result.output;
  }
  // by their whole name only
  EXPECT_EQ(
      check_source("mofc_node/preprocess.cpp", "#include \"common/link/codec/codec.h\"\n").status,
      1);
}

/// Configures a project that includes cmake/boundaries.cmake and then does `text`.
CommandResult configure(const std::string& text) {
  const TempFolder tree;
  tree.write("CMakeLists.txt",
             "cmake_minimum_required(VERSION 3.25)\n"
             "project(x LANGUAGES NONE)\n"
             "include(" +
                 test::source_dir() +
                 "/cmake/boundaries.cmake)\n"
                 "add_library(node INTERFACE)\n"
                 "add_library(middle INTERFACE)\n"
                 "add_library(sockets INTERFACE)\n"
                 "add_library(alias::middle ALIAS middle)\n"
                 "add_library(alias::sockets ALIAS sockets)\n" +
                 text);
  return run_cmake("-G '" PALPATE_GENERATOR "' -S '" + tree.path().string() + "' -B '" +
                   (tree.path() / "build").string() + "'");
}

TEST(LinkBoundaries, LetOtherLinksPass) {
  const CommandResult result = configure(
      "target_link_libraries(node INTERFACE alias::middle)\n"
      "target_link_libraries(sockets INTERFACE node)\n"  // the other way round is no matter
      "palpate_forbid_links(node sockets)\n");
  EXPECT_EQ(result.status, 0) << result.output;
}

TEST(LinkBoundaries, RefuseAForbiddenLinkDirectOrNotByWhateverName) {
  for (const char* links : {
           "target_link_libraries(node INTERFACE sockets)\n",
           "target_link_libraries(node INTERFACE alias::sockets)\n",
           "target_link_libraries(node INTERFACE alias::middle)\n"
           "target_link_libraries(middle INTERFACE sockets)\n",
           // how a PRIVATE link of a static library is handed on
           "target_link_libraries(node INTERFACE middle)\n"
           "target_link_libraries(middle INTERFACE $<LINK_ONLY:alias::sockets>)\n",
           // in a circle
           "target_link_libraries(node INTERFACE middle)\n"
           "target_link_libraries(middle INTERFACE node sockets)\n",
       }) {
    const CommandResult result =
        configure(std::string(links) + "palpate_forbid_links(node sockets)\n");
    EXPECT_EQ(result.status, 1) << links;
    EXPECT_THAT(result.output,
                AllOf(HasSubstr("node links sockets"), HasSubstr("cmake/boundaries.cmake"),
                      HasSubstr("common/core/messages.h")));
  }
}

}  // namespace
}  // namespace palpate
