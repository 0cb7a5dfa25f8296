// paper_mofc.h — the controller as published: one axis, one pool, three times.
#pragma once

#include "mofc_node/controllers/force_controller.h"
#include "mofc_node/controllers/mofc_equations.h"

namespace palpate::controllers {

/// Mode `paper`. Each axis has its own E′ and clamps alone, [MOFC] eqs. (4)–(14).
///
/// What it does not promise: on a device whose friction is isotropic, f_co|v|, three axes that each
/// count f_co count too much; a quantised position, a late answer or a lost one is not accounted
/// for. Direction of the force is not kept. Mode `vector` mends these.
class PaperMofc final : public ForceController {
 public:
  explicit PaperMofc(const MofcParameters& parameters) : p_(parameters) {}
  void reset() noexcept override;
  [[nodiscard]] ControlOutput step(const ControlInput& input) noexcept override;

 private:
  MofcParameters p_;
  Vector3 energy_joule_ = Vector3::Zero();  // E′ per axis
  Vector3 position_m_ = Vector3::Zero();    // where the last stretch ended
  bool has_position_ = false;
};

}  // namespace palpate::controllers
