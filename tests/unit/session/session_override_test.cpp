// SPDX-License-Identifier: Apache-2.0
// Overrides of the command line: --set path=value.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"
#include "tests/unit/session/session_support.h"

namespace palpate {
namespace {

using namespace std::chrono_literals;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr const char* kOverridden =
    "name: \"x\"\n"
    "hand { v { height_m: 0.1 } }\n"
    "scene { tissue { sphere { radius_m: 1 } kelvin_voigt { stiffness_newton_per_m: 5 } } }\n"
    "faults { interaction { outage { until_s: 1 } } }\n";

Session overridden(const std::vector<std::string>& overrides) {
  return parse_session(kOverridden, "x.txtpb", overrides);
}

TEST(SessionOverride, SetsAFieldByItsPath) {
  EXPECT_EQ(overridden({"mofc.controller=none"}).side().mofc.controller, ControllerKind::kNone);
  EXPECT_EQ(overridden({"faults.interaction.delay_ms=50"}).faults.interaction.delay, 50ms);
  const Session session = overridden({"scene.tissue[0].kelvin_voigt.stiffness_newton_per_m=600",
                                      "scene.tissue[0].kelvin_voigt.adhesive=true"});
  const auto& material = std::get<KelvinVoigtMaterial>(session.scene.tissues[0].material);
  EXPECT_EQ(material.stiffness_newton_per_m, 600.0);
  EXPECT_TRUE(material.is_adhesive);
}

TEST(SessionOverride, TextNeedsNoQuotes) {
  EXPECT_EQ(overridden({"name=foo"}).name, "foo");
  EXPECT_EQ(overridden({"name=\"foo\""}).name, "foo");
  EXPECT_EQ(overridden({"name='foo'"}).name, "foo");
  EXPECT_EQ(overridden({"scene.tissue[0].name=a=b"}).scene.tissues[0].name, "a=b");
}

TEST(SessionOverride, ReplacesAListHoweverItIsWritten) {
  for (const char* list :
       {R"(["python3", "a b.py", "{session}"])", R"([python3, a b.py, {session}])",
        R"(['python3','a b.py',{session}])", R"([ "python3" , a b.py , '{session}' ])"}) {
    EXPECT_THAT(overridden({"physics.command=[old]", std::string("physics.command=") + list})
                    .physics_command,
                ElementsAre("python3", "a b.py", "{session}"))
        << list;
  }
  EXPECT_THAT(overridden({"physics.command=mine"}).physics_command, ElementsAre("mine"));
  EXPECT_THAT(overridden({R"(physics.command=["a, b", "c\"d"])"}).physics_command,
              ElementsAre("a, b", "c\"d"));
  EXPECT_THAT(overridden({"physics.command=[old]", "physics.command=[]"}).physics_command,
              ::testing::IsEmpty());
}

TEST(SessionOverride, KeepsTheRestOfTheMessage) {
  const auto v = std::get<VPath>(overridden({"hand.v.free_motion_s=14"}).side().hand.path);

  EXPECT_EQ(v.free_motion_s, 14.0);
  EXPECT_EQ(v.height_m, 0.1);
}

TEST(SessionOverride, LastOneWins) { EXPECT_EQ(overridden({"seed=2", "seed=3"}).seed, 3u); }

TEST(SessionOverride, OtherMemberOfAOneofReplacesTheFirst) {
  EXPECT_EQ(
      std::get<HoldPath>(overridden({"hand.hold.position_m.z=-0.01"}).side().hand.path).position_m,
      Vector3(0, 0, -0.01));
  EXPECT_EQ(std::get<HoldPath>(overridden({"hand.hold={}"}).side().hand.path).position_m,
            Vector3(0, 0, 0));
}

TEST(SessionOverride, WholeMessageIsReplaced) {
  const auto v = std::get<VPath>(overridden({"hand.v={ half_width_m: 0.5 }"}).side().hand.path);

  EXPECT_EQ(v.half_width_m, 0.5);
  EXPECT_EQ(v.height_m, 0.05);  // the default again
}

TEST(SessionOverride, ListGrowsAndItsElementsAreReplaced) {
  const Session longer = overridden({"faults.interaction.outage={from_s: 1 until_s: 2}"});
  ASSERT_THAT(longer.faults.interaction.windows, SizeIs(2));
  EXPECT_EQ(longer.faults.interaction.windows[1].from, 1s);

  const Session changed = overridden({"faults.interaction.outage[0]={from_s: 3 until_s: 4}"});
  ASSERT_THAT(changed.faults.interaction.windows, SizeIs(1));
  EXPECT_EQ(changed.faults.interaction.windows[0].from, 3s);
}

TEST(SessionOverride, ProblemIsLocatedAtTheOverride) {
  EXPECT_THAT(
      complaints(kOverridden, {"seed=4", "device.rate_hz=-1"}),
      ElementsAre("x.txtpb: 1 problem",
                  "--set device.rate_hz=-1: device.rate_hz = -1: must be 10 … 10000; give the "
                  "ticks per second of the haptic loop"));
  EXPECT_THAT(complaints(kOverridden, {"hand.press={ from_s: 2 until_s: 1 }"}).at(1),
              StartsWith("--set hand.press={ from_s: 2 until_s: 1 }: hand.press[0].until_s = 1"));
  EXPECT_THAT(complaints(kOverridden, {"hand.recorded.loop=true"}).at(1),
              StartsWith("--set hand.recorded.loop=true: hand.recorded.file: required"));
}

TEST(SessionOverride, CanCorrectAProblemOfTheFile) {
  EXPECT_THAT(complaints("name: \"x\" device { rate_hz: -1 }", {"device.rate_hz=50"}), SizeIs(0));
  EXPECT_THAT(complaints("name: \"x\" hand { v { height_m: nan } }", {"hand.hold={}"}), SizeIs(0));
}

TEST(SessionOverride, ProblemsFollowThoseOfTheFileInOrder) {
  const std::vector<std::string> lines =
      complaints("name: \"x\"\nduration_s: 0", {"seeed=1", "hand.mass_kg=-1", "seed=1"});

  ASSERT_THAT(lines, SizeIs(4));
  EXPECT_THAT(lines[1], StartsWith("x.txtpb:2:1: duration_s"));
  EXPECT_THAT(lines[2], StartsWith("--set seeed=1: seeed: no such field; did you mean 'seed'?"));
  EXPECT_THAT(lines[3], StartsWith("--set hand.mass_kg=-1: hand.mass_kg = -1: must be ≥ 0"));
}

struct BadOverride {
  const char* assignment;
  const char* words;
};

TEST(SessionOverride, ReportsWhyItCannotBeApplied) {
  const BadOverride rows[] = {
      {"", "must be path=value"},
      {"device.rate_hz", "must be path=value"},
      {"=1", "must be path=value"},
      {"device.=1", "device.: no such field"},
      {"device..rate_hz=1", "no such field"},
      {".device.rate_hz=1", "no such field"},
      {"mode=guard", "mode: no such field; did you mean 'mofc.mode'?"},
      {"rate_hz=500", "did you mean 'device.rate_hz' or 'physics.rate_hz'?"},
      {"device.rate=1", "device.rate: no such field; did you mean 'device.rate_hz'?"},
      {"viewer.port=0", "viewer.port: no such field; did you mean 'viewer.web.port'?"},
      {"device.rate_hz=fast", "device.rate_hz: cannot be read: Expected double, got: fast"},
      {"device.rate_hz=", "device.rate_hz: cannot be read: Expected double, got: nothing;"},
      {"device.rate_hz=1 2", "something follows the value"},
      {"device.rate_hz.x=1", "device.rate_hz: is a single value"},
      {"device[0].rate_hz=1", "device[0]: there is only one"},
      {"device=3", "device: cannot be read"},
      {"mofc.mode=fast", "mode = fast: must be paper, vector or guard"},
      {"mofc.mode=7", "mode = 7: must be paper, vector or guard"},
      {"mofc.controller=99",
       "controller = 99: must be none, mofc, virtual_coupling, energy_bounding, "
       "force_bounding, passivity_control, memory_based, input_to_state, two_port, energy_tank, "
       "lyapunov or wave_variables"},
      {"seed=-1", "seed: cannot be read: a whole number without a sign is required"},
      {"scene.tissue[1].name=a",
       "scene.tissue[1]: there are only 1, counted from [0]; "
       "scene.tissue={ … } adds one"},
      {"physics.command[0]=a", "physics.command[0]: there are only 0"},
      {"physics.command=[\"a]", "physics.command: cannot be read"},
      {"scene.tissue[-1].name=a", "an index is written [0]"},
      {"scene.tissue[x].name=a", "an index is written [0]"},
      {"scene.tissue[0.name=a", "an index is written [0]"},
      {"scene.tissue[0]x.name=a", "an index is written [0]"},
      {"scene.tissue[99999999999].name=a", "an index is written [0]"},
      {"scene.tissue.name=a", "scene.tissue: say which one: scene.tissue[0]"},
      {"hand.hold={ positin_m {} }",
       "hand.hold: no field 'positin_m' in Hold; did you mean "
       "'position_m'?"},
      {"hand.hold={ position_m { x: 0 yy: 1 } }", "no field 'yy' in Vector3d; did you mean 'y'"},
      {"hand.hold={", "hand.hold: cannot be read"},
      {"mofc={ mode: fast }", "mode = fast: must be paper, vector or guard"},
      {"scene={ tissue [ {}, { spere {} } ] }",
       "no field 'spere' in Tissue; did you mean 'sphere'"},
      {"realtime.wait=7", "wait = 7: must be hybrid, spin or block"},
      {"device.rate_hz=1kHz", "device.rate_hz: cannot be read: 1 kHz: units are not written"},
      {"device.rate_hz=1e3 Hz", "1e3 Hz: units are not written; give the number alone"},
      {"device={ rate_hz: 1kHz }", "device: cannot be read: 1 kHz: units are not written"},
      {"device.rate_hz=\"1000\"", "\"1000\": numbers and names have no quotes; write 1000"},
      {"mofc.mode='guard'", "'guard': numbers and names have no quotes; write guard"},
      {"mofc={\"mode\": guard}", "\"mode\": names of fields have no quotes, unlike in JSON"},
      {"name=\"x", "\"x: the text does not end; end it with \""},
      {"name=“x”", "name: cannot be read: “ is no quotation mark here; write \" or ' instead"},
      {"physics.command=[‘x’]", "‘ is no quotation mark here"},
      {"mofc={ mode: guard // fast }", "// begins no comment here; comments begin with #"},
      {"mofc.controller=MOFC", "; did you mean 'mofc'?"},
      {"Device.Rate_Hz=1", "Device: no such field; did you mean 'device'?"},
  };
  for (const BadOverride& row : rows) {
    SCOPED_TRACE(row.assignment);
    const std::vector<std::string> lines = complaints(kOverridden, {row.assignment});

    ASSERT_THAT(lines, SizeIs(2));
    EXPECT_THAT(lines[1], AllOf(StartsWith(std::string("--set ") + row.assignment + ": "),
                                HasSubstr(row.words)));
  }
}

TEST(SessionOverride, EndlessBracesAreRefused) {
  std::string assignment = "scene={ ";
  for (int i = 0; i < 200'000; ++i) assignment += "a {";

  EXPECT_THAT(complaints(kOverridden, {assignment}).at(1),
              HasSubstr("braces nested more than 32 deep"));
}

TEST(FilesOf, AnyOverridesAreThoseOfTheSessionAndOfEachOverrideWhateverTheOthersDo) {
  const test::TempFolder folder;
  const auto path = [&](const char* name) { return (folder.path() / name).string(); };
  const std::string file = folder.write("session.txtpb", R"(
      name: "files"
      scene { tissue { tetrahedral_mesh { file: "organ.msh" } } })");

  EXPECT_THAT(
      files_of_any(file, {"scene={ tissue { half_space {} } }",
                          "scene.tissue[3].tetrahedral_mesh.file=a.msh",
                          "side[1].hand.recorded={ file: 'b.csv' }",
                          "scene.tissue={ tetrahedral_mesh { file: \"c.msh\" } }",
                          "security.key_folder=\"keys\"", "mofc.controller=none", "seed=file",
                          "no.such=file", "scene={ tissue { file: \"d.msh\" "}),
      ::testing::UnorderedElementsAre(file, path("organ.msh"), path("a.msh"), path("b.csv"),
                                      path("c.msh"), path("keys")));
}

}  // namespace
}  // namespace palpate
