#include "physics_node/surfaces/subdivision.h"

#include <algorithm>
#include <map>
#include <utility>

namespace palpate::physics {

void subdivide(DirectionMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middle_of;
  const auto middle = [&](std::uint32_t a, std::uint32_t b) {
    const auto [place, is_new] =
        middle_of.emplace(std::minmax(a, b), static_cast<std::uint32_t>(mesh.directions.size()));
    if (is_new) {
      mesh.directions.push_back((mesh.directions[a] + mesh.directions[b]).normalized());
    }
    return place->second;
  };
  std::vector<std::array<std::uint32_t, 3>> finer;
  finer.reserve(4 * mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    const std::uint32_t ab = middle(a, b);
    const std::uint32_t bc = middle(b, c);
    const std::uint32_t ca = middle(c, a);
    finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
  }
  mesh.triangles = std::move(finer);
}

}  // namespace palpate::physics
