// SPDX-License-Identifier: Apache-2.0
// `palpate identify` as a user runs it: exit status, figures, and a profile that a session
// includes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "common/session/session_file.h"
#include "deploy/lockstep/lockstep.h"
#include "deploy/palpate/identify.h"
#include "device_node/drivers/driver_registry.h"
#include "tests/support/machine/places.h"
#include "tests/support/temp_folder.h"

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
    std::ofstream(session()) << R"(
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

  [[nodiscard]] Outcome identify(const std::string& arguments) const {
    const std::string command = test::binary_dir() + "/palpate identify " + arguments + " 2>&1";
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

  [[nodiscard]] std::string session() const { return (folder_.path() / "session.txtpb").string(); }
  [[nodiscard]] std::string profile() const { return (folder_.path() / "omni.txtpb").string(); }

  test::TempFolder folder_;
};

TEST_F(IdentifyCommand, ProfileItWritesIsWhatTheClampCountsOn) {
  const Outcome outcome = identify(session() + " --output " + profile());

  // the session names the profile that is only now written
  ASSERT_EQ(outcome.status, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("overall: f_d ≥ 0.1"));
  EXPECT_THAT(outcome.out, HasSubstr("palpate: " + profile() + ": written"));
  const Session identified = load_session(session());
  const DeviceProfile& found = identified.side().device.profile;
  EXPECT_LE(found.viscous_newton_s_per_m, 0.2);
  EXPECT_GE(found.viscous_newton_s_per_m, 0.8 * 0.2);
  EXPECT_LE(found.coulomb_newton, 0.15);
  EXPECT_GE(found.coulomb_newton, 0.9 * 0.15);
  EXPECT_EQ(found.position_resolution_m, 55e-6);

  // mode vector begins with an empty ledger: then f_max = f_co
  double least_f_max_newton = 1.0;
  Lockstep lockstep(identified, {}, [&](const TickRow& row, const IdealState&) {
    if (!row.mofc) return;
    least_f_max_newton = std::fmin(least_f_max_newton, row.mofc->f_max_newton.x());
  });
  lockstep.run_until(std::chrono::milliseconds(100));
  EXPECT_EQ(least_f_max_newton, found.coulomb_newton);
}

// f_co along each axis would be claimed √3 times too high across them.
TEST_F(IdentifyCommand, PerAxisOfADeviceWithIsotropicFrictionIsLessThanThatOfAnAxis) {
  const Outcome outcome = identify(session() + " --per-axis --output " + profile());

  ASSERT_EQ(outcome.status, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("per axis: f_d ≥ 0.1"));
  const DeviceProfile found = load_session(session()).side().device.profile;
  ASSERT_TRUE(found.per_axis);
  EXPECT_LE(found.per_axis->coulomb_newton.norm(), 0.15);
  EXPECT_GE(found.per_axis->coulomb_newton.norm(), 0.8 * 0.15);
  EXPECT_LE(found.per_axis->viscous_newton_s_per_m.maxCoeff(), 0.2);
  EXPECT_EQ(found.coulomb_newton, found.per_axis->coulomb_newton.minCoeff());
}

TEST_F(IdentifyCommand, DeviceThatCannotBeMeasuredIsAFailure) {
  const Outcome outcome =
      identify(session() + " --set device.simulated.coulomb_newton=2 --output " + profile());

  EXPECT_EQ(outcome.status, 1);
  EXPECT_THAT(outcome.out, HasSubstr("does not move at 1.00 N"));
  EXPECT_FALSE(std::filesystem::exists(profile()));
}

TEST_F(IdentifyCommand, MistakesOfTheUserAreSetupErrors) {
  for (const std::string& arguments :
       {session() + "x", session() + " --set device.rate_hz=1", std::string(),
        session() + " --output " + session(), session() + " --output " + profile() + "/x"}) {
    SCOPED_TRACE(arguments);
    EXPECT_EQ(identify(arguments).status, 2);
  }
  EXPECT_NO_THROW(static_cast<void>(load_session(session(), {"device.profile_file="})));
}

// --- clocks -------------------------------------------------------------------------------------

/// Stands for the steady clock: time passes while somebody waits.
class WaitedClock final : public Clock {
 public:
  [[nodiscard]] TimePoint now() const noexcept override { return time_.now(); }
  void sleep_until(TimePoint deadline) override {
    ++waits;
    time_.sleep_until(deadline);
  }
  int waits = 0;

 private:
  ManualClock time_;
};

/// A simulation that claims to be hardware, and that somebody moves for the first 100 readings.
class SeeminglyReal final : public device::HapticDevice {
 public:
  /// @param first_force_at  receives the time of the first force
  SeeminglyReal(std::unique_ptr<device::HapticDevice> inner,
                std::optional<TimePoint>& first_force_at)
      : inner_(std::move(inner)),
        specification_(inner_->specification()),
        first_force_at_(first_force_at) {
    specification_.is_simulated = false;
  }
  [[nodiscard]] const device::DeviceSpecification& specification() const noexcept override {
    return specification_;
  }
  [[nodiscard]] bool read(device::DeviceSample& sample) noexcept override {
    const bool is_read = inner_->read(sample);
    if (++reads_ <= 100) sample.hand_position_m.x() += 1e-3 * (reads_ % 5);
    return is_read;
  }
  [[nodiscard]] bool apply(const Vector3& force_newton, Duration lease,
                           device::DeviceSample& at_switch) noexcept override {
    const bool is_applied = inner_->apply(force_newton, lease, at_switch);
    if (!first_force_at_) first_force_at_ = at_switch.sampled_at;
    return is_applied;
  }
  [[nodiscard]] bool release() noexcept override { return inner_->release(); }

 private:
  std::unique_ptr<device::HapticDevice> inner_;
  device::DeviceSpecification specification_;
  std::optional<TimePoint>& first_force_at_;
  int reads_ = 0;
};

/// The simulated driver without a hand.
device::Driver handless_driver() {
  HandConfig hand;
  hand.mass_kg = 0.0;
  hand.stiffness_newton_per_m = 0.0;
  hand.damping_newton_s_per_m = 0.0;
  return device::all_drivers({.simulated = {.hand = hand, .seed = 1}}).at(device::kSimulatedDriver);
}

TEST(Identify, SweepsOfHardwareWaitForTheHandToLetGoAndForTheSteadyClock) {
  WaitedClock steady;
  std::optional<TimePoint> first_force_at;
  const Clock* opened_on = nullptr;
  const device::Driver hardware{.open =
                                    [&](const Clock& clock, const device::StartUp&) {
                                      opened_on = &clock;
                                      return std::make_unique<SeeminglyReal>(
                                          handless_driver().open(clock, {}), first_force_at);
                                    },
                                .is_simulated = false};
  Session session;
  session.sides.front().realtime = {.priority = 0, .cpu = -1};

  // nothing moves before the prompt was acknowledged, however often that has to be asked for
  int asked = 0;
  const auto acknowledged = [&] {
    EXPECT_FALSE(first_force_at);
    return ++asked > 20;
  };
  run_identify(session, {.consent = {.may_move = true}, .is_acknowledged = acknowledged}, hardware,
               steady);

  EXPECT_EQ(asked, 21);
  EXPECT_EQ(opened_on, &steady);
  // moved for 100 readings, one each 5 ms; then at rest for 2 s
  ASSERT_TRUE(first_force_at);
  EXPECT_GE(seconds_of(*first_force_at), 2.49);
  // ticks of 1 ms; 16 lines, swept 18 times each: 35 mm at 50 mm/s or less take more than 0.7 s
  EXPECT_GT(steady.waits, 200'000);
  EXPECT_GT(seconds_of(steady.now()), 200.0);
}

TEST(Identify, SweepsOfASimulationDoNotWait) {
  WaitedClock steady;

  run_identify(Session{}, {}, handless_driver(), steady);

  EXPECT_EQ(steady.waits, 0);
}

}  // namespace
}  // namespace palpate
