// SPDX-License-Identifier: Apache-2.0
// ablated_body.h — an elastic body of which parts have been softened or have vanished, or that has
// been cut.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "physics_node/elastic/cut/separated_mesh.h"
#include "physics_node/elastic_tissue/body_compliance.h"
#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate::physics {

/// What of a body is still there in another one: indices in the first by index in the second.
struct BodyChange {
  std::vector<std::uint32_t> old_nodes = {};
  std::vector<std::int32_t> old_points = {};  ///< of the contact; −1: new
};

/// A body, its nodes and elements as indices in that of the session, ascending, and how it differs
/// from the one that it replaces. Where it is cut a node of the session's body has copies.
struct AblatedBody {
  std::shared_ptr<BodyCompliance> shared;
  std::vector<std::uint32_t> nodes = {};
  std::vector<std::uint32_t> elements = {};
  std::size_t loose = 0;      ///< elements that went with those that vanished in the last change
  elastic::CutArea cut = {};  ///< all of it
  BodyChange change = {};

  [[nodiscard]] const std::shared_ptr<const ElasticBody>& body() const noexcept {
    return shared->body();
  }
};

/// Share of the untouched surface where a tip that lies on it has an element within reach of its
/// electrode.
[[nodiscard]] double share_in_reach(const ElasticBody& body, const ElectrodeConfig& electrode,
                                    double tip_radius_m);

/// The body of the session, which nothing has changed.
[[nodiscard]] AblatedBody whole_body(std::shared_ptr<BodyCompliance> shared);

/// The body that is left of `before` when these elements have vanished, and with them what is no
/// longer held (elastic::loose_elements) or only joined along an edge (elastic::hinged_elements).
/// Deterministic. Takes up to seconds.
/// @param whole   that of the session   @param before  the present one
/// @param stages  of the elements of the session's body @see heat_stage
/// @param near    nodes of the session's body whose columns are made ahead, if they are on the
///     surface
/// @param attached  of the attachments that tear, by index: their stiffness now over the intact one
/// @param cut  faces of the session's body; those that could not be separated yet stay joined
/// @throws SetupError  nothing is left that is held, or what is left cannot be used
[[nodiscard]] std::shared_ptr<const AblatedBody> ablated_body(
    const ElasticBody& whole, const AblatedBody& before, std::span<const std::uint8_t> stages,
    double softest_ratio, std::span<const std::uint32_t> near,
    std::span<const double> attached = {}, const elastic::FaceCuts& cut = {});

}  // namespace palpate::physics
