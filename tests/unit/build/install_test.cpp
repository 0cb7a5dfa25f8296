// SPDX-License-Identifier: Apache-2.0
// What is installed serves others.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/support/machine/machine.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/build/run_command.h"

namespace palpate {
namespace {

using test::CommandResult;
using test::run_cmake;

// A component, installed into a folder of its own, and a project of its examples built against it.
class InstalledExamples {
 public:
  /// @param example  folder in share/palpate/examples   @param options  of the project
  void build(const std::string& component, const std::string& example,
             const std::string& options = {}) {
    const CommandResult installed = run_cmake("--install '" PALPATE_BUILD_DIR "' --component " +
                                              component + " --prefix '" + prefix() + "'");
    ASSERT_EQ(installed.status, 0) << installed.output;
    const CommandResult configured =
        run_cmake("-G Ninja -S '" + prefix() + "/share/palpate/examples/" + example + "' -B '" +
                  folder() + "' -DCMAKE_PREFIX_PATH='" + prefix() + "'" + options);
    ASSERT_EQ(configured.status, 0) << configured.output;
    const CommandResult built = run_cmake("--build '" + folder() + "'");
    ASSERT_EQ(built.status, 0) << built.output;
  }
  [[nodiscard]] std::string prefix() const { return (files_.path() / "prefix").string(); }
  /// Of what was built.
  [[nodiscard]] std::string folder() const { return (files_.path() / "build").string(); }
  /// Runs the tests of the examples, of which there are so many.
  void expect_tests(int count) const {
    const CommandResult ran = run_cmake("--build '" + folder() + "' --target test");
    EXPECT_EQ(ran.status, 0) << ran.output;
    EXPECT_NE(ran.output.find("100% tests passed, 0 tests failed out of " + std::to_string(count)),
              std::string::npos)
        << ran.output;
  }

 private:
  test::TempFolder files_;
};

// In C++, C, Python, and as a wrapper of two device libraries, of which stubs are there.
TEST(Install, TheExamplesOfTheControllersAreAProjectOfTheirOwn) {
  InstalledExamples examples;
  ASSERT_NO_FATAL_FAILURE(examples.build("controllers", "controllers"));
  examples.expect_tests(11);
}

// In C and C++, against the shared library that stands alone.
TEST(Install, TheExamplesOfTheTissueAreAProjectOfTheirOwn) {
  InstalledExamples examples;
  ASSERT_NO_FATAL_FAILURE(examples.build(
      "tissue", "tissue",
      " -DSESSION='" + test::source_dir() + "/deploy/sessions/block_with_tumour.txtpb'"));
  EXPECT_TRUE(std::filesystem::exists(examples.prefix() + "/share/palpate/python/tissue/setup.py"));
  examples.expect_tests(4);
}

// The example as a project of its own, out of the installed tree alone.
TEST(Install, APhysicsOfOnesOwnIsBuiltAndConforms) {
  InstalledExamples examples;
  ASSERT_NO_FATAL_FAILURE(examples.build("physics", "half_space"));
  const test::QuietMachine machine;
  const CommandResult conforms =
      test::run_command("'" PALPATE_BUILD_DIR "/bin/palpate' conform physics -- '" +
                        examples.folder() + "/half_space'");

  if (conforms.status == 1 && !machine.may_check("checks of real time")) return;
  EXPECT_EQ(conforms.status, 0) << conforms.output;
}

// With the warnings of that project as errors, none of which may come from here.
TEST(Install, IsNotNeededByAProjectThatAddsThisOneAsAFolder) {
  const test::TempFolder files;
  files.write("CMakeLists.txt",
              "cmake_minimum_required(VERSION 3.25)\n"
              "project(consumer LANGUAGES CXX)\n"
              "set(CMAKE_CXX_FLAGS \"-Wall -Wextra -Weffc++ -Wpadded -Werror\")\n"
              "add_subdirectory(" +
                  test::source_dir() +
                  " palpate)\n"
                  "add_executable(consumer main.cpp)\n"
                  "target_compile_features(consumer PRIVATE cxx_std_20)\n"
                  "target_link_libraries(consumer PRIVATE palpate::controllers)\n"
                  "if(TARGET core_test)\n"
                  "  message(FATAL_ERROR \"tests of the folder\")\n"
                  "endif()\n");
  files.write("main.cpp",
              "#include <palpate/controllers/catalogue.h>\n"
              "int main() { return palpate::controllers::make_named(\"guard\", {}) ? 0 : 1; }\n");
  const std::string build = (files.path() / "build").string();

  const CommandResult configured =
      run_cmake("-G Ninja -S '" + files.path().string() + "' -B '" + build + "'");
  ASSERT_EQ(configured.status, 0) << configured.output;
  const CommandResult built = run_cmake("--build '" + build + "' --target consumer");
  ASSERT_EQ(built.status, 0) << built.output;

  EXPECT_EQ(test::run_command("'" + build + "/consumer'").status, 0);
  EXPECT_FALSE(std::filesystem::exists(build + "/palpate/palpateConfigVersion.cmake"));
}

TEST(Install, AProgramWithoutItsLibraryOfRivalsSaysSo) {
  const test::TempFolder files;
  std::filesystem::create_directory(files.path() / "bin");
  const std::filesystem::path program = files.path() / "bin/mofc_node";
  std::filesystem::copy_file(test::binary_dir() + "/mofc_node", program);
  const CommandResult result =
      test::run_command("'" + program.string() + "' --session '" + test::source_dir() +
                        "/deploy/sessions/default.txtpb' --set mofc.controller=energy_tank");
  EXPECT_EQ(result.status, 2);
  EXPECT_NE(result.output.find("lib/palpate/palpate_rivals.so: cannot open"), std::string::npos)
      << result.output;
}

TEST(Install, PutsTheProgramsIntoAComponent) {
  const std::string rules = test::text_of(PALPATE_BUILD_DIR "/cmake_install.cmake");
  EXPECT_NE(rules.find("\"programs\""), std::string::npos);
  EXPECT_EQ(rules.find("\"Unspecified\""), std::string::npos);
}

TEST(Install, SaysWhichComponentIsNotThere) {
  const test::TempFolder files;
  const std::string prefix = (files.path() / "prefix").string();
  const CommandResult installed = run_cmake(
      "--install '" PALPATE_BUILD_DIR "' --component controllers --prefix '" + prefix + "'");
  ASSERT_EQ(installed.status, 0) << installed.output;
  const std::string project = test::source_dir() + "/physics_node/sdk/examples/half_space";
  const CommandResult configured =
      run_cmake("-S '" + project + "' -B '" + (files.path() / "build").string() +
                "' -DCMAKE_PREFIX_PATH='" + prefix + "'");
  EXPECT_NE(configured.status, 0);
  EXPECT_NE(configured.output.find("component physics is not installed here"), std::string::npos)
      << configured.output;
}

}  // namespace
}  // namespace palpate
