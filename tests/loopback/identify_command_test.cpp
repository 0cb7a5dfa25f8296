// `palpate identify` as a user runs it: exit status, figures, and a profile that a session includes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "common/core/check.h"
#include "common/runtime/session_file.h"
#include "deploy/palpate/lockstep.h"

namespace palpate {
namespace {

using ::testing::HasSubstr;

struct Outcome {
  int status = -1;
  std::string out;  ///< standard output and error
};

/// A folder with a session of a device of 0.2 N·s/m and 0.15 N, gone after the test.
class IdentifyCommand : public ::testing::Test {
 protected:
  IdentifyCommand() {
    std::string pattern = (std::filesystem::temp_directory_path() / "palpate-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    std::ofstream(session_) << R"(
      name: "identified"
      device {
        profile_file: "omni.txtpb"
        start_ramp_ms: 0
        simulated { viscous_newton_s_per_m: 0.2 coulomb_newton: 0.15 }
      }
      mofc { mode: vector }
      hand { hold { position_m { z: -0.01 } } }
      scene { tissue { half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } } })";
  }
  ~IdentifyCommand() override { std::filesystem::remove_all(folder_); }

  [[nodiscard]] Outcome identify(const std::string& arguments) const {
    const std::string command =
        std::string(PALPATE_BINARY_DIR) + "/palpate identify " + arguments + " 2>&1";
    Outcome outcome;
    FILE* pipe = ::popen(command.c_str(), "r");  // NOLINT(cert-env33-c): the program under test
    if (pipe == nullptr) return outcome;
    for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) {
      outcome.out += static_cast<char>(c);
    }
    const int ended = ::pclose(pipe);
    if (WIFEXITED(ended)) outcome.status = WEXITSTATUS(ended);
    return outcome;
  }

  std::filesystem::path folder_;
  std::filesystem::path session_ = "";
  std::filesystem::path profile_ = "";
};

}  // namespace
}  // namespace palpate
