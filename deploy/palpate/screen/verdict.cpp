// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/screen/verdict.h"

#include <spdlog/fmt/fmt.h>

#include "common/process/terminal.h"

namespace palpate {

std::string graded_line(Grade grade, const std::string& text) {
  const Colour colour = grade == Grade::kGood   ? Colour::kGood
                        : grade == Grade::kFair ? Colour::kFair
                                                : Colour::kBad;
  return "  " + coloured(fmt::format("{:<4}", name(grade)), colour) + "  " + text + "\n";
}

std::string verdict_text(const std::vector<RunFinding>& findings) {
  std::string text;
  for (const RunFinding& finding : findings) {
    text += graded_line(finding.grade,
                        finding.text + (finding.remedy.empty() ? "" : ": ") + finding.remedy);
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
