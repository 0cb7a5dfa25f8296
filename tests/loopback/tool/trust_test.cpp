// SPDX-License-Identifier: Apache-2.0
// Sessions from strangers: what they run is shown, and refused where somebody else may have put it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using test::Outcome;
using test::run_program;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

namespace fs = std::filesystem;

/// A session whose physics is a script that writes a file "ran" beside itself and then ends.
class Stranger : public testing::Test {
 protected:
  void SetUp() override {
    setenv("PALPATE_STATE_DIR", (home_.path() / "state").c_str(), 1);
    ASSERT_EQ(chmod(folder_.path().c_str(), 0755), 0);
    write("physics.sh", "#!/bin/sh\ntouch \"$(dirname \"$0\")/ran\"\nexec sleep 60\n");
    ASSERT_EQ(chmod(path("physics.sh").c_str(), 0755), 0);
    write("session.txtpb", "name: \"stranger\"\nphysics { command: [\"./physics.sh\"] }\n");
  }
  void TearDown() override { unsetenv("PALPATE_STATE_DIR"); }

  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(path(name)) << text;
    chmod(path(name).c_str(), 0644);
  }
  [[nodiscard]] Outcome launch(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{"launch", path("session.txtpb"), "--seconds",
                                       "1",      "--no-viewer",         "--no-realtime"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program("palpate", arguments);
  }
  /// Since the last call.
  [[nodiscard]] bool has_run() const { return fs::remove(path("ran")); }

  test::RunFolder run_;
  test::TempFolder home_;
  test::TempFolder folder_;
};

TEST_F(Stranger, OfTheUsersOwnRunsAndIsShown) {
  const Outcome own = launch();
  EXPECT_TRUE(has_run()) << own.err;
  EXPECT_NE(own.status, 2) << own.err;
  EXPECT_THAT(own.err, HasSubstr("palpate: physics.command runs " + path("physics.sh")));
  EXPECT_THAT(launch({"-q"}).err, Not(HasSubstr("physics.command runs")));
}

TEST_F(Stranger, InAFolderThatOthersMayWriteIsRefusedUntilItIsTrusted) {
  ASSERT_EQ(chmod(folder_.path().c_str(), 0777), 0);
  const Outcome refused = launch();
  EXPECT_EQ(refused.status, 2);
  EXPECT_FALSE(has_run());
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("other users may write " + folder_.path().string()),
                    HasSubstr("physics.command runs " + path("physics.sh")), HasSubstr("--trust")));

  EXPECT_NE(launch({"--trust"}).status, 2);
  EXPECT_TRUE(has_run());
  EXPECT_NE(launch().status, 2) << "remembered";
  EXPECT_TRUE(has_run());

  // another program under the same name
  std::ofstream(path("physics.sh"), std::ios::app) << "# more\n";
  EXPECT_EQ(launch().status, 2);
  EXPECT_FALSE(has_run());
  EXPECT_NE(launch({"--trust"}).status, 2);
  EXPECT_TRUE(has_run());
  // another session
  write("session.txtpb",
        "name: \"stranger\" duration_s: 3\nphysics { command: [\"./physics.sh\"] }\n");
  EXPECT_EQ(launch().status, 2);
  EXPECT_FALSE(has_run());
}

TEST_F(Stranger, WithAProgramOrScriptThatOthersMayWriteIsRefused) {
  ASSERT_EQ(chmod(path("physics.sh").c_str(), 0777), 0);
  EXPECT_EQ(launch().status, 2);
  ASSERT_EQ(chmod(path("physics.sh").c_str(), 0755), 0);

  write("model.py", "");
  write("session.txtpb",
        "name: \"stranger\"\nphysics { command: [\"/bin/sh\", \"-c\", \"sleep 60\", \"model.py\"] "
        "}\n");
  EXPECT_NE(launch().status, 2);
  ASSERT_EQ(chmod(path("model.py").c_str(), 0666), 0);
  const Outcome refused = launch();
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("other users may write " + path("model.py")));
}

TEST_F(Stranger, ByALinkFromASafeFolderIsRefusedAsWhereItLeads) {
  ASSERT_EQ(chmod(folder_.path().c_str(), 0777), 0);
  write("session.txtpb", "name: \"stranger\"\nphysics { command: [\"/bin/sleep\", \"60\"] }\n");
  const fs::path link = home_.path() / "session.txtpb";
  fs::create_symlink(path("session.txtpb"), link);
  const Outcome refused = run_program("palpate", {"launch", link.string(), "--seconds", "1"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("other users may write"));
}

TEST_F(Stranger, OfAnotherUserIsRefusedAndAStickyFolderIsSafe) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can give a file away";
  ASSERT_EQ(chmod(folder_.path().c_str(), 01777), 0);
  EXPECT_NE(launch().status, 2) << "as in /tmp";
  ASSERT_EQ(chown(path("session.txtpb").c_str(), 65534, 65534), 0);
  const Outcome refused = launch();
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("session.txtpb belongs to another user"));
  // who owns the program that runs it decides already what it does: tested by its folders
  setenv("SUDO_UID", "65534", 1);
  EXPECT_NE(launch().status, 2) << "of the user who called sudo";
  unsetenv("SUDO_UID");
}

TEST_F(Stranger, WithoutForeignCodeIsNobodysBusiness) {
  ASSERT_EQ(chmod(folder_.path().c_str(), 0777), 0);
  write("session.txtpb", "name: \"stranger\"\n");
  EXPECT_NE(launch().status, 2);
  write("session.txtpb", "name: \"stranger\"\nphysics { command: [\"./physics.sh\"] }\n");
  const Outcome elsewhere =
      run_program("palpate", {"launch", path("session.txtpb"), "--seconds", "1", "--no-realtime",
                              "--nodes", "device,mofc"});
  EXPECT_NE(elsewhere.status, 2) << "physics runs elsewhere\n" << elsewhere.err;
  EXPECT_FALSE(has_run());
}

// scene check, doctor and loopback run and load nothing of it
TEST_F(Stranger, IsExaminedWithoutBeingRun) {
  ASSERT_EQ(chmod(folder_.path().c_str(), 0777), 0);
  EXPECT_EQ(run_program("palpate", {"scene", "check", path("session.txtpb")}).status, 0);
  EXPECT_EQ(run_program("palpate", {"loopback", path("session.txtpb")}).status, 2);
  static_cast<void>(run_program("palpate", {"doctor", path("session.txtpb")}));
  EXPECT_FALSE(has_run());

  // a library whose constructor writes the file
  write("library.c",
        "#include <stdio.h>\n__attribute__((constructor)) static void run(void) {\n"
        "  FILE* file = fopen(\"" +
            path("ran") + "\", \"w\"); if (file) fclose(file); }\n");
  ASSERT_EQ(
      run_program("/usr/bin/cc", {"-shared", "-fPIC", "-o", path("library.so"), path("library.c")})
          .status,
      0);
  write("session.txtpb", "name: \"stranger\"\ndevice { plugin { library: \"./library.so\" } }\n");
  EXPECT_EQ(run_program("palpate", {"scene", "check", path("session.txtpb")}).status, 0);
  const Outcome doctor = run_program("palpate", {"doctor", path("session.txtpb")});
  EXPECT_THAT(doctor.out, AllOf(HasSubstr(path("library.so")), HasSubstr("not loaded")));
  static_cast<void>(
      run_program("palpate", {"loopback", path("session.txtpb"), "--seconds", "0.1"}));
  EXPECT_FALSE(has_run());
  for (const std::vector<std::string>& command :
       {std::vector<std::string>{"launch", path("session.txtpb"), "--seconds", "1"},
        {"identify", path("session.txtpb")},
        {"conform", "device", path("session.txtpb")}}) {
    const Outcome refused = run_program("palpate", command);
    EXPECT_EQ(refused.status, 2) << command.front();
    EXPECT_THAT(refused.err, HasSubstr("device.plugin.library loads " + path("library.so")));
  }
  EXPECT_FALSE(has_run());
}

// as docs/devices.md writes it, and from the folder of the session
TEST_F(Stranger, LibraryIsBesideTheSessionWhereverThatIs) {
  write("session.txtpb", "name: \"stranger\"\ndevice { plugin { library: \"./library.so\" } }\n");
  const fs::path before = fs::current_path();
  fs::current_path(folder_.path());
  const Outcome doctor = run_program("palpate", {"doctor", "session.txtpb"});
  fs::current_path(before);
  EXPECT_THAT(doctor.out + doctor.err, HasSubstr(path("library.so")));
}

}  // namespace
}  // namespace palpate
