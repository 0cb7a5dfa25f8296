#include "deploy/palpate/screen/verdict.h"

#include <spdlog/fmt/fmt.h>

#include <cmath>

#include "common/process/terminal.h"
#include "common/telemetry/summary.h"

namespace palpate {
namespace {

constexpr double kFewTicks = 1e-3;
constexpr double kLeastEnergy_joule = -1e-6;
constexpr double kManyClamped = 0.05;

std::string percent(double ratio) { return fmt::format("{:.2f} %", 100.0 * ratio); }

const char* energy_remedy(const MofcConfig& mofc) {
  const bool is_limited = mofc.controller == ControllerKind::kMofc || mofc.has_safety_net;
  if (mofc.controller == ControllerKind::kNone && !is_limited) {
    return "no controller limits the force; try --set mofc.controller=mofc";
  }
  if (!is_limited) {
    return "this controller does not prevent it here; try --set mofc.safety_net=true";
  }
  return "use mode guard or vector, and a device profile that is a lower bound (`palpate "
         "identify`)";
}

}  // namespace

std::vector<Verdict> verdicts_of(const Side& side, const DeviceCounters& device,
                                 const MofcCounters& mofc, bool in_real_time) {
  std::vector<Verdict> verdicts;
  const auto scheduled = static_cast<double>(device.loop.ticks + device.loop.skipped_ticks);
  const char* const remedy = in_real_time ? "run `palpate doctor`, stop other programs"
                                          : "a simulated fault; see `faults` of the session";
  const double skipped = static_cast<double>(device.loop.skipped_ticks) / std::fmax(scheduled, 1.0);
  const double unanswered = 1.0 - answered_ratio(device) - skipped;
  if (skipped > kFewTicks) {
    verdicts.push_back({false, percent(skipped) + " of the ticks were skipped: " + remedy});
  }
  if (unanswered > kFewTicks) {
    verdicts.push_back({false, percent(unanswered) +
                                   " of the ticks were not answered in time: " + remedy +
                                   (in_real_time ? ", or use --together device,mofc" : "")});
  }
  if (scheduled > 0.0 && skipped <= kFewTicks && unanswered <= kFewTicks) {
    verdicts.push_back({true, percent(answered_ratio(device)) + " of the ticks answered in time"});
  }

  const double energy_joule = device.minimum_true_energy_joule;
  if (energy_joule < kLeastEnergy_joule) {
    verdicts.push_back({false, fmt::format("the hand extracted {:.3g} mJ: {}", -1e3 * energy_joule,
                                           energy_remedy(side.mofc))});
  } else if (std::isfinite(energy_joule)) {
    verdicts.push_back({true, "the hand extracted no energy"});
  }

  if (mofc.contact_ticks == 0) {
    verdicts.push_back({false,
                        "the tool never touched tissue: check the hand's path and the "
                        "places of the tissues"});
    return verdicts;
  }
  // other controllers change every force
  if (side.mofc.controller != ControllerKind::kMofc) return verdicts;
  const double clamped =
      static_cast<double>(mofc.clamped_ticks) / static_cast<double>(mofc.contact_ticks);
  if (clamped > kManyClamped) {
    verdicts.push_back({false, percent(clamped) +
                                   " of the ticks in contact were clamped: the requested force "
                                   "creates energy; raise physics.rate_hz, shorten the delay, or "
                                   "set mofc.interaction=local"});
  } else {
    verdicts.push_back(
        {true, "the clamp left " + percent(1.0 - clamped) + " of the contact as it is"});
  }
  return verdicts;
}

std::string verdict_text(const std::vector<Verdict>& verdicts) {
  std::string text;
  for (const Verdict& verdict : verdicts) {
    text += "  " +
            (verdict.is_good ? coloured("good", Colour::kGood) : coloured("bad ", Colour::kBad)) +
            "  " + verdict.text + "\n";
  }
  return text;
}

std::string start_warning(const PhysicsTick& first) {
  if (first.contact_count == 0) return {};
  const Vector3 at_mm = 1e3 * first.tool_position_world_m;
  return fmt::format(
      "the tool is in tissue at the first step of the physics, at ({:.1f}, {:.1f}, {:.1f}) mm in "
      "W: "
      "which side it came from is not known, and the whole force begins at once; start outside "
      "(the hand's path, or the place of the tissue)",
      at_mm.x(), at_mm.y(), at_mm.z());
}

}  // namespace palpate
