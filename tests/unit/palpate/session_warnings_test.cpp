// SPDX-License-Identifier: Apache-2.0
// Likely mistakes of a valid session; the sessions that ship have none.
#include "deploy/palpate/session_warnings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "common/session/session_file.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

namespace fs = std::filesystem;

/// Of a session without a pointer, whose hand touches.
std::vector<std::string> warnings_with(const std::vector<std::string>& overrides) {
  return session_warnings(
      load_session(test::source_dir() + "/deploy/sessions/paper_soft.txtpb", overrides));
}

TEST(SessionWarnings, ThereAreNoneOfTheSessionsThatShip) {
  std::size_t sessions = 0;
  for (const char* folder : {"/deploy/sessions", "/deploy/sessions/tasks"}) {
    for (const auto& entry : fs::directory_iterator(test::source_dir() + folder)) {
      if (entry.path().extension() != ".txtpb") continue;
      std::vector<std::string> overrides;
      if (entry.path().stem() == "two_machines") {
        overrides = {"security.key_folder=."};  // to be made
      }
      EXPECT_THAT(session_warnings(load_session(entry.path(), overrides)), IsEmpty())
          << entry.path();
      ++sessions;
    }
  }
  EXPECT_GE(sessions, 20u);
}

TEST(SessionWarnings, NameWhatIsProbablyNotMeant) {
  struct Case {
    const char* description;
    std::vector<std::string> overrides;
    const char* words;
  };
  for (const Case& one : std::vector<Case>{
           {"a path beside the tissue",
            {"hand.hold={ position_m { z: 0.05 } }"},
            "touches no tissue"},
           {"a path beside the tissue, and a pointer that may lead the hand there",
            {"hand.pointer={}",
             "hand.sinusoid={ center_m { z: 0.5 } amplitude_m { z: 0.01 } "
             "frequency_hz { z: 0.5 } }"},
            "touches no tissue"},
           {"a path that begins in the tissue",
            {"hand.hold={ position_m { z: -0.002 } }"},
            "begins inside tissue"},
           {"a tissue far away", {"device.workspace={ offset_m { z: 0.3 } }"}, "touches no tissue"},
           {"a hand that is too fast",
            {"hand.sinusoid={ amplitude_m { z: 0.05 } frequency_hz { z: 5 } }"},
            "1.57 m/s"},
           {"a tip of 50 mm",
            {"scene.tool.tip_radius_m=0.05",
             "hand.sinusoid={ center_m { z: 0.06 } amplitude_m { z: 0.02 } "
             "frequency_hz { z: 0.5 } }"},
            "3 mm are 0.003"},
           {"a spring in N/mm",
            {"scene.tissue[0].kelvin_voigt.stiffness_newton_per_m=0.5"},
            "softer than any tissue"},
           {"a friction that the device does not have",
            {"device.profile={ coulomb_newton: 0.5 viscous_newton_s_per_m: 0.1 }"},
            "device.profile: claims"},
           {"no such keys", {"security.key_folder=no_such_folder"}, "palpate keygen"},
           {"a library that is not there",
            {"device.plugin={ library: \"./no_such.so\" }"},
            "no_such.so: no such library"},
           {"a library that the system does not have",
            {"device.plugin={ library: \"no_such.so\" }"},
            "beside the session is ./no_such.so"},
           {"spinning on a shared processor", {"realtime.wait=spin"}, "realtime.wait = spin"},
       }) {
    EXPECT_THAT(warnings_with(one.overrides), ElementsAre(HasSubstr(one.words))) << one.description;
  }
}

TEST(SessionWarnings, OfALibraryOfTheSystemAreNone) {
  EXPECT_THAT(warnings_with({"device.plugin={ library: \"libc.so.6\" }"}),
              Each(Not(HasSubstr("library"))));
}

TEST(SessionWarnings, OfATaskThatCannotBeDone) {
  const std::string part =
      "scene.tissue[0].elastic.part[0].where={ sphere { radius_m: 0.007 center_m { ";
  const auto warnings_of = [](const char* task, const std::vector<std::string>& overrides) {
    return session_warnings(
        load_session(test::source_dir() + "/deploy/sessions/tasks/" + task, overrides));
  };
  EXPECT_THAT(warnings_of("lump_search.txtpb", {part + "z: 0.012 } } }"}),
              ElementsAre(AllOf(HasSubstr("target \"lump\""), HasSubstr("12 mm outside"))));
  EXPECT_THAT(warnings_of("lump_search.txtpb", {part + "x: 0.03 z: -0.01 } } }"}),
              ElementsAre(AllOf(HasSubstr("above it, (0.03, 0, 0) m"),
                                HasSubstr("not in the area that is searched"))));
  EXPECT_THAT(warnings_of("lump_search.txtpb",
                          {"task.palpation.area={ sphere { center_m { z: 1 } radius_m: 0.01 } }"}),
              Contains(HasSubstr("contains nothing of the surface of tissue \"block\"")));
  EXPECT_THAT(warnings_of("traction.txtpb", {"task.traction.target_m={ z: 3 }"}),
              ElementsAre(AllOf(HasSubstr("target_m"), HasSubstr("no tissue comes as far"))));
}

TEST(SessionWarnings, OfAnElasticBodyInKilopascal) {
  const Session session = load_session(test::source_dir() + "/deploy/sessions/liver_elastic.txtpb",
                                       {"scene.tissue[0].elastic.young_pa=15"});
  EXPECT_THAT(session_warnings(session),
              ElementsAre(AllOf(HasSubstr("young_pa = 15 Pa"), HasSubstr("15 kPa is 15000"))));
}

TEST(SessionWarnings, OfSeveralSidesAreGivenOnce) {
  const test::TempFolder folder;
  const auto warnings_of = [&](const std::string& left, const std::string& right) {
    return session_warnings(load_session(folder.write(
        "s.txtpb",
        "name: \"x\" side { name: \"left\" " + left + " } side { name: \"right\" " + right +
            " } scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 500 } } }")));
  };
  const std::string inside = "hand { hold { position_m { z: -0.002 } } }";
  EXPECT_THAT(warnings_of(inside, inside), ElementsAre(StartsWith("hand: its path begins inside")));
  EXPECT_THAT(warnings_of(inside, "hand { hold { position_m { z: 0 } } }"),
              Contains(StartsWith("left: hand: its path begins inside")));
}

TEST(SessionWarnings, OfAStiffnessThatNoDeviceRenders) {
  EXPECT_THAT(warnings_with({"scene.tissue[0].kelvin_voigt.stiffness_newton_per_m=1e6"}),
              ElementsAre(AllOf(HasSubstr("stiffness_newton_per_m = 1e+06 N/m"),
                                HasSubstr("beyond what any device renders"), HasSubstr("2 b/T"))));
  const Session elastic = load_session(test::source_dir() + "/deploy/sessions/liver_elastic.txtpb",
                                       {"scene.tissue[0].elastic.young_pa=1e8"});
  EXPECT_THAT(session_warnings(elastic),
              ElementsAre(AllOf(HasSubstr("elastic.young_pa = 1e+08 Pa"), HasSubstr("2 b/T"))));
}

TEST(SessionWarnings, OfASceneWithoutTissue) {
  const test::TempFolder folder;
  EXPECT_THAT(session_warnings(load_session(folder.write("s.txtpb", "name: \"x\" scene {}"))),
              ElementsAre(HasSubstr("nothing to touch")));
}

TEST(SessionWarnings, OfAProgramThatIsNotThere) {
  const test::TempFolder folder;
  const std::string file =
      folder.write("s.txtpb",
                   "name: \"x\" physics { command: [\"no_such_program\"] } scene { tissue { "
                   "half_space { } kelvin_voigt { stiffness_newton_per_m: 500 } } }");
  EXPECT_THAT(session_warnings(load_session(file)),
              ElementsAre(HasSubstr("no program of that name")));
}

TEST(SessionWarnings, OfARecordedPathThatJumps) {
  const test::TempFolder folder;
  folder.write("path.csv", "t,x,y,z\n0,0,0,0\n1,0,0,-0.01\n1.01,0,0,0.03\n2,0,0,0\n");
  const std::string file =
      folder.write("s.txtpb",
                   "name: \"x\" hand { recorded { file: \"path.csv\" } } scene { tissue "
                   "{ half_space { } kelvin_voigt { stiffness_newton_per_m: 500 } } }");
  EXPECT_THAT(session_warnings(load_session(file)),
              ElementsAre(AllOf(HasSubstr("4 m/s"), HasSubstr("at 1 s"))));
}

}  // namespace
}  // namespace palpate
