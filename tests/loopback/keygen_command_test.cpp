// SPDX-License-Identifier: Apache-2.0
// `palpate keygen` and `palpate doctor` from the command line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "tests/support/port.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

using test::Outcome;
using test::run_program;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

class KeygenCommand : public testing::Test {
 protected:
  [[nodiscard]] std::string keys() const { return (files_.path() / "keys").string(); }
  [[nodiscard]] Outcome doctor(const std::string& more) const {
    const std::string session =
        files_.write("s.txtpb", "name: \"doctor\" device { rate_hz: 100 }\n" + more);
    return run_program("palpate", {"doctor", session});
  }

  test::RunFolder run_folder_;
  test::TempFolder files_;
};

TEST_F(KeygenCommand, PrintsWhatItWroteAndNeverOverwrites) {
  const Outcome first = run_program("palpate", {"keygen", keys()});
  EXPECT_EQ(first.status, 0) << first.err;
  EXPECT_THAT(first.out, AllOf(HasSubstr("keys/allowed.keys\n"),
                               HasSubstr("keys/physics.key_secret\n"), HasSubstr("key_folder")));

  const Outcome second = run_program("palpate", {"keygen", keys()});
  EXPECT_EQ(second.status, 2);
  EXPECT_THAT(second.err, HasSubstr("exists already"));
}

TEST_F(KeygenCommand, ANodeRefusesASecretThatOthersMayRead) {
  ASSERT_EQ(run_program("palpate", {"keygen", keys()}).status, 0);
  chmod((keys() + "/physics.key_secret").c_str(), 0644);
  const std::string session =
      files_.write("s.txtpb", "name: \"doctor\" security { key_folder: \"keys\" }");

  const Outcome node = run_program("physics_node", {"--session", session, "--seconds", "10"});
  EXPECT_EQ(node.status, 2);
  EXPECT_THAT(node.err, AllOf(HasSubstr("others may read this secret"), HasSubstr("chmod 600")));
}

TEST_F(KeygenCommand, KeysAndInsecureTogetherAreRefused) {
  const std::string session =
      files_.write("s.txtpb", "name: \"doctor\" security { key_folder: \"keys\" }");

  const Outcome node = run_program("physics_node", {"--session", session, "--insecure"});
  EXPECT_EQ(node.status, 2);
  EXPECT_THAT(node.err, HasSubstr("--insecure: the session has keys"));
}

// --- doctor ---------------------------------------------------------------------------------

TEST_F(KeygenCommand, DoctorChecksTheMachine) {
  const Outcome outcome = run_program("palpate", {"doctor"});
  for (const char* what : {"real-time", "memory", "timer", "clock"}) {
    EXPECT_THAT(outcome.out, ContainsRegex(std::string("(ok   |TO DO)  ") + what + " "));
  }
  EXPECT_THAT(outcome.out, Not(HasSubstr("links.")));
  EXPECT_EQ(outcome.status, outcome.out.find("TO DO") == std::string::npos ? 0 : 1);
}

// 500 wake-ups would take 25 s.
TEST_F(KeygenCommand, DoctorMeasuresTheTimerForASecondAtMost) {
  const std::string slow = files_.write("slow.txtpb", "name: \"doctor\" device { rate_hz: 20 }");
  EXPECT_THAT(run_program("palpate", {"doctor", slow}).out, HasSubstr("20 wake-ups at 20 Hz"));
}

TEST_F(KeygenCommand, DoctorReportsAPortInUseWithTheRemedy) {
  const test::HeldPort taken;
  const Outcome outcome = doctor("links { tool_motion: \"" + taken.endpoint() + "\" }");
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.out, ContainsRegex("TO DO  links.tool_motion .*in use by another process"));
  EXPECT_THAT(outcome.out, ContainsRegex("ok     links.interaction .* is free"));
  EXPECT_THAT(outcome.out, HasSubstr("none needed"));
}

TEST_F(KeygenCommand, DoctorExaminesTheAssumptionsOfTheGuarantee) {
  const std::string fit = doctor("").out;
  for (const char* what : {"monitor", "encoder", "friction", "hand speed"}) {
    EXPECT_THAT(fit, ContainsRegex(std::string("ok     ") + what + " "));
  }
  const std::string wrong = files_.write("wrong.txtpb", R"(
name: "doctor"
device {
  monitor: off
  profile { coulomb_newton: 0.5 position_resolution_m: 10e-6 }
}
hand { hostile { v_max_m_per_s: 1 } }
)");
  const Outcome outcome = run_program("palpate", {"doctor", wrong});
  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.out,
              AllOf(ContainsRegex("TO DO  monitor .*off"), ContainsRegex("TO DO  encoder .*55 µm"),
                    ContainsRegex("TO DO  friction .*palpate identify"),
                    ContainsRegex("TO DO  hand speed .*1 m/s")));
}

TEST_F(KeygenCommand, DoctorReportsTheRolesOfThisMachine) {
  const std::string far = "links { tool_motion: \"tcp://192.0.2.1:5551\" }\n";
  EXPECT_THAT(doctor(far).out,
              AllOf(ContainsRegex("ok     links.tool_motion .*belongs to another machine"),
                    ContainsRegex("TO DO  keys .*without keys: palpate keygen")));

  ASSERT_EQ(run_program("palpate", {"keygen", keys()}).status, 0);
  std::filesystem::remove(keys() + "/physics.key_secret");
  const std::string with_keys = far + "security { key_folder: \"keys\" }";
  EXPECT_THAT(
      doctor(with_keys).out,
      HasSubstr("this machine has the roles device, viewer, pointer, standby, relay, audience"));

  chmod((keys() + "/device.key_secret").c_str(), 0640);
  EXPECT_THAT(doctor(with_keys).out, ContainsRegex("TO DO  keys .*others may read"));
}

}  // namespace
}  // namespace palpate
