// SPDX-License-Identifier: Apache-2.0
#include "deploy/conform/tour.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace palpate {
namespace {

constexpr double kPress_s = 0.3;  // from clear to pressed
constexpr double kCircleRadius_m = 3e-3;
constexpr double kJumpNewton = 0.5;  // and the steepest tissue that is rendered well
constexpr double kJumpNewtonPerM = 1e4;

double smooth(double share) {
  const double s = std::clamp(share, 0.0, 1.0);
  return 0.5 - 0.5 * std::cos(std::numbers::pi * s);
}

}  // namespace

/// Along straight ways with a stop at each corner, from the place where the tool is.
std::vector<AnsweredPlace> Tour::along(MofcSide& mofc, const std::vector<Vector3>& corners) {
  static_cast<void>(mofc.take_trace());
  Vector3 from = at_m_;
  for (const Vector3& to : corners) {
    mofc.follow([&](double t_s) { return Vector3(from + smooth(t_s / kPress_s) * (to - from)); },
                kPress_s);
    from = to;
  }
  at_m_ = from;
  return noted(mofc);
}

/// Round, across the direction of the press, back to where it began.
std::vector<AnsweredPlace> Tour::circle(MofcSide& mofc, const Vector3& x_m, const Vector3& y_m) {
  mofc.follow(
      [&](double t_s) {
        const double angle = 2.0 * std::numbers::pi * smooth(t_s / 0.5);
        return Vector3(press_m_ + (std::cos(angle) - 1.0) * x_m + std::sin(angle) * y_m);
      },
      0.6);
  return noted(mofc);
}

std::vector<AnsweredPlace> Tour::noted(MofcSide& mofc) {
  std::vector<AnsweredPlace> trace = mofc.take_trace();
  for (std::size_t i = 1; i < trace.size(); ++i) note_jump(trace[i - 1], trace[i]);
  models_.add(trace);
  return trace;
}

void Tour::take(MofcSide& mofc) {
  const Vector3& clear = clear_m_;
  const Vector3& press = press_m_;
  const Vector3 axis = (press - clear).normalized();
  const Vector3 x = kCircleRadius_m * axis.unitOrthogonal();
  const Vector3 y = axis.cross(x);
  at_m_ = clear;
  loops_.push_back({"pressing and leaving", along(mofc, {press, clear, press, clear})});
  loops_.push_back({"pressing, sliding and leaving",
                    along(mofc, {press, press - 2.0 * x, clear - 2.0 * x, clear}), true});
  loops_.push_back({"the same the other way round",
                    along(mofc, {clear - 2.0 * x, press - 2.0 * x, press, clear}), true});
  static_cast<void>(along(mofc, {press}));
  mofc.follow([&](double) { return press; }, 0.1);
  static_cast<void>(mofc.take_trace());
  loops_.push_back({"circling in the tissue", circle(mofc, x, y)});
  loops_.push_back({"circling the other way round", circle(mofc, x, -y)});
}

void Tour::leave(MofcSide& mofc) {
  static_cast<void>(along(mofc, {clear_m_}));
  mofc.follow([this](double) { return clear_m_; }, 0.1);
}

void Tour::note_jump(const AnsweredPlace& before, const AnsweredPlace& now) {
  const double jump = (now.force_newton - before.force_newton).norm();
  const double moved = (now.position_m - before.position_m).norm();
  if (jump <= kJumpNewton + kJumpNewtonPerM * moved || jump <= worst_jump_newton_) return;
  worst_jump_newton_ = jump;
  worst_jump_m_ = moved;
}

}  // namespace palpate
