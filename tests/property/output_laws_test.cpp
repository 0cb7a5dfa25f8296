// SPDX-License-Identifier: Apache-2.0
// What any controller may put out: never more than requested, always finite, without allocating.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "mofc_node/controllers/paper_mofc.h"
#include "tests/property/controller_cases.h"
#include "tests/support/alloc_guard.h"

namespace palpate::controllers {
namespace {

TEST(OutputLaws, VectorModeReducesTheRequestedForceOrKeepsIt) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Case c(seed);
    VectorMofc controller(c.assumed, c.assumed_q, c.assumed_delay_s);
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.assumed.f_co);
    std::uint64_t clamped = 0;
    loop.run(controller, 1500, [&](const ControlInput& in, const ControlOutput& out) {
      ASSERT_NO_FATAL_FAILURE(expect_reduced_or_kept(in, out));
      if (out.is_clamped) ++clamped;
    });
    EXPECT_GT(clamped, 0u);
  }
}

TEST(OutputLaws, PaperModeReducesEachAxisOrKeepsIt) {
  for (const std::uint64_t seed : seeds(50)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Case c(seed);
    PaperMofc controller(c.assumed);
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.assumed.f_co);
    std::uint64_t clamped = 0;
    loop.run(controller, 1500, [&](const ControlInput& in, const ControlOutput& out) {
      for (int i = 0; i < 3; ++i) {
        const double requested = in.requested_force_on_hand_newton[i];
        const double given = out.force_on_hand_newton[i];
        ASSERT_LE(std::abs(given), std::abs(requested));
        ASSERT_LE(std::abs(given), out.f_max_newton[i]);
        ASSERT_GE(given * requested, 0.0);
      }
      ASSERT_EQ(out.is_clamped, out.force_on_hand_newton != in.requested_force_on_hand_newton);
      if (out.is_clamped) ++clamped;
    });
    EXPECT_GT(clamped, 0u);
  }
}

/// A clamp and copies of it: the first is taken after 700 steps, and put back, when the clamp is
/// reset after 1,000.
template <class Clamp>
class Copied final : public ForceController {
 public:
  explicit Copied(const Clamp& clamp) : clamp_(clamp), copy_(clamp) {}
  void reset() noexcept override {}
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override {
    if (steps_ == 700) copy_ = clamp_;
    if (steps_ == 1000) {
      clamp_.reset();
      clamp_ = copy_;
    }
    const ControlOutput out = clamp_.step(input);
    if (steps_++ >= 700) {
      const ControlOutput again = copy_.step(input);
      differing_ += again.force_on_hand_newton != out.force_on_hand_newton ||
                            again.ledger_energy_joule != out.ledger_energy_joule ||
                            again.lease_s != out.lease_s
                        ? 1
                        : 0;
    }
    return out;
  }
  [[nodiscard]] int differing() const { return differing_; }

 private:
  Clamp clamp_;
  Clamp copy_;
  int steps_ = 0;
  int differing_ = 0;
};

/// What a clamp remembers is in it: a copy decides the same from then on, to the bit.
TEST(OutputLaws, ACopyOfAClampDecidesTheSame) {
  for (const std::uint64_t seed : seeds(20)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    const auto differing = [](auto& c, auto clamp) {
      Copied controller(clamp);
      ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.assumed.f_co);
      loop.run(controller, 1500, [](const ControlInput&, const ControlOutput&) {});
      return controller.differing();
    };
    GuardCase guarded(seed);
    EXPECT_EQ(differing(guarded, GuardMofc(guarded.parameters())), 0);
    Case c(seed);
    EXPECT_EQ(differing(c, VectorMofc(c.assumed, c.assumed_q, c.assumed_delay_s)), 0);
    EXPECT_EQ(differing(c, PaperMofc(c.assumed)), 0);
  }
}

/// Any finite double, of any size: all bit patterns but those of infinity and NaN.
double any_finite(Random& random) {
  for (;;) {
    const double x = std::bit_cast<double>(random.bits());
    if (std::isfinite(x)) return x;
  }
}
Vector3 any_finite_vector(Random& random) {
  return {any_finite(random), any_finite(random), any_finite(random)};
}

std::vector<std::unique_ptr<ForceController>> all_controllers(const Case& c) {
  std::vector<std::unique_ptr<ForceController>> all;
  all.push_back(std::make_unique<PassThrough>());
  all.push_back(std::make_unique<PaperMofc>(c.assumed));
  all.push_back(std::make_unique<VectorMofc>(c.assumed, c.assumed_q, c.assumed_delay_s,
                                             std::nullopt, c.longest_lease_s));
  all.push_back(std::make_unique<GuardMofc>(GuardParameters{.mofc = c.assumed,
                                                            .resolution_m = c.assumed_q,
                                                            .delta_max_s = c.assumed_delay_s,
                                                            .longest_lease_s = c.longest_lease_s}));
  const AxisFriction axes{.f_d = {c.assumed.f_d, 0.0, 0.2}, .f_co = {c.assumed.f_co, 0.1, 0.0}};
  all.push_back(std::make_unique<PaperMofc>(axes, c.assumed.T));
  all.push_back(std::make_unique<VectorMofc>(c.assumed, c.assumed_q, c.assumed_delay_s, axes,
                                             c.longest_lease_s));
  all.push_back(std::make_unique<GuardMofc>(GuardParameters{.mofc = c.assumed,
                                                            .per_axis = axes,
                                                            .resolution_m = c.assumed_q,
                                                            .delta_max_s = c.assumed_delay_s,
                                                            .longest_lease_s = c.longest_lease_s}));
  return all;
}

TEST(OutputLaws, FiniteInputOfAnySizeNeverGivesAForceThatIsNotANumberOrMoreThanRequested) {
  for (const std::uint64_t seed : seeds(100)) {
    SCOPED_TRACE(testing::Message() << "seed=" << seed);
    Case c(seed);
    if (seed % 4 == 0) c.assumed.f_d = 0.0;
    if (seed % 3 == 0) c.assumed.f_co = 0.0;
    for (const auto& controller : all_controllers(c)) {
      for (int k = 0; k < 200; ++k) {
        const bool is_huge = c.random.chance(0.5);
        const auto any = [&] {
          return is_huge ? any_finite_vector(c.random) : Vector3(c.random.direction());
        };
        std::vector<AppliedStretch> echo(c.random.below(5));
        for (AppliedStretch& stretch : echo) {
          stretch = {.duration_s = c.random.chance(0.2) ? 0.0 : c.random.uniform(0.0, 0.01),
                     .force_on_hand_newton = any(),
                     .hand_position_at_end_m = any(),
                     .has_position_at_end = c.random.chance(0.9)};
        }
        const ControlInput input{.hand_position_m = any(),
                                 .applied = echo,
                                 .has_gap = c.random.chance(0.05),
                                 .acting_force_on_hand_newton = any(),
                                 .acting_lease_s = c.random.chance(0.5) ? 0.0 : any().norm(),
                                 .requested_force_on_hand_newton = any()};
        const ControlOutput output = controller->step(input);
        const Vector3 F = output.force_on_hand_newton;
        ASSERT_TRUE(F.allFinite());
        ASSERT_TRUE(output.lease_s == 0.0 ||
                    (output.lease_s >= c.assumed.T && output.lease_s <= c.longest_lease_s));
        for (int i = 0; i < 3; ++i) {
          ASSERT_LE(std::abs(F[i]), std::abs(input.requested_force_on_hand_newton[i]));
        }
        if (c.random.chance(0.02)) controller->reset();
      }
    }
  }
}

static_assert(noexcept(std::declval<ForceController&>().step(std::declval<const ControlInput&>())));
static_assert(noexcept(std::declval<PassThrough&>().step(std::declval<const ControlInput&>())));
static_assert(noexcept(std::declval<PaperMofc&>().step(std::declval<const ControlInput&>())));
static_assert(noexcept(std::declval<VectorMofc&>().step(std::declval<const ControlInput&>())));
static_assert(noexcept(std::declval<VectorMofc&>().reset()));
static_assert(noexcept(std::declval<GuardMofc&>().step(std::declval<const ControlInput&>())));
static_assert(noexcept(std::declval<GuardMofc&>().reset()));

TEST(OutputLaws, StepDoesNotAllocate) {
  Case c(1);
  c.timing.lost_answers = c.timing.lost_states = c.timing.silent_watchdog = 0.1;
  for (const auto& controller : all_controllers(c)) {
    class Guarded final : public ForceController {
     public:
      explicit Guarded(ForceController& inner) : inner_(inner) {}
      void reset() noexcept override { inner_.reset(); }
      ControlOutput step(const ControlInput& input) noexcept override {
        const test::AllocGuard guard;
        const ControlOutput output = inner_.step(input);
        allocations += guard.count();
        ++steps;
        return output;
      }
      std::uint64_t allocations = 0;
      std::uint64_t steps = 0;

     private:
      ForceController& inner_;
    };
    Guarded guarded(*controller);
    ClosedLoop loop(c.random, c.hand, c.timing, c.q, c.assumed.f_co);
    loop.run(guarded, 1000, [](const ControlInput&, const ControlOutput&) {});
    EXPECT_GT(guarded.steps, 500u);
    EXPECT_EQ(guarded.allocations, 0u);
  }
}

}  // namespace
}  // namespace palpate::controllers
