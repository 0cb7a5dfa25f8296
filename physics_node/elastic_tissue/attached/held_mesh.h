// SPDX-License-Identifier: Apache-2.0
// held_mesh.h — the mesh of an elastic tissue in W, and what holds it: fixed nodes, springs to
// places that stand still, springs to other elastic tissues.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/core/vector.h"
#include "common/session/scene_config.h"
#include "physics_node/elastic/body.h"
#include "physics_node/surfaces/tetrahedral_mesh.h"

namespace palpate::physics {

/// The surface of another elastic tissue as the session places it, W.
struct TiedSurface {
  std::uint32_t tissue = 0;  ///< index in the scene
  double young_pa = 0.0;
  std::vector<Vector3> nodes_m = {};
  std::vector<std::array<std::uint32_t, 3>> triangles = {};  ///< between nodes of its mesh
};

/// Where a node is tied to another body.
struct TiedPlace {
  std::uint32_t tissue = 0;  ///< index in the scene
  std::array<std::uint32_t, 3> triangle{};
  Vector3 weights = Vector3::Zero();
  Vector3 offset_m = Vector3::Zero();  ///< from there to the node, as the session places them
  Vector3 normal = Vector3::UnitZ();   ///< of the triangle then, out of the other body
  double area_m2 = 0.0;                ///< of its own surface that the node stands for
};

/// The mesh in W, its elements in their parts.
[[nodiscard]] elastic::Mesh mesh_of(const TetrahedralMesh& read, const FileGeometry& geometry,
                                    const ElasticMaterial& material);

/// Of an elastic tissue. Reads its file. @throws SetupError  the file cannot be used
[[nodiscard]] TiedSurface tied_surface_of(const SceneConfig& scene, std::size_t tissue);

/// A field of the session that catches nothing.
[[nodiscard]] std::string idle_place(const char* field, std::size_t index, const char* what);

/// Fixes and attaches the body, with the places to which it is tied.
/// @param others  one for each of `attached` that names a tissue, in their order
/// @return  what holds nothing, a sentence each
[[nodiscard]] std::vector<std::string> hold(const TetrahedralMesh& read,
                                            const ElasticMaterial& material,
                                            const std::vector<TiedSurface>& others,
                                            elastic::BodyDescription& body,
                                            std::vector<TiedPlace>& places);

}  // namespace palpate::physics
