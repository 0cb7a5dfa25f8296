#include "tests/support/adversity.h"

#include "common/session/session_file.h"
#include "deploy/campaign/hostile_design.h"
#include "deploy/lockstep/loopback.h"

namespace palpate::test {

AdverseResult run_adverse(const AdverseRun& run, std::uint64_t seed) {
  Session session =
      load_session(PALPATE_SOURCE_DIR "/deploy/sessions/hostile.txtpb", run.overrides);
  session.seed = seed;
  const RunReport report = run_loopback(
      session, {.seconds = run.seconds, .lockstep = {.links = run.links, .has_ideal = false}});
  const Side& side = session.side();
  return {.statistics = report.statistics,
          .device = report.device,
          .mofc = report.mofc,
          .top_speed_m_per_s =
              report.statistics.top_tool_speed_m_per_s() / side.device.workspace.scale_ratio,
          .v_max_m_per_s = side.mofc.guard.v_max_m_per_s};
}

AdverseRun random_adverse_run(std::uint64_t seed) {
  return {.overrides = campaign::hostile_overrides(seed)};
}

AdverseRun random_lying_run(std::uint64_t seed) {
  AdverseRun run = random_adverse_run(seed);
  run.overrides.push_back(campaign::lying_clamp_override(seed));
  return run;
}

}  // namespace palpate::test
