// SPDX-License-Identifier: Apache-2.0
// Sessions from strangers: what they run is shown, and refused where somebody else may have put it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/posix_acl.h>
#include <sys/stat.h>
#include <sys/xattr.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>
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

// A stranger who owns the middle of the chain decides where it ends.
TEST_F(Stranger, ByAChainOfLinksIsRefusedForEachOfThem) {
  const test::TempFolder hop;
  fs::rename(path("physics.sh"), path("real.sh"));
  fs::create_symlink(path("real.sh"), hop.path() / "to_real");
  fs::create_symlink(hop.path() / "to_real", path("physics.sh"));
  EXPECT_NE(launch().status, 2);
  EXPECT_TRUE(has_run());
  ASSERT_EQ(chmod(hop.path().c_str(), 0777), 0);
  const Outcome refused = launch();
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("other users may write " + hop.path().string()));

  // the session too, by a folder that is a link
  fs::remove(path("physics.sh"));
  fs::rename(path("real.sh"), path("physics.sh"));
  fs::create_directory_symlink(folder_.path(), hop.path() / "folder");
  fs::create_directory_symlink(hop.path() / "folder", home_.path() / "mine");
  const Outcome session = run_program(
      "palpate", {"launch", (home_.path() / "mine/session.txtpb").string(), "--seconds", "1"});
  EXPECT_EQ(session.status, 2);
  EXPECT_THAT(session.err, HasSubstr("other users may write " + hop.path().string()));
}

TEST_F(Stranger, OfAnotherUserIsRefused) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can give a file away";
  ASSERT_EQ(chown(path("session.txtpb").c_str(), 65534, 65534), 0);
  const Outcome refused = launch();
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("session.txtpb belongs to another user"));
  // who owns the program that runs it decides already what it does: tested by its folders
  setenv("SUDO_UID", "65534", 1);
  EXPECT_NE(launch().status, 2) << "of the user who called sudo";
  unsetenv("SUDO_UID");
}

// A sticky folder on the way is /tmp itself, where the other tests are.
TEST_F(Stranger, InAStickyFolderIsRefusedAsSomebodyCouldPutThereWhatItLoads) {
  ASSERT_EQ(chmod(folder_.path().c_str(), 01777), 0);
  const Outcome refused = launch();
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("other users may put files into " + folder_.path().string()));
}

// user 65534 may write it, by a list that the mode does not show
TEST_F(Stranger, WhatAnAccessControlListOpensIsRefused) {
  constexpr std::uint32_t kNobody = 65534;
  const auto entry = [](std::uint16_t tag, std::uint16_t permissions, std::uint32_t id) {
    std::string bytes(8, '\0');
    std::memcpy(bytes.data(), &tag, 2);
    std::memcpy(&bytes[2], &permissions, 2);
    std::memcpy(&bytes[4], &id, 4);
    return bytes;
  };
  const auto give = [&](std::uint16_t permissions, std::uint32_t user) {
    const std::string list = std::string("\2\0\0\0", 4) + entry(ACL_USER_OBJ, 7, ~0U) +
                             entry(ACL_USER, permissions, user) + entry(ACL_GROUP_OBJ, 5, ~0U) +
                             entry(ACL_MASK, 7, ~0U) + entry(ACL_OTHER, 5, ~0U);
    return setxattr(path("physics.sh").c_str(), "system.posix_acl_access", list.data(), list.size(),
                    0);
  };
  if (give(7, kNobody) != 0) GTEST_SKIP() << "no access control lists here";
  const Outcome refused = launch();
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("other users may write " + path("physics.sh")));
  ASSERT_EQ(give(5, kNobody), 0);
  EXPECT_NE(launch().status, 2) << "may read it";
  ASSERT_EQ(give(7, geteuid()), 0);
  EXPECT_NE(launch().status, 2) << "is the user";
}

// python3 FOLDER, python3 -m MODULE, program --model=FILE
TEST_F(Stranger, WithFoldersModulesAndFilesAmongTheArgumentsIsRefusedIfOthersMayWriteThem) {
  fs::create_directories(path("package"));
  fs::create_directories(path("deep"));
  for (const char* name : {"package/__main__.py", "module.py", "deep/module.py", "model.dat"}) {
    write(name, "");
  }
  const auto with = [&](const std::string& words) {
    write("session.txtpb",
          "name: \"stranger\"\nphysics { command: [\"/bin/sh\", \"-c\", "
          "\"sleep 60\", " +
              words + "] }\n");
    return launch();
  };
  const auto is_told = [&](const std::string& words, const std::string& name, mode_t open) {
    EXPECT_NE(with(words).status, 2) << words;
    struct stat before {};
    ASSERT_EQ(stat(path(name).c_str(), &before), 0);
    ASSERT_EQ(chmod(path(name).c_str(), open), 0);
    const Outcome refused = with(words);
    EXPECT_EQ(refused.status, 2) << words;
    EXPECT_THAT(refused.err, HasSubstr(path(name)));
    ASSERT_EQ(chmod(path(name).c_str(), before.st_mode & 07777), 0);
  };
  is_told("\"package\"", "package", 0777);
  is_told("\"package\"", "package/__main__.py", 0666);
  is_told("\"-m\", \"module\"", "module.py", 0666);
  is_told("\"-m\", \"deep.module\"", "deep/module.py", 0666);
  is_told("\"-m\", \"package\"", "package/__main__.py", 0666);
  is_told("\"--model=model.dat\"", "model.dat", 0666);
}

// The script changes itself, as somebody else might, and ends: the supervisor would start it again.
TEST_F(Stranger, ThatIsTrustedIsNotStartedAgainOnceItHasChanged) {
  ASSERT_EQ(chmod(folder_.path().c_str(), 0777), 0);
  write("physics.sh", "#!/bin/sh\necho ran >> \"$(dirname \"$0\")/runs\"\necho >> \"$0\"\n");
  ASSERT_EQ(chmod(path("physics.sh").c_str(), 0755), 0);
  const Outcome outcome = launch({"--trust"});
  EXPECT_NE(outcome.status, 2) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("not started again"));
  EXPECT_EQ(fs::file_size(path("runs")), 4U);
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
