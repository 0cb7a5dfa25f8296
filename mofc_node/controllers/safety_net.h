// SPDX-License-Identifier: Apache-2.0
/// @file
/// safety_net.h — any controller with mode guard behind it.
#pragma once

#include <memory>
#include <utility>

#include "guard_mofc.h"

namespace palpate::controllers {

/// What the inner controller answers is the force that `guard` limits. The guarantee of `guard`
/// holds whatever the inner controller does; a force that is not finite counts as none.
class SafetyNet final : public ForceController {
 public:
  /// @param inner  not nullptr   @param parameters  of guard
  SafetyNet(std::unique_ptr<ForceController> inner, const GuardParameters& parameters)
      : inner_(std::move(inner)), guard_(parameters) {}
  void reset() noexcept override {
    inner_->reset();
    guard_.reset();
  }
  /// Bound, credit and lease are those of guard; the wave is that of the inner controller.
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override {
    const ControlOutput inner = inner_->step(input);
    ControlInput requested = input;
    requested.requested_force_on_hand_newton = inner.force_on_hand_newton.allFinite()
                                                   ? inner.force_on_hand_newton
                                                   : Vector3(Vector3::Zero());
    ControlOutput output = guard_.step(requested);
    output.sent_wave = inner.sent_wave;
    output.is_clamped = output.force_on_hand_newton != input.requested_force_on_hand_newton;
    return output;
  }

 private:
  std::unique_ptr<ForceController> inner_;
  GuardMofc guard_;
};

}  // namespace palpate::controllers
