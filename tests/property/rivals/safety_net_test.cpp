// SPDX-License-Identifier: Apache-2.0
// All controllers of others: behind the safety net no hand draws energy whatever they do; alone
// some do. None allocates.
#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "mofc_node/controllers/paper_mofc.h"
#include "mofc_node/controllers/rivals/bounding.h"
#include "mofc_node/controllers/rivals/energy_tank.h"
#include "mofc_node/controllers/rivals/input_to_state.h"
#include "mofc_node/controllers/rivals/lyapunov.h"
#include "mofc_node/controllers/rivals/memory_based.h"
#include "mofc_node/controllers/rivals/passivity_control.h"
#include "mofc_node/controllers/rivals/two_port.h"
#include "mofc_node/controllers/rivals/virtual_coupling.h"
#include "mofc_node/controllers/rivals/wave_variables.h"
#include "mofc_node/controllers/safety_net.h"
#include "tests/property/controller_cases.h"
#include "tests/support/alloc_guard.h"

namespace palpate::controllers {
namespace {

struct Rival {
  const char* name;
  std::function<std::unique_ptr<ForceController>(const MofcParameters&)> make;
};

std::vector<Rival> rivals() {
  using Observer = PassivityControlParameters::Observer;
  const auto observed = [](Observer observer) {
    return [observer](const MofcParameters& p) {
      return std::make_unique<PassivityControl>(
          PassivityControlParameters{.observer = observer, .T = p.T});
    };
  };
  return {
      {"none", [](const MofcParameters&) { return std::make_unique<PassThrough>(); }},
      {"paper", [](const MofcParameters& p) { return std::make_unique<PaperMofc>(p); }},
      {"virtual coupling",
       [](const MofcParameters& p) {
         return std::make_unique<VirtualCoupling>(
             VirtualCouplingParameters{.K_c = 500.0, .B_c = 0.1, .T = p.T});
       }},
      {"energy bounding",
       [](const MofcParameters& p) {
         return std::make_unique<EnergyBounding>(BoundingParameters{.f_d = p.f_d, .T = p.T});
       }},
      {"force bounding, less",
       [](const MofcParameters& p) {
         return std::make_unique<LessConservativeBounding>(
             BoundingParameters{.f_d = p.f_d, .T = p.T});
       }},
      {"force bounding, more",
       [](const MofcParameters& p) {
         return std::make_unique<MoreConservativeBounding>(
             BoundingParameters{.f_d = p.f_d, .T = p.T});
       }},
      {"PO/PC, product", observed(Observer::kProduct)},
      {"PO/PC, sampled", observed(Observer::kSampled)},
      {"PO/PC, reference", observed(Observer::kReference)},
      {"memory based", [](const MofcParameters&) { return std::make_unique<MemoryBased>(55e-6); }},
      {"input to state",
       [](const MofcParameters& p) { return std::make_unique<InputToState>(1.5 * p.T); }},
      {"two ports",
       [](const MofcParameters& p) {
         return std::make_unique<TwoPort>(PassivityControlParameters{.T = p.T});
       }},
      {"energy tank",
       [](const MofcParameters&) { return std::make_unique<EnergyTank>(EnergyTankParameters{}); }},
      {"Lyapunov",
       [](const MofcParameters& p) {
         return std::make_unique<LyapunovLimiter>(LyapunovParameters{.T = p.T});
       }},
      {"wave variables", [](const MofcParameters& p) {
         return std::make_unique<WaveVariables>(WaveVariablesParameters{.b = 2.0, .T = p.T});
       }}};
}

/// Adds what only these controllers use, all of it wrong: a tissue that pushes along any motion,
/// any velocity, normal and place; waves with energy from nowhere.
class HostileProbe final : public ForceController, public TissueProbe {
 public:
  HostileProbe(ForceController& inner, std::uint64_t seed) : inner_(inner), random_(seed) {}
  void reset() noexcept override { inner_.reset(); }
  ControlOutput step(const ControlInput& honest) noexcept override {
    ControlInput input = honest;
    input.hand_velocity_m_per_s = random_.uniform(0.0, 2.0) * random_.direction();
    input.evaluated_at_m = input.hand_position_m + random_.uniform(0.0, 0.02) * random_.direction();
    input.surface_normal = random_.chance(0.3) ? Vector3(Vector3::Zero()) : random_.direction();
    input.tissue = random_.chance(0.9) ? this : nullptr;
    requested_newton_ = input.requested_force_on_hand_newton;
    wave_.impedance_newton_s_per_m = 2.0;
    wave_.stream = random_.chance(0.01) ? wave_.stream + 1 : wave_.stream;
    wave_.sum += 1e-3 * random_.direction();
    wave_.energy_joule += random_.uniform(0.0, 0.01);
    input.returned_wave = &wave_;
    return inner_.step(input);
  }
  [[nodiscard]] Force at(const Vector3& x, const Vector3& v) const noexcept override {
    return {.force_on_hand_newton = requested_newton_ + 300.0 * x + 5.0 * v,
            .stored_energy_joule = 10.0 * x.norm()};
  }

 private:
  ForceController& inner_;
  Random random_;
  Vector3 requested_newton_ = Vector3::Zero();
  Wave wave_;
};

/// The least energy of a hostile run, which the seed determines.
double least_energy(ForceController& controller, GuardCase& a_case, std::uint64_t seed, int ticks) {
  HostileProbe probe(controller, seed);
  RandomClaims claims(probe, ~seed);
  ClosedLoop loop(a_case.random, a_case.hand, a_case.timing, a_case.q,
                  std::min(a_case.assumed.f_co, a_case.hand.f_co));
  loop.run(claims, ticks, [](const ControlInput&, const ControlOutput& output) {
    ASSERT_TRUE(output.force_on_hand_newton.allFinite());
  });
  return loop.least_energy_joule();
}

TEST(SafetyNet, NoHandDrawsEnergyBehindItWhateverTheControllerDoes) {
  for (const Rival& rival : rivals()) {
    double least_alone = 0.0;
    for (const std::uint64_t seed : seeds(24)) {
      SCOPED_TRACE(testing::Message() << rival.name << ", seed " << seed);
      GuardCase a_case(seed);
      SafetyNet net(rival.make(a_case.assumed), a_case.parameters());
      EXPECT_GE(least_energy(net, a_case, seed, 1500), -kRoundingJoule);
      GuardCase again(seed);
      least_alone =
          std::min(least_alone, least_energy(*rival.make(again.assumed), again, seed, 1500));
    }
    // without it each of them gives energy to this hand, but for those that need nothing else than
    // friction and a force that ends with its period
    if (std::string(rival.name).find("bounding") == std::string::npos) {
      EXPECT_LT(least_alone, -1e-3) << rival.name;
    }
  }
}

TEST(SafetyNet, AForceThatIsNotANumberCountsAsNone) {
  class Broken final : public ForceController {
   public:
    void reset() noexcept override {}
    ControlOutput step(const ControlInput&) noexcept override {
      return {.force_on_hand_newton = Vector3::Constant(std::numeric_limits<double>::quiet_NaN())};
    }
  };
  SafetyNet net(std::make_unique<Broken>(), {.mofc = {.f_d = 0.1, .f_co = 0.1, .T = 0.001}});
  ControlInput input;
  input.requested_force_on_hand_newton = {1.0, 0.0, 0.0};
  EXPECT_EQ(net.step(input).force_on_hand_newton, Vector3::Zero());
}

TEST(Rivals, NoneAllocatesInAStep) {
  for (const Rival& rival : rivals()) {
    GuardCase a_case(3);
    const auto controller = rival.make(a_case.assumed);
    HostileProbe probe(*controller, 1);
    std::vector<AppliedStretch> applied(2);
    Random random(1);
    ControlInput input;
    const test::AllocGuard guard;
    for (int k = 0; k < 3000; ++k) {
      for (AppliedStretch& stretch : applied) {
        input.hand_position_m += 1e-4 * random.direction();
        stretch = {.duration_s = 0.5 * a_case.assumed.T,
                   .force_on_hand_newton = random.direction(),
                   .hand_position_at_end_m = input.hand_position_m};
      }
      input.applied = applied;
      input.has_gap = random.chance(0.01);
      input.requested_force_on_hand_newton =
          random.chance(0.1) ? Vector3(Vector3::Zero()) : random.direction();
      (void)probe.step(input);
    }
    EXPECT_EQ(guard.count(), 0) << rival.name;
  }
}

TEST(Rivals, AResetControllerAnswersAsANewOne) {
  for (const Rival& rival : rivals()) {
    GuardCase a_case(5);
    const auto controller = rival.make(a_case.assumed);
    std::vector<Vector3> before;
    for (int round = 0; round < 2; ++round) {
      HostileProbe same(*controller, 7);
      Random random(9);
      Vector3 x = Vector3::Zero();
      for (std::size_t k = 0; k < 200; ++k) {
        x += 1e-4 * random.direction();
        const AppliedStretch stretch{a_case.assumed.T, random.direction(), x, true};
        ControlInput input;
        input.hand_position_m = x;
        if (k > 0) input.applied = {&stretch, 1};
        input.requested_force_on_hand_newton = random.direction();
        const Vector3 F = same.step(input).force_on_hand_newton;
        if (round == 0) {
          before.push_back(F);
        } else {
          ASSERT_EQ(F, before[k]) << rival.name << ", step " << k;
        }
      }
      controller->reset();
    }
  }
}

}  // namespace
}  // namespace palpate::controllers
