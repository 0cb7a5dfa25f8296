// SPDX-License-Identifier: Apache-2.0
#include "physics_node/engines/bullet/soft_block.h"

#include <BulletSoftBody/btSoftBodyHelpers.h>

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

namespace palpate::engines {
namespace {

// A cube in five tetrahedra; corner i lies at (i & 1, i & 2, i & 4).
constexpr std::array<std::array<std::size_t, 4>, 5> kCube{
    {{1, 2, 4, 7}, {0, 1, 2, 4}, {3, 1, 7, 2}, {5, 1, 4, 7}, {6, 2, 7, 4}}};

void add_tetrahedron(btSoftBody& body, std::array<int, 4> nodes) {
  const auto at = [&](std::size_t i) { return body.m_nodes[nodes.at(i)].m_x; };
  if ((at(1) - at(0)).cross(at(2) - at(0)).dot(at(3) - at(0)) < 0) std::swap(nodes[2], nodes[3]);
  body.appendTetra(nodes[0], nodes[1], nodes[2], nodes[3]);
  // without links the search tree of the nodes is never finished; they carry no force
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = i + 1; j < 4; ++j) {
      body.appendLink(nodes.at(i), nodes.at(j), nullptr, true);
    }
  }
}

}  // namespace

std::unique_ptr<btSoftBody> soft_block(btSoftBodyWorldInfo& world, const BlockSize& size,
                                       double density_kg_per_m3) {
  const int across = size.cells_across + 1;  // nodes
  const double half_m = 0.5 * size.cells_across * size.cell_m;
  const double depth_m = size.cells_deep * size.cell_m;
  std::vector<btVector3> nodes;
  for (int z = 0; z <= size.cells_deep; ++z) {
    for (int y = 0; y < across; ++y) {
      for (int x = 0; x < across; ++x) {
        nodes.emplace_back(static_cast<btScalar>(x * size.cell_m - half_m),
                           static_cast<btScalar>(y * size.cell_m - half_m),
                           static_cast<btScalar>(z * size.cell_m - depth_m));
      }
    }
  }
  auto body =
      std::make_unique<btSoftBody>(&world, static_cast<int>(nodes.size()), nodes.data(), nullptr);
  for (int z = 0; z < size.cells_deep; ++z) {
    for (int y = 0; y < size.cells_across; ++y) {
      for (int x = 0; x < size.cells_across; ++x) {
        // neighbours are mirrored, so that their faces match
        const int mirror = (x + y + z) % 2;
        const auto node = [&](std::size_t corner) {
          const int i = static_cast<int>(corner);
          return ((z + i / 4) * across + y + i / 2 % 2) * across + x + (i % 2 + mirror) % 2;
        };
        for (const std::array<std::size_t, 4>& corners : kCube) {
          add_tetrahedron(*body,
                          {node(corners[0]), node(corners[1]), node(corners[2]), node(corners[3])});
        }
      }
    }
  }
  btSoftBodyHelpers::generateBoundaryFaces(body.get());
  body->initializeDmInverse();
  const btMatrix3x3 identity = btMatrix3x3::getIdentity();
  const btSoftBody::TetraScratch rest{identity, 3, 1, identity, identity};
  body->m_tetraScratches.resize(body->m_tetras.size(), rest);
  body->m_tetraScratchesTn.resize(body->m_tetras.size(), rest);
  body->setTotalMass(static_cast<btScalar>(density_kg_per_m3 * 4.0 * half_m * half_m * depth_m));
  for (int i = 0; i < across * across; ++i) body->setMass(i, 0);  // fixed
  return body;
}

}  // namespace palpate::engines
