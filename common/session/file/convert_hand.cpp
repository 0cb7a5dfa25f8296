// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "common/session/file/convert.h"
#include "common/session/file/recorded_path.h"

namespace palpate {

namespace {

constexpr double kPerpendicularTolerance_rad = 1e-3;

VPath to_v(const Fields& fields) {
  VPath path;
  path.apex_m = fields.vector("apex_m");
  path.normal = fields.direction("normal");
  path.tangent = fields.direction("tangent");
  const double along = path.normal.dot(path.tangent);
  if (std::abs(along) > std::sin(kPerpendicularTolerance_rad)) {
    fields.problem(fields.has("tangent") ? "tangent" : "normal",
                   "tangent must be perpendicular to normal within 0.001 rad; give both, e.g. "
                   "normal { z: 1 } tangent { x: 1 }");
  }
  path.tangent = (path.tangent - along * path.normal).normalized();
  path.height_m = fields.number("height_m");
  path.half_width_m = fields.number("half_width_m");
  path.speed_m_per_s = fields.number("speed_m_per_s");
  path.free_motion_s = fields.number("free_motion_s");
  path.free_amplitude_m = fields.number("free_amplitude_m");
  path.free_frequency_hz = fields.number("free_frequency_hz");
  return path;
}

SinusoidPath to_sinusoid(const Fields& fields) {
  return {.center_m = fields.vector("center_m"),
          .amplitude_m = fields.vector("amplitude_m"),
          .frequency_hz = fields.vector("frequency_hz"),
          .phase_rad = fields.vector("phase_rad")};
}

RecordedPath to_recorded(const Fields& fields, const std::filesystem::path& base_dir,
                         Problems& problems) {
  RecordedPath path;
  path.loops = fields.flag("loop");
  if (!fields.has_required("file")) return path;
  if (const auto file = fields.file("file", base_dir); !file.empty()) {
    path.samples = load_recorded_path(file, fields.place("file"), problems);
  }
  return path;
}

HostilePath to_hostile(const Fields& fields) {
  return {.center_m = fields.vector("center_m"),
          .radius_m = fields.number("radius_m"),
          .v_max_m_per_s = fields.number("v_max_m_per_s")};
}

PathConfig to_path(const Fields& hand, const std::filesystem::path& base_dir, Problems& problems) {
  const std::string kind = hand.given_member("path");
  if (kind == "v") return to_v(hand.message("v"));
  if (kind == "sinusoid") return to_sinusoid(hand.message("sinusoid"));
  if (kind == "recorded") return to_recorded(hand.message("recorded"), base_dir, problems);
  if (kind == "hostile") return to_hostile(hand.message("hostile"));
  return HoldPath{hand.message("hold").vector("position_m")};
}

PointerConfig to_pointer(const Fields& fields) {
  PointerConfig config;
  config.center_m = fields.vector("center_m");
  config.reach_m = fields.number("reach_m");
  config.speed_m_per_s = fields.number("speed_m_per_s");
  config.holder_timeout = fields.milliseconds("holder_timeout_ms");
  return config;
}

}  // namespace

double to_until_s(const Fields& fields, double from_s) {
  const double until_s = fields.number("until_s");
  if (until_s <= from_s) {
    fields.problem("until_s", "must be > from_s, " + shown(from_s));
  }
  return until_s;
}

HandConfig to_hand(const Fields& hand, const std::filesystem::path& base_dir, Problems& problems) {
  HandConfig config;
  config.mass_kg = hand.number("mass_kg");
  config.stiffness_newton_per_m = hand.number("stiffness_newton_per_m");
  config.damping_newton_s_per_m = hand.number("damping_newton_s_per_m");
  config.path = to_path(hand, base_dir, problems);
  if (hand.has("pointer")) config.pointer = to_pointer(hand.message("pointer"));
  for (const Fields& fields : hand.messages("press")) {
    ButtonPress press;
    press.button = static_cast<std::uint32_t>(fields.integer("button"));
    press.from_s = fields.number("from_s");
    press.until_s = to_until_s(fields, press.from_s);
    config.presses.push_back(press);
  }
  return config;
}

}  // namespace palpate
