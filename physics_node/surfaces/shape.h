// SPDX-License-Identifier: Apache-2.0
// shape.h — the surface of one tissue at its place in the scene: a formula, or loaded from a file.
#pragma once

#include <memory>
#include <optional>
#include <utility>
#include <variant>

#include "common/contact/bounds.h"
#include "common/contact/surface.h"
#include "common/core/vector.h"
#include "common/session/scene_config.h"
#include "physics_node/surfaces/file_surface.h"

namespace palpate::physics {

/// A surface from a file at its place in W.
struct PlacedSurface {
  std::shared_ptr<const FileSurface> surface;
  Vector3 position_m = Vector3::Zero();
  Quaternion rotation = Quaternion::Identity();
};

/// In W, before any motion of the tissue.
class Shape final : public Surface {
 public:
  using Form =
      std::variant<HalfSpaceGeometry, SphereGeometry, BoxGeometry, CapsuleGeometry, PlacedSurface>;

  explicit Shape(Form form) : form_(std::move(form)) {}

  [[nodiscard]] SurfaceView view(const Vector3& point_m, SurfaceHint& hint) const noexcept override;
  using Surface::view;
  [[nodiscard]] bool is_sheet() const noexcept override;

  /// None for a half-space.
  [[nodiscard]] std::optional<Bounds> bounds() const noexcept;
  /// The surface from a file; nullptr if the shape is a formula.
  [[nodiscard]] const FileSurface* file_surface() const noexcept;

  [[nodiscard]] const Form& form() const noexcept { return form_; }

 private:
  Form form_;
};

}  // namespace palpate::physics
