// SPDX-License-Identifier: Apache-2.0
// blade_sweep.h — what the edge of a blade sweeps in one elastic body: the length of it that is in
// the tissue, the force that this takes to cut, and the faces between elements that it passes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/core/vector.h"
#include "common/session/scene_config.h"
#include "physics_node/elastic/cut/separated_mesh.h"
#include "physics_node/elastic_tissue/ablation/ablation.h"
#include "physics_node/elastic_tissue/blade/blade_place.h"
#include "physics_node/elastic_tissue/jaw.h"

namespace palpate::physics {

/// How much of the straight edge is in these elements, where the untouched body has them. The
/// toughness of each piece is that of its middle.
[[nodiscard]] EdgeInTissue edge_in_tissue(const ElasticBody& whole,
                                          std::span<const std::uint32_t> elements,
                                          const ElasticMaterial::Pierced& tissue,
                                          const Vector3& from_m, const Vector3& to_m);

/// One blade in one body. Every face between two elements whose centroids lie on different sides of
/// the plane of the blade is cut when the edge passes its centroid. So the cut follows the faces
/// that are there: its area is that of a rough surface, and its projection on the plane is as large
/// as what was swept but for about half an element at its rim. One thread; allocates.
class BladeSweep {
 public:
  /// It went in. @param whole  the body of the session
  /// @param deepest_m  as far it goes in a cut of before
  void begin(std::uint32_t number, const BladePlace& place, const ElasticBody& whole,
             const std::vector<std::int32_t>& opposite, double deepest_m);
  /// It is out.
  void end() noexcept { *this = {}; }
  [[nodiscard]] std::uint32_t number() const noexcept { return number_; }

  struct Step {
    EdgeInTissue ahead;  ///< a little further than it is
    Ablation::Sweep sweep;
  };
  /// The edge is there now.
  /// @param slip_of_blade_m  past the tissue, since it went in: what of it is in its plane counts
  [[nodiscard]] Step advance(const Vector3& slip_of_blade_m, const ElasticBody& whole,
                             const AblatedBody& present, const ElasticMaterial::Pierced& tissue);

  /// Where its edge is in the untouched body.
  [[nodiscard]] Vector3 from_m() const { return place_.from_m + slip_m_; }
  [[nodiscard]] Vector3 to_m() const { return from_m() + place_.length_m * place_.along; }

 private:
  struct Crossed {         // a face between the two sides of the plane
    double ahead_m = 0.0;  // its centroid, from the edge where that went in
    double along_m = 0.0;
    double projected_m2 = 0.0;
    elastic::FaceSide side = 0;
  };
  std::uint32_t number_ = 0;
  BladePlace place_;
  std::vector<Crossed> faces_;           // by ahead_m, ascending
  std::vector<std::uint32_t> elements_;  // of the session's body, that its plane passes; ascending
  std::size_t next_ = 0;                 // of these, that the edge has not passed yet
  Vector3 slip_m_ = Vector3::Zero();
  double deepest_m_ = 0.0;
};

/// Before a step of the body, after Jaw::prepare: the blade of that tool is where its jaw says, if
/// it is in. Cuts what it has swept.
/// @param slip_m   of the blade, since it went in   @param blade  with its length
void sweep_with(const Jaw& held, const Vector3& slip_m, const GripperConfig& blade,
                const ElasticBody& whole, std::size_t tool, Ablation& ablation, BladeSweep& sweep,
                EdgeInTissue& edge);

/// How a blade yields whose edge is so far in the tissue; `law` has its direction.
void fit_blade(const ElasticMaterial::Pierced& tissue, const EdgeInTissue& edge,
               const Vector3& along, NeedleLaw& law) noexcept;

}  // namespace palpate::physics
