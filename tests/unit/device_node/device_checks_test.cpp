// SPDX-License-Identifier: Apache-2.0
// What every driver must do: the simulated device does it, and each fault of a wrong one is named.
#include "device_node/conformance/device_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "device_node/simulation/simulated_device.h"
#include "tests/property/seeds.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/device_conformance.h"

namespace palpate::device {
namespace {

using namespace std::chrono_literals;

/// What a device under test is made of, on a clock that stands.
struct Parts {
  explicit Parts(const HandConfig& hand, const SimulatedDeviceConfig& config = {})
      : simulated(config, hand, time, 1) {}
  ManualClock time;
  SimulatedDevice simulated;
};

class SimulatedUnderTest : private Parts, public OpenedDevice {
 public:
  SimulatedUnderTest() : Parts(HandConfig{}), OpenedDevice(simulated, time, 1ms, {}) {}
  [[nodiscard]] std::optional<std::uint64_t> allocations() const override {
    // `operator new` is counted under sanitizers too
    return test::allocations_of_this_thread() + test::mallocs_of_this_thread();
  }
};
std::unique_ptr<DeviceBench> open_simulated() { return std::make_unique<SimulatedUnderTest>(); }

/// A simulated device with one fault.
class WrongDevice final : public HapticDevice, public MotorForceSource {
 public:
  WrongDevice(HapticDevice& device, MotorForceSource& motors, std::string fault)
      : device_(device),
        motors_(motors),
        specification_(device.specification()),
        fault_(std::move(fault)) {
    specification_.button_count = 2;
    if (is("no name")) specification_.model_name.clear();
    if (is("peak in millinewtons")) specification_.peak_force_newton = 3.3e-3;
    if (is("a reading that names no force") || names_its_force()) {
      specification_.has_motor_watchdog = false;
    }
    if (is("held currents that vanish")) specification_.held_force_ratio = 0.5;
    if (is("a latch that is not there")) specification_.has_position_latch = true;
  }

  [[nodiscard]] const DeviceSpecification& specification() const noexcept override {
    return specification_;
  }
  [[nodiscard]] bool read(DeviceSample& sample) noexcept override {
    if (is("slow transfers")) std::this_thread::sleep_for(2ms);
    end_in_software();
    return device_.read(sample) && name_force(sample) && falsify(sample);
  }
  [[nodiscard]] bool apply(const Vector3& force, Duration lease,
                           DeviceSample& at_switch) noexcept override {
    if (is("calls malloc")) kept_.reset(std::malloc(16));
    if (is("allocates")) history_ = std::string(100 + force_.size(), 'x');
    Vector3 sent = force;
    if (is("millinewtons")) sent *= 1e3;
    if (is("no limit at the peak")) over_ = std::max(1.0, force.norm() / 3.3);
    if (is("wrong axis")) std::swap(sent.x(), sent.y());
    if (is("wrong sign")) sent.x() = -sent.x();
    if (is("twice as strong")) sent *= 2.0;
    const Duration named = lease;
    end_in_software();
    if (is("no watchdog") || is("lease in software") || names_its_force())
      lease = lease > Duration::zero() ? 10s : lease;
    // an unsigned count of ticks, and a watchdog that 0 switches off
    if (is("lease below zero") && lease < Duration::zero()) lease = 10s;
    if (is("lease of zero") && lease == Duration::zero()) lease = 10s;
    if (is("ends at its lease only") && lease <= Duration::zero()) {
      const bool is_read = device_.read(at_switch);  // confirms, and goes on
      at_switch.applied_force_newton.setZero();
      return is_read;
    }
    if (is("a zero that goes on") && lease > Duration::zero() && force.norm() == 0.0) {
      return device_.read(at_switch);
    }
    if (is("first lease only") && is_on_ && sent.norm() > 0.0) {
      return device_.read(at_switch);  // goes on, until the first lease ends
    }
    if (is("NaN as the force before") && !force.allFinite()) return false;
    if (is("NaN accepted") && !force.allFinite()) sent.setZero();
    is_on_ = sent.norm() > 0.0 && lease > Duration::zero();
    const bool is_applied = device_.apply(sent, lease, at_switch) &&
                            (!is("a switch without a reading") || falsify(at_switch));
    named_newton_ = at_switch.applied_force_newton;
    named_until_ = at_switch.sampled_at + named;
    if (is("more than its peak") && force.norm() > 3.4) at_switch.applied_force_newton = force;
    if (is("twice as strong")) at_switch.applied_force_newton = force;
    if (is("a force that is not named")) at_switch.applied_force_newton.setZero();
    return is_applied;
  }
  [[nodiscard]] bool take_latched(DeviceSample& at_end) noexcept override {
    return is("a latch that is not named") ? device_.read(at_end) : device_.take_latched(at_end);
  }
  [[nodiscard]] bool release() noexcept override {
    const bool goes_on = is("does not release") || is("ends at its lease only");
    if (!goes_on && !device_.release()) return false;
    is_on_ = false;
    return !is("never confirms a release");
  }
  [[nodiscard]] bool reopen(Duration within) noexcept override {
    DeviceSample here;
    if ((is("zero where it is reopened") || is("knows that it lost it")) && device_.read(here)) {
      origin_m_ = here.hand_position_m;
    }
    return !is("cannot be reopened") && device_.reopen(within);
  }
  [[nodiscard]] DevicePhase phase() const noexcept override {
    return is("knows that it lost it") && origin_m_ != Vector3::Zero() ? DevicePhase::kConnected
                                                                       : device_.phase();
  }
  [[nodiscard]] Vector3 motor_force_on_hand_newton() const noexcept override {
    return over_ * motors_.motor_force_on_hand_newton();
  }

 private:
  [[nodiscard]] bool is(const char* fault) const noexcept { return fault_ == fault; }
  /// Without a watchdog: readings say what acts. The first of these two says so and pushes on.
  [[nodiscard]] bool names_its_force() const noexcept {
    return is("goes on after its lease") || is("no fault, no watchdog");
  }
  /// Its watchdog is its own next call.
  void end_in_software() noexcept {
    DeviceSample sample;
    if (!is("lease in software") || named_until_ == TimePoint{}) return;
    if (device_.read(sample) && sample.sampled_at >= named_until_) {
      static_cast<void>(device_.release());
    }
  }
  bool name_force(DeviceSample& sample) noexcept {
    if (!names_its_force()) return true;
    const bool is_over = sample.sampled_at >= named_until_;
    if (is_over && is("no fault, no watchdog") && !device_.apply(Vector3::Zero(), {}, sample)) {
      return false;
    }
    sample.applied_force_newton = is_over ? Vector3(Vector3::Zero()) : named_newton_;
    return true;
  }
  bool falsify(DeviceSample& sample) noexcept {
    sample.buttons = is("buttons") ? 4 : 0;
    sample.hand_position_m -= origin_m_;
    if (is("a skew of the future")) sample.skew = Duration(-1);
    if (is("NaN") || is("a switch without a reading")) sample.hand_position_m.z() = std::nan("");
    if (is("millimetres")) sample.hand_position_m = 1e3 * Vector3(0.02, 0.0, 0.0);
    if (is("measures another force")) sample.measured_newton = Vector3(0, 0, 9);
    if (is("no unit quaternion")) sample.orientation.coeffs() *= 2.0;
    if (is("a clock of its own")) sample.sampled_at -= 5s;
    if (is("stamps repeat")) {
      if (frozen_at_ == TimePoint{}) frozen_at_ = sample.sampled_at;
      sample.sampled_at = frozen_at_;
    }
    if (is("positions 3 ms old") || is("no fault, a latency")) {
      past_m_[past_count_++ % past_m_.size()] = {sample.sampled_at, sample.hand_position_m};
      for (std::size_t i = past_count_; i-- > 0 && i + past_m_.size() > past_count_;) {
        const auto& [at, position_m] = past_m_[i % past_m_.size()];
        sample.hand_position_m = position_m;
        if (at <= sample.sampled_at - 3ms) break;
      }
    }
    if (is("stands still")) sample.hand_position_m = Vector3(0.01, 0, 0);
    if (is("follows nothing")) sample.hand_position_m = Vector3(++reads_ % 2 * 1e-4, 0, 0);
    if (is("stamps go back")) sample.sampled_at -= std::chrono::microseconds(200 * ++reads_);
    return true;
  }

  HapticDevice& device_;
  MotorForceSource& motors_;
  DeviceSpecification specification_;
  std::string fault_;
  std::string history_;
  std::unique_ptr<void, decltype(&std::free)> kept_{nullptr, std::free};
  std::string force_;
  Vector3 named_newton_ = Vector3::Zero();
  TimePoint named_until_{};
  Vector3 origin_m_ = Vector3::Zero();
  double over_ = 1.0;
  bool is_on_ = false;
  int reads_ = 0;
  std::array<std::pair<TimePoint, Vector3>, 256> past_m_{};
  std::size_t past_count_ = 0;
  TimePoint frozen_at_{};
};

/// A free device with a fault; with motors that can be seen, or not.
class WrongUnderTest : public DeviceBench {
 public:
  WrongUnderTest(const std::string& fault, bool shows_motors)
      : parts_(free_hand()),
        wrong_(parts_.simulated, parts_.simulated, fault),
        opened_(wrong_, parts_.time, 1ms, fault.starts_with("stamps") ? Duration(1s) : Duration{}),
        latency_(fault == "no fault, a latency" ? Duration(3ms) : Duration{}),
        shows_motors_(shows_motors) {
    if (fault != "force at the start") return;
    DeviceSample sample;
    EXPECT_TRUE(parts_.simulated.apply(Vector3(0, 0, 1), 10s, sample));
  }
  HapticDevice& device() override { return wrong_; }
  [[nodiscard]] const Clock& clock() const override { return parts_.time; }
  void pass(Duration time) override {
    parts_.time.advance(time);
    farthest_m_ = std::max(farthest_m_, (true_m() - begin_m_).norm());
  }
  /// From now on. How far the arm is from there, and how far it was at most.
  void begin() {
    begin_m_ = true_m();
    farthest_m_ = 0.0;
  }
  [[nodiscard]] double away_m() { return (true_m() - begin_m_).norm(); }
  [[nodiscard]] double farthest_m() const { return farthest_m_; }
  [[nodiscard]] Duration stamp_tolerance() const override { return opened_.stamp_tolerance(); }
  [[nodiscard]] Duration period() const override { return 1ms; }
  [[nodiscard]] Duration latency() const override { return latency_; }
  [[nodiscard]] DeviceProfile profile() const override { return {}; }  // that of the simulation
  std::optional<Vector3> motor_force_newton() override {
    return shows_motors_ ? opened_.motor_force_newton() : std::nullopt;
  }
  [[nodiscard]] std::optional<std::uint64_t> allocations() const override {
    // `operator new` is counted under sanitizers too
    return test::allocations_of_this_thread() + test::mallocs_of_this_thread();
  }

 private:
  static HandConfig free_hand() {
    return {.mass_kg = 0.1, .stiffness_newton_per_m = 0.0, .damping_newton_s_per_m = 0.0};
  }
  [[nodiscard]] Vector3 true_m() {
    DeviceSample sample;
    EXPECT_TRUE(parts_.simulated.read(sample));
    return sample.hand_position_m;
  }
  Parts parts_;
  WrongDevice wrong_;
  OpenedDevice opened_;
  Vector3 begin_m_ = Vector3::Zero();
  double farthest_m_ = 0.0;
  Duration latency_;
  bool shows_motors_;
};

std::map<std::string, CheckOutcome> outcomes_of(const std::string& fault, bool shows_motors) {
  std::map<std::string, CheckOutcome> outcomes;
  WrongUnderTest bench(fault, shows_motors);  // as in the command: one device for all
  for (const DeviceCheck& check : device_checks()) outcomes[check.name] = check.run(bench);
  return outcomes;
}

TEST(DeviceChecks, AreGoodOneAfterTheOtherWithoutAFault) {
  for (const auto& [name, outcome] : outcomes_of("none", true)) {
    EXPECT_EQ(outcome.verdict, CheckVerdict::kGood) << name << ": " << outcome.text;
  }
}

TEST(DeviceChecks, NameEachFault) {
  std::map<std::string, std::string> check_of{{"force at the start", "start"},
                                              {"no name", "specification"},
                                              {"peak in millinewtons", "specification"},
                                              {"NaN", "reading"},
                                              {"millimetres", "reading"},
                                              {"no unit quaternion", "reading"},
                                              {"a clock of its own", "reading"},
                                              {"stamps go back", "stamps"},
                                              {"stamps repeat", "stamps"},
                                              {"buttons", "buttons"},
                                              {"slow transfers", "pace"},
                                              {"a switch without a reading", "switch"},
                                              {"wrong axis", "direction"},
                                              {"wrong sign", "direction"},
                                              {"twice as strong", "motors"},
                                              {"millinewtons", "force"},
                                              {"first lease only", "renewal"},
                                              {"no watchdog", "lease"},
                                              {"lease in software", "lease"},
                                              {"a reading that names no force", "reported"},
                                              {"goes on after its lease", "reported"},
                                              {"a latch that is not there", "latch"},
                                              {"a latch that is not named", "latch"},
                                              {"lease below zero", "no lease"},
                                              {"lease of zero", "no lease"},
                                              {"no limit at the peak", "peak"},
                                              {"does not release", "release"},
                                              {"never confirms a release", "release"},
                                              {"NaN as the force before", "not finite"},
                                              {"NaN accepted", "not finite"},
                                              {"allocates", "allocation"},
                                              {"a force that is not named", "applied"},
                                              {"more than its peak", "applied"},
                                              {"measures another force", "applied"},
                                              {"held currents that vanish", "specification"},
                                              {"a skew of the future", "reading"},
                                              {"zero where it is reopened", "reopen"},
                                              {"cannot be reopened", "reopen"}};
  if (!test::kIsSanitized) check_of.emplace("calls malloc", "allocation");
  for (const auto& [fault, check] : check_of) {
    const CheckOutcome found = outcomes_of(fault, true)[check];
    EXPECT_EQ(found.verdict, CheckVerdict::kFailed) << fault << ": " << found.text;
    EXPECT_FALSE(found.text.empty()) << fault;
  }
}

TEST(DeviceChecks, AForceThatOnlyAReadingEndsIsSeenToEndOrToGoOn) {
  for (const bool shows_motors : {true, false}) {
    const auto outcome_of = [&](const char* fault) {
      return outcomes_of(fault, shows_motors)["reported"];
    };
    const CheckOutcome good = outcome_of("no fault, no watchdog");
    EXPECT_EQ(good.verdict, CheckVerdict::kGood) << good.text;
    const CheckOutcome wrong = outcome_of("goes on after its lease");
    EXPECT_EQ(wrong.verdict, CheckVerdict::kFailed) << wrong.text;
  }
}

TEST(DeviceChecks, ADeviceThatSaysThatItLostItsCalibrationMayReopenAnywhere) {
  const CheckOutcome found = outcomes_of("knows that it lost it", true)["reopen"];
  EXPECT_EQ(found.verdict, CheckVerdict::kGood) << found.text;
}

// device_node enables neither.
TEST(DeviceChecks, ADeviceThatDoesNotFollowASmallPushFails) {
  for (const char* fault : {"stands still", "follows nothing"}) {
    const CheckOutcome found = outcomes_of(fault, false)["motors"];
    EXPECT_EQ(found.verdict, CheckVerdict::kFailed) << fault;
    EXPECT_THAT(found.text, testing::HasSubstr("device_node would refuse to enable it"));
  }
}

// Hardware whose motors cannot be observed.
TEST(DeviceChecks, NameTheFaultsThatTheMotionAloneShows) {
  const std::vector<std::pair<std::string, std::string>> check_of{
      {"wrong sign", "direction"},
      {"wrong sign", "motors"},
      {"wrong axis", "motors"},
      {"positions 3 ms old", "lag"},
      {"twice as strong", "motors"},
      {"no watchdog", "lease"},
      {"lease in software", "lease"},
      {"first lease only", "lease"},
      {"lease below zero", "no lease"},
      {"lease of zero", "no lease"},
      {"does not release", "release"},
      {"never confirms a release", "release"},
      {"a zero that goes on", "lease"},
      {"ends at its lease only", "no lease"},
      {"ends at its lease only", "release"}};
  for (const auto& [fault, check] : check_of) {
    const CheckOutcome found = outcomes_of(fault, false)[check];
    EXPECT_EQ(found.verdict, CheckVerdict::kFailed) << fault << ": " << found.text;
  }
}

// An arm that nobody holds coasts on after each push: a row of them one way would carry it out of
// its workspace.
TEST(DeviceChecks, ThePushesOfACheckBringTheArmBack) {
  WrongUnderTest bench("no fault, no watchdog", false);
  int seen = 0;
  for (const DeviceCheck& check : device_checks()) {
    bench.begin();
    const CheckOutcome outcome = check.run(bench);
    if (outcome.text.find("by the motion, ") == std::string::npos) continue;
    ++seen;
    EXPECT_GT(bench.farthest_m(), 1e-3) << check.name;
    EXPECT_LT(bench.away_m(), 0.5 * bench.farthest_m()) << check.name;
  }
  EXPECT_GE(seen, 2);
}

TEST(DeviceChecks, ByTheMotionAloneFindNoFaultInARightDriver) {
  for (const char* right : {"none", "no fault, no watchdog", "no fault, a latency"}) {
    for (const auto& [name, outcome] : outcomes_of(right, false)) {
      EXPECT_NE(outcome.verdict, CheckVerdict::kFailed)
          << right << ": " << name << ": " << outcome.text;
    }
  }
}

TEST(DeviceChecks, SayWhatTheyCannotSee) {
  std::map<std::string, CheckOutcome> outcomes = outcomes_of("none", false);
  for (const char* name : {"start", "force", "renewal", "peak"}) {
    EXPECT_EQ(outcomes[name].verdict, CheckVerdict::kNotObservable) << name;
  }
  for (const char* name : {"direction", "lease", "no lease", "release", "not finite"}) {
    EXPECT_EQ(outcomes[name].verdict, CheckVerdict::kGood) << name << outcomes[name].text;
  }
}

}  // namespace
}  // namespace palpate::device

namespace palpate::test {
PALPATE_DEVICE_CONFORMANCE(Simulated, device::open_simulated);
}  // namespace palpate::test
