// What is installed serves others.
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/temp_folder.h"
#include "tests/unit/build/run_command.h"

namespace palpate {
namespace {

using test::CommandResult;
using test::run_cmake;

constexpr const char* kProject = R"(cmake_minimum_required(VERSION 3.25)
project(other LANGUAGES CXX)
find_package(palpate 0.1 REQUIRED)
add_executable(other main.cpp)
target_link_libraries(other PRIVATE palpate::controllers)
enable_testing()
add_test(NAME other COMMAND other)
)";
// With nothing absorbed yet, what the device's own friction absorbs is all that may act.
constexpr const char* kMain = R"(#include <cmath>

#include <palpate/controllers/paper_mofc.h>

int main() {
  using namespace palpate::controllers;
  PaperMofc clamp(MofcParameters{.f_d = 0.1, .f_co = 0.1, .T = 0.001});
  const ControlOutput out = clamp.step({.asked_force_on_hand_newton = {0.0, 0.0, 1.0}});
  return std::abs(out.force_on_hand_newton.z() - 0.1) < 1e-12 ? 0 : 1;
}
)";

TEST(Install, TheControllersByThemselvesServeAnotherProject) {
  const test::TempFolder files;
  const std::string prefix = (files.path() / "prefix").string();
  const CommandResult installed = run_cmake(
      "--install '" PALPATE_BUILD_DIR "' --component controllers --prefix '" + prefix + "'");
  ASSERT_EQ(installed.status, 0) << installed.output;
  files.write("other/CMakeLists.txt", kProject);
  files.write("other/main.cpp", kMain);
  const std::string source = (files.path() / "other").string();
  const std::string build = (files.path() / "build").string();

  const CommandResult configured =
      run_cmake("-S '" + source + "' -B '" + build + "' -DCMAKE_PREFIX_PATH='" + prefix + "'");
  ASSERT_EQ(configured.status, 0) << configured.output;
  const CommandResult built = run_cmake("--build '" + build + "' --target all test");

  EXPECT_EQ(built.status, 0) << built.output;
}

// The example as a project of its own, out of the installed tree alone.
TEST(Install, APhysicsOfOnesOwnIsBuiltAndConforms) {
  const test::TempFolder files;
  const std::string prefix = (files.path() / "prefix").string();
  const CommandResult installed =
      run_cmake("--install '" PALPATE_BUILD_DIR "' --component physics --prefix '" + prefix + "'");
  ASSERT_EQ(installed.status, 0) << installed.output;
  const std::string source = prefix + "/share/palpate/examples/half_space";
  const std::string build = (files.path() / "build").string();

  const CommandResult configured = run_cmake("-G Ninja -S '" + source + "' -B '" + build +
                                             "' -DCMAKE_PREFIX_PATH='" + prefix + "'");
  ASSERT_EQ(configured.status, 0) << configured.output;
  const CommandResult built = run_cmake("--build '" + build + "'");
  ASSERT_EQ(built.status, 0) << built.output;
  const CommandResult conforms = test::run_command(
      "'" PALPATE_BUILD_DIR "/bin/palpate' conform physics -- '" + build + "/half_space'");

  EXPECT_EQ(conforms.status, 0) << conforms.output;
}

TEST(Install, SaysWhichComponentIsNotThere) {
  const test::TempFolder files;
  const std::string prefix = (files.path() / "prefix").string();
  const CommandResult installed = run_cmake(
      "--install '" PALPATE_BUILD_DIR "' --component controllers --prefix '" + prefix + "'");
  ASSERT_EQ(installed.status, 0) << installed.output;
  const std::string project = PALPATE_SOURCE_DIR "/physics_node/sdk/examples/half_space";
  const CommandResult configured =
      run_cmake("-S '" + project + "' -B '" + (files.path() / "build").string() +
                "' -DCMAKE_PREFIX_PATH='" + prefix + "'");
  EXPECT_NE(configured.status, 0);
  EXPECT_NE(configured.output.find("component physics is not installed here"), std::string::npos)
      << configured.output;
}

}  // namespace
}  // namespace palpate
