// SPDX-License-Identifier: Apache-2.0
// The reference of the installed headers, docs/api: nothing public is left without documentation.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/build/run_command.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using test::CommandResult;
using test::run_command;
using test::TempFolder;

class ApiReference : public testing::Test {
 protected:
  void SetUp() override {
    if (run_command("doxygen --version").status != 0) {
      GTEST_SKIP() << "no doxygen (apt-get install doxygen)";
    }
  }

  /// Runs doxygen as docs/api/Doxyfile says, but into the folder of the test, with these settings
  /// on top.
  [[nodiscard]] CommandResult document(const std::string& settings = "") const {
    return run_command("cd '" + test::source_dir() +
                       "' && printf '%s\\n' 'OUTPUT_DIRECTORY = " + output_.path().string() +
                       "' '" + settings + "' | cat docs/api/Doxyfile - | doxygen -");
  }

  TempFolder output_;
};

TEST_F(ApiReference, HasNoWarning) {
  const CommandResult documented = document();
  EXPECT_EQ(documented.status, 0) << documented.output;
}

TEST_F(ApiReference, RefusesAnUndocumentedFunctionTypeAndMember) {
  const TempFolder headers;
  for (const char* text :
       {"void bare(int x);", "struct Bare { int x; };", "/// S.\nstruct S { int bare; };",
        "/// E.\nenum class E { kBare };", "#define BARE 1"}) {
    headers.write("h.h", std::string("/// @file\n/// h.h — a header.\n") + text + "\n");
    const CommandResult documented = document("INPUT = " + headers.path().string());
    EXPECT_NE(documented.status, 0) << text;
    EXPECT_NE(documented.output.find("is not documented"), std::string::npos) << documented.output;
  }
}

// A header without @file would be passed over, with all that it declares outside of a class.
TEST_F(ApiReference, HasEveryInstalledHeader) {
  const TempFolder prefix;
  for (const char* component : {"controllers", "tissue", "physics", "devices"}) {
    const CommandResult installed =
        test::run_cmake(std::string("--install '" PALPATE_BUILD_DIR "' --component ") + component +
                        " --prefix '" + prefix.path().string() + "'");
    ASSERT_EQ(installed.status, 0) << installed.output;
  }
  const CommandResult documented = document();
  ASSERT_EQ(documented.status, 0) << documented.output;

  const std::string files = test::text_of(output_.path() / "html/files.html");
  int headers = 0;
  for (const auto& entry : fs::recursive_directory_iterator(prefix.path() / "include")) {
    if (!entry.is_regular_file()) continue;
    ++headers;
    const std::string name = entry.path().filename().string();
    EXPECT_NE(files.find(">" + name + "<"), std::string::npos) << name;
  }
  EXPECT_GT(headers, 20);
}

}  // namespace
}  // namespace palpate
