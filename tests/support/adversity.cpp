// SPDX-License-Identifier: Apache-2.0
#include "tests/support/adversity.h"

#include <array>
#include <memory>
#include <utility>

#include "common/core/random.h"
#include "common/session/session_file.h"
#include "deploy/campaign/hostile_design.h"
#include "deploy/lockstep/adversary.h"
#include "deploy/lockstep/loopback.h"
#include "tests/support/machine/places.h"

namespace palpate::test {

AdverseResult run_adverse(const AdverseRun& run, std::uint64_t seed) {
  Session session =
      load_session(test::source_dir() + "/deploy/sessions/" + run.session, run.overrides);
  session.seed = seed;
  LockstepOptions options{.links = run.links, .has_ideal = false};
  options.make_device = run.make_device;
  if (run.told) {
    // the lies are what the engine tells
    const auto tamperer = std::make_shared<PhysicsTamperer>(
        std::exchange(session.adversary.physics, HostilePhysics::kHonest),
        stream_seed(seed, "hostile physics"));
    options.make_engine = [told = *run.told, tamperer](const Session& of) {
      return black_box(of, told, [tamperer](Interaction& i) { tamperer->tamper(i); });
    };
  }
  const RunReport report =
      run_loopback(session, {.seconds = run.seconds, .lockstep = std::move(options)});
  const Side& side = session.side();
  return {.statistics = report.statistics,
          .device = report.device,
          .mofc = report.mofc,
          .top_speed_m_per_s =
              report.statistics.top_tool_speed_m_per_s() / side.device.workspace.scale_ratio,
          .v_max_m_per_s = side.mofc.guard.v_max_m_per_s,
          .wrist_speed_ratio = side.device.wrist ? report.statistics.top_wrist_speed_rad_per_s() /
                                                       side.device.wrist->v_max_rad_per_s
                                                 : 0.0};
}

AdverseRun random_adverse_run(std::uint64_t seed) {
  return {.overrides = campaign::hostile_overrides(seed)};
}

AdverseRun random_wrist_run(std::uint64_t seed) {
  AdverseRun run = random_adverse_run(seed);
  run.session = "tools/hostile_wrist.txtpb";
  run.seconds = 0.5;
  const std::vector<std::string> turning = campaign::hostile_wrist_overrides(seed);
  run.overrides.insert(run.overrides.end(), turning.begin(), turning.end());
  return run;
}

AdverseRun random_black_box_run(std::uint64_t seed) {
  AdverseRun run = random_adverse_run(seed);
  constexpr std::array kTold{Told::kForce, Told::kPoints, Told::kField};
  run.told = kTold.at(seed % kTold.size());
  run.overrides.emplace_back("mofc.interaction=local");
  return run;
}

AdverseRun random_lying_run(std::uint64_t seed) {
  AdverseRun run = random_adverse_run(seed);
  run.overrides.push_back(campaign::lying_clamp_override(seed));
  return run;
}

}  // namespace palpate::test
