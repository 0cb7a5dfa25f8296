// SPDX-License-Identifier: Apache-2.0
// The profile file of a device.
#include "common/session/file/profile_file.h"
#include "tests/support/temp_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>

#include "tests/support/machine/places.h"
#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr const char* kWithProfile = "name: \"x\"\ndevice { profile_file: \"omni.txtpb\" }";
constexpr const char* kProfile =
    "device { profile { viscous_newton_s_per_m: 0.04 coulomb_newton: 0.2 "
    "position_resolution_m: 2e-5 } }";

/// A folder for omni.txtpb, gone after the test.
class ProfileFile : public ::testing::Test {
 protected:
  void write(const std::string& text) const { temporary_.write("omni.txtpb", text); }

  [[nodiscard]] DeviceProfile load(const std::vector<std::string>& overrides = {}) const {
    return parse_session(kWithProfile, "x.txtpb", overrides, folder_).side().device.profile;
  }

  /// Of the session with this profile, the folder's name left out.
  [[nodiscard]] std::vector<std::string> problems(const std::string& profile) const {
    write(profile);
    std::vector<std::string> lines = complaints(kWithProfile, {}, folder_);
    const std::string prefix = folder_.string() + "/";
    for (std::string& line : lines) {
      if (line.starts_with(prefix)) line.erase(0, prefix.size());
    }
    return lines;
  }

  const test::TempFolder temporary_;
  const std::filesystem::path& folder_ = temporary_.path();
};

TEST_F(ProfileFile, IsWhatTheControllerReliesOn) {
  write(kProfile);

  const DeviceProfile profile = load();

  EXPECT_EQ(profile.viscous_newton_s_per_m, 0.04);
  EXPECT_EQ(profile.coulomb_newton, 0.2);
  EXPECT_EQ(profile.position_resolution_m, 2e-5);
}

TEST_F(ProfileFile, FieldsOfTheSessionWin) {
  write(kProfile);

  const DeviceProfile profile = load({"device.profile.coulomb_newton=0.15"});

  EXPECT_EQ(profile.viscous_newton_s_per_m, 0.04);
  EXPECT_EQ(profile.coulomb_newton, 0.15);
}

TEST_F(ProfileFile, OverrideNamesAnotherOrNone) {
  write(kProfile);
  temporary_.write("other.txtpb",
                   "device { profile { viscous_newton_s_per_m: 0 coulomb_newton: 0.3 "
                   "position_resolution_m: 0 } }");

  EXPECT_EQ(load({"device.profile_file=other.txtpb"}).coulomb_newton, 0.3);
  EXPECT_EQ(load({"device.profile_file="}).coulomb_newton, 0.1);  // the default
}

TEST(ProfileDefaults, TheStepIsThatOfTheDriverIfItDeclaresACoarseOne) {
  const auto step_of = [](const char* session, const std::vector<std::string>& overrides) {
    return load_session(test::source_dir() + "/deploy/sessions/" + session, overrides)
        .side()
        .device.profile.position_resolution_m;
  };
  EXPECT_EQ(step_of("falcon.txtpb", {}), 110e-6);
  EXPECT_EQ(step_of("falcon.txtpb", {"device.falcon.position_resolution_m=1e-6"}), 55e-6);
  EXPECT_EQ(step_of("falcon.txtpb", {"device.profile.position_resolution_m=2e-4"}), 2e-4);
  // a fault that is simulated changes no default
  EXPECT_EQ(step_of("default.txtpb", {"device.simulated.position_resolution_m=3e-4"}), 55e-6);
}

TEST_F(ProfileFile, WhatIsWrittenIsReadWithBoundsRoundedDown) {
  write(profile_text({.viscous_newton_s_per_m = 0.0123456789,
                      .coulomb_newton = 0.2,
                      .position_resolution_m = 55e-6},
                     {"a comment", "with a\nline break"}));

  const DeviceProfile profile = load();

  EXPECT_EQ(profile.viscous_newton_s_per_m, 0.012345);
  EXPECT_NEAR(profile.coulomb_newton, 0.2, 1.1e-6);
  EXPECT_LE(profile.coulomb_newton, 0.2);
  EXPECT_EQ(profile.position_resolution_m, 55e-6);
}

constexpr const char* kProfilePerAxis =
    "device { profile { viscous_newton_s_per_m: 0.04 coulomb_newton: 0.1 position_resolution_m: "
    "2e-5 "
    "viscous_per_axis_newton_s_per_m { x: 0.04 z: 0.06 } "
    "coulomb_per_axis_newton { x: 0.1 y: 0.2 z: 0.3 } } }";

TEST_F(ProfileFile, FrictionPerAxisIsReadAndWrittenWithBoundsRoundedDown) {
  write(kProfilePerAxis);
  DeviceProfile profile = load();
  ASSERT_TRUE(profile.per_axis.has_value());
  EXPECT_EQ(profile.per_axis->viscous_newton_s_per_m, Vector3(0.04, 0, 0.06));
  EXPECT_EQ(profile.per_axis->coulomb_newton, Vector3(0.1, 0.2, 0.3));

  profile.per_axis->viscous_newton_s_per_m = Vector3(0.0123456789, 0.5, 0.0);
  write(profile_text(profile, {}));

  EXPECT_EQ(load().per_axis->viscous_newton_s_per_m, Vector3(0.012345, 0.5, 0.0));
}

TEST_F(ProfileFile, FrictionPerAxisOfTheSessionWinsAndLowersTheIsotropicBound) {
  write(kProfilePerAxis);

  const DeviceProfile profile =
      load({"device.profile.viscous_per_axis_newton_s_per_m={}",
            "device.profile.coulomb_per_axis_newton={ x: 0.3 y: 0.02 z: 0.3 }"});

  EXPECT_EQ(profile.per_axis->viscous_newton_s_per_m, Vector3::Zero());
  EXPECT_EQ(profile.per_axis->coulomb_newton, Vector3(0.3, 0.02, 0.3));
  EXPECT_EQ(profile.coulomb_newton, 0.02);
}

TEST_F(ProfileFile, FrictionPerAxisMustBeCompleteAndNotBelowTheIsotropicBound) {
  EXPECT_THAT(problems("device { profile { viscous_newton_s_per_m: 0 coulomb_newton: 0.2 "
                       "position_resolution_m: 0\n"
                       "coulomb_per_axis_newton { x: 0.3 y: 0.1 z: 0.3 } } }"),
              ElementsAre("x.txtpb: 2 problems",
                          HasSubstr("device.profile.viscous_per_axis_newton_s_per_m: required "
                                    "beside coulomb_per_axis_newton"),
                          HasSubstr("device.profile.coulomb_newton = 0.2: must be ≤ each of "
                                    "coulomb_per_axis_newton, here 0.1")));
}

TEST_F(ProfileFile, ProblemsAreReportedWithTheirPlaces) {
  EXPECT_THAT(problems("device {\n"
                       "  profile {\n"
                       "    coulomb_newton: -1\n"
                       "    position_resolution_m: nan\n"
                       "  }\n"
                       "}\n"),
              ElementsAre("x.txtpb: 3 problems",
                          "omni.txtpb:2:3: device.profile.viscous_newton_s_per_m: required; give a "
                          "lower bound of the viscous friction, 0 if unknown",
                          "omni.txtpb:3:5: device.profile.coulomb_newton = -1: must be ≥ 0; give a "
                          "lower bound of the dry friction, 0 if unknown",
                          "omni.txtpb:4:5: device.profile.position_resolution_m = nan: must be a "
                          "finite number"));
}

TEST_F(ProfileFile, NoFieldHasADefault) { EXPECT_THAT(problems(""), SizeIs(1 + 3)); }

TEST_F(ProfileFile, AnythingElseInItIsRefused) {
  EXPECT_THAT(
      problems("name: \"y\"\n"
               "device {\n"
               "  rate_hz: 50\n"
               "  profile_file: \"omni.txtpb\"\n"
               "  profile { viscous_newton_s_per_m: 0 coulomb_newton: 0 "
               "position_resolution_m: 0 }\n"
               "}\n"
               "scene { tissue {} }\n"),
      ElementsAre("x.txtpb: 4 problems",
                  "omni.txtpb:1:1: name: a profile contains device.profile only; move it into "
                  "the session",
                  StartsWith("omni.txtpb:3:3: device.rate_hz: a profile contains"),
                  StartsWith("omni.txtpb:4:3: device.profile_file: a profile contains"),
                  StartsWith("omni.txtpb:7:1: scene: a profile contains")));
}

TEST_F(ProfileFile, UnreadableTextIsReportedWithItsPlace) {
  EXPECT_THAT(problems("device {\n  profile {"),
              ElementsAre("x.txtpb: 1 problem", HasSubstr("omni.txtpb:2:")));
}

TEST_F(ProfileFile, MissingFileAndFolderAreRefused) {
  EXPECT_THAT(
      complaints(kWithProfile, {}, folder_).at(1),
      AllOf(StartsWith("x.txtpb:"), HasSubstr("device.profile_file: "),
            HasSubstr("omni.txtpb: no such file"), HasSubstr("relative to the session's folder")));
  EXPECT_THAT(complaints(kWithProfile, {"device.profile_file=."}, folder_).at(1),
              HasSubstr("is a folder"));
  EXPECT_THAT(complaints(kWithProfile, {"device.profile_file=/dev/zero"}, folder_).at(1),
              HasSubstr("is not a regular file"));
  EXPECT_THAT(complaints(kWithProfile, {"device.profile_file='a\\0'"}, folder_).at(1),
              HasSubstr("must not contain control characters"));
}

TEST_F(ProfileFile, HugeFileIsRefusedUnread) {
  write("");
  std::filesystem::resize_file(folder_ / "omni.txtpb", 100'001);  // sparse

  EXPECT_THAT(complaints(kWithProfile, {}, folder_).at(1), HasSubstr("more than 100000 bytes"));
}

TEST(Profile, NoFileIsReadWithoutAFolder) {
  EXPECT_THAT(complaints(kWithProfile).at(1), HasSubstr("this session has no folder"));
}

}  // namespace
}  // namespace palpate
