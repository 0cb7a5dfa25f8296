// SPDX-License-Identifier: Apache-2.0
// What systemd itself says of the units in deploy/systemd.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"
#include "tests/unit/build/run_command.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using test::CommandResult;
using test::run_command;

/// The units as they are installed, but for the programs, which are those of this build.
class Service : public testing::Test {
 protected:
  void SetUp() override {
    if (run_command("systemd-analyze --version").status != 0) {
      GTEST_SKIP() << "no systemd-analyze here (Debian: systemd)";
    }
    for (const fs::directory_entry& unit :
         fs::directory_iterator(test::source_dir() + "/deploy/systemd")) {
      std::string content = test::text_of(unit.path());
      const std::string installed = "ExecStart=/usr/bin/";
      if (const std::size_t at = content.find(installed); at != std::string::npos) {
        content.replace(at, installed.size(), "ExecStart=" + test::binary_dir() + "/");
      }
      files_.write(unit.path().filename(), content);
    }
  }
  [[nodiscard]] CommandResult analyze(const std::string& arguments) const {
    return run_command("SYSTEMD_UNIT_PATH='" + files_.path().string() + ":' systemd-analyze " +
                       arguments);
  }

  /// Whether the unit of that node has this line.
  [[nodiscard]] bool says(const std::string& node, const std::string& line) const {
    const std::string unit = test::text_of(files_.path() / ("palpate-" + node + "@.service"));
    return unit.find("\n" + line + "\n") != std::string::npos;
  }

  test::TempFolder files_;
  const std::string nodes_ =
      " palpate-device@default.service palpate-mofc@default.service"
      " palpate-physics@default.service palpate-viewer@default.service"
      " palpate-standby@default.service";
};

TEST_F(Service, TheUnitsAreValid) {
  const CommandResult verified = analyze("verify --man=no palpate@default.target" + nodes_);

  EXPECT_EQ(verified.status, 0);
  EXPECT_EQ(verified.output, "");
}

TEST_F(Service, AWrongUnitIsFound) {
  std::ofstream(files_.path() / "palpate-device@.service", std::ios::app) << "LimitRtPrio=80\n";

  EXPECT_NE(analyze("verify --man=no palpate-device@default.service").output, "");
}

// 3.0 of 10 is systemd's "OK"; without a sandbox it would be 9.6.
TEST_F(Service, TheNodesAreShutIn) {
  const CommandResult judged = analyze("security --offline=yes --threshold=30 --no-pager" + nodes_);

  EXPECT_EQ(judged.status, 0) << judged.output;
}

// The real-time limits of the tick are for the two nodes that have one.
TEST_F(Service, OnlyTheTickMayHaveRealTime) {
  for (const auto& [node, is_realtime] : {std::pair("device", true),
                                          {"mofc", true},
                                          {"physics", false},
                                          {"standby", false},
                                          {"viewer", false}}) {
    EXPECT_EQ(says(node, "LimitRTPRIO=80"), is_realtime) << node;
    EXPECT_EQ(says(node, "RestrictRealtime=yes"), !is_realtime) << node;
  }
}

// Ten starts, half a second apart, take less than 30 s.
TEST_F(Service, ANodeThatEndsAtEveryStartIsLeftAlone) {
  for (const char* node : {"device", "mofc", "physics", "standby", "viewer"}) {
    EXPECT_TRUE(says(node, "RestartSec=500ms")) << node;
    EXPECT_TRUE(says(node, "StartLimitIntervalSec=30")) << node;
    EXPECT_TRUE(says(node, "StartLimitBurst=10")) << node;
  }
}

// After a reboot an address may come later than the services.
TEST_F(Service, ANodeWaitsForItsNetwork) {
  for (const char* node : {"device", "mofc", "physics", "standby", "viewer"}) {
    EXPECT_TRUE(says(node, "After=network-online.target")) << node;
    EXPECT_TRUE(says(node, "Wants=network-online.target")) << node;
    const std::string unit =
        test::text_of(files_.path() / ("palpate-" + std::string(node) + "@.service"));
    EXPECT_NE(unit.find(" --wait-for-address"), std::string::npos) << node;
  }
}

// ProtectSystem=strict leaves a node no other folder that outlives a reboot.
TEST_F(Service, RecordingsHaveAFolder) {
  for (const char* node : {"device", "mofc", "physics", "standby", "viewer"}) {
    EXPECT_TRUE(says(node, "StateDirectory=palpate")) << node;
    EXPECT_TRUE(says(node, "StateDirectoryMode=0700")) << node;
  }
  EXPECT_NE(test::text_of(files_.path() / "palpate-viewer@.service")
                .find(" --record-folder /var/lib/palpate"),
            std::string::npos);
}

// libzmq ends the process if it may not list the interfaces when it binds tcp.
TEST_F(Service, ANodeMayBindTcp) {
  for (const char* node : {"device", "mofc", "physics", "standby", "viewer"}) {
    EXPECT_TRUE(says(node, "RestrictAddressFamilies=AF_UNIX AF_INET AF_INET6 AF_NETLINK")) << node;
  }
}

/// The scripts of the package below a folder in place of /, with commands that only report.
class MaintainerScripts : public testing::Test {
 protected:
  MaintainerScripts() {
    for (const char* folder :
         {"bin", "root/run/systemd/system", "root/run/palpate/default", "root/var/lib/palpate",
          "root/var/cache/palpate", "root/etc/palpate/keys",
          "root/etc/systemd/system/multi-user.target.wants",
          "root/etc/systemd/system/palpate@a.target.wants",
          "root/etc/systemd/system/palpate-device@.service.d"}) {
      fs::create_directories(files_.path() / folder);
    }
    for (const char* file : {"root/etc/palpate/default.txtpb", "root/var/lib/palpate/run.mcap",
                             "root/etc/systemd/system/multi-user.target.wants/palpate@a.target",
                             "root/etc/systemd/system/palpate-viewer@a.service",
                             "root/etc/systemd/system/other.service"}) {
      std::ofstream(files_.path() / file) << "x";
    }
    for (const char* command : {"systemctl", "adduser", "deluser", "udevadm"}) {
      const fs::path file = files_.path() / "bin" / command;
      std::ofstream(file) << "#!/bin/sh\necho $(basename $0) $*\n";
      fs::permissions(file, fs::perms::owner_all);
    }
  }
  [[nodiscard]] CommandResult run(const std::string& script_and_arguments) const {
    return run_command("DPKG_ROOT='" + (files_.path() / "root").string() + "' PATH='" +
                       (files_.path() / "bin").string() + "':$PATH sh " + test::source_dir() +
                       "/deploy/debian/" + script_and_arguments);
  }
  test::TempFolder files_;
};

TEST_F(MaintainerScripts, OnlyARemovalStopsTheSessions) {
  const CommandResult upgrade = run("prerm upgrade 2.0");
  EXPECT_EQ(upgrade.status, 0);
  EXPECT_EQ(upgrade.output, "");

  EXPECT_EQ(run("prerm remove").output, "systemctl stop palpate@*.target palpate-*@*.service ");
}

TEST_F(MaintainerScripts, AnUpgradeSaysThatSessionsKeepTheOldVersion) {
  const CommandResult upgrade = run("postinst configure 1.0");
  EXPECT_EQ(upgrade.status, 0);
  EXPECT_NE(upgrade.output.find("running sessions keep version 1.0"), std::string::npos);

  EXPECT_EQ(run("postinst configure").output.find("running sessions"), std::string::npos);
}

TEST_F(MaintainerScripts, APurgeLeavesNothing) {
  EXPECT_EQ(run("postrm remove").status, 0);
  EXPECT_TRUE(fs::exists(files_.path() / "root/var/lib/palpate/run.mcap"));

  EXPECT_EQ(run("postrm purge").status, 0);

  std::vector<std::string> left;
  for (const auto& entry : fs::recursive_directory_iterator(files_.path() / "root")) {
    if (entry.path().filename().string().starts_with("palpate")) left.push_back(entry.path());
  }
  EXPECT_EQ(left, std::vector<std::string>{});
  EXPECT_TRUE(fs::exists(files_.path() / "root/etc/systemd/system/other.service"));
}

TEST(Prometheus, NoticesThatNobodyAnswers) {
  const std::string rules =
      test::text_of(test::source_dir() + "/deploy/prometheus/palpate_rules.yml");
  EXPECT_NE(rules.find("expr: up{job=\"palpate\"} == 0"), std::string::npos);
}

TEST(Prometheus, AcceptsTheRulesAndTheConfiguration) {
  if (run_command("promtool --version").status != 0) {
    GTEST_SKIP() << "no promtool here (Debian: prometheus)";
  }
  const std::string folder = test::source_dir() + "/deploy/prometheus";
  EXPECT_EQ(run_command("promtool check rules " + folder + "/palpate_rules.yml").status, 0);
  EXPECT_EQ(run_command("promtool check config " + folder + "/prometheus.yml").status, 0);
}

}  // namespace
}  // namespace palpate
