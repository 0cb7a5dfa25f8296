// SPDX-License-Identifier: Apache-2.0
#include "physics_node/surfaces/triangle_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "common/core/check.h"

namespace palpate::physics {
namespace {

constexpr std::size_t kLeafTriangles = 4;
// Largest distance of the description from the facets, and the least angle that counts.
constexpr double kTrustedError = 1e-4;
constexpr double kLeastSine = 1e-9;
// A triangle flatter than this has no area: height over longest edge.
constexpr double kThinnestTriangle = 1e-7;

using Edge = std::pair<std::uint32_t, std::uint32_t>;

/// An edge in the direction in which a triangle traverses it, and the triangle.
struct DirectedEdge {
  Edge sorted;
  bool is_upwards = false;  // from the lower vertex to the higher one
  std::uint32_t triangle = 0;
  std::uint8_t side = 0;
};

std::vector<DirectedEdge> sorted_edges(const TriangleMesh& mesh) {
  std::vector<DirectedEdge> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::uint8_t side = 0; side < 3; ++side) {
      const std::uint32_t a = mesh.triangles[t][side];
      const std::uint32_t b = mesh.triangles[t][(side + 1U) % 3U];
      edges.push_back({{std::min(a, b), std::max(a, b)}, a < b, t, side});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const DirectedEdge& a, const DirectedEdge& b) {
    return a.sorted != b.sorted ? a.sorted < b.sorted : a.triangle < b.triangle;
  });
  return edges;
}

/// Calls visit(first, count) for each run of equal edges.
template <class Visit>
void visit_edges(const std::vector<DirectedEdge>& edges, const Visit& visit) {
  for (std::size_t begin = 0, end = 0; begin < edges.size(); begin = end) {
    while (end < edges.size() && edges[end].sorted == edges[begin].sorted) ++end;
    visit(begin, end - begin);
  }
}

}  // namespace

double enclosed_volume_m3(const TriangleMesh& mesh) {
  double six_volumes = 0.0;
  const Vector3 from = mesh.vertices_m.empty() ? Vector3::Zero() : mesh.vertices_m[0];
  for (const auto& [a, b, c] : mesh.triangles) {
    six_volumes += (mesh.vertices_m[a] - from)
                       .dot((mesh.vertices_m[b] - from).cross(mesh.vertices_m[c] - from));
  }
  return six_volumes / 6.0;
}

std::string complaint_about(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) return "has no triangles";
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Vector3 ab = mesh.vertices_m[b] - mesh.vertices_m[a];
    const Vector3 ac = mesh.vertices_m[c] - mesh.vertices_m[a];
    const double longest2 = std::max({ab.squaredNorm(), ac.squaredNorm(), (ac - ab).squaredNorm()});
    if (!(ab.cross(ac).norm() > kThinnestTriangle * longest2)) {
      return "triangle " + std::to_string(t + 1) +
             ": its corners lie on a line; remove it or repair the mesh";
    }
  }

  std::string complaint;
  bool is_closed = true;
  const std::vector<DirectedEdge> edges = sorted_edges(mesh);
  visit_edges(edges, [&](std::size_t first, std::size_t count) {
    is_closed = is_closed && count == 2;
    if (!complaint.empty() || count == 1) return;
    const std::string triangles = "triangles " + std::to_string(edges[first].triangle + 1) +
                                  " and " + std::to_string(edges[first + 1].triangle + 1);
    if (count > 2) {
      complaint = triangles + " and more share one edge; there is no inside there, repair the mesh";
    } else if (edges[first].is_upwards == edges[first + 1].is_upwards) {
      complaint =
          triangles + " face opposite sides; make all triangles counter-clockwise from outside";
    }
  });
  if (complaint.empty() && is_closed && enclosed_volume_m3(mesh) <= 0.0) {
    complaint = "its triangles face inwards; make them counter-clockwise, seen from outside";
  }
  return complaint;
}

TriangleSurface::TriangleSurface(TriangleMesh mesh) : mesh_(std::move(mesh)) {
  PALPATE_REQUIRE(!mesh_.triangles.empty());

  // neighbours in space become neighbours in memory
  std::vector<BoxTree::Item> items(mesh_.triangles.size());
  for (std::uint32_t t = 0; t < items.size(); ++t) {
    const auto& [a, b, c] = mesh_.triangles[t];
    const std::array<Vector3, 3> corners{mesh_.vertices_m[a], mesh_.vertices_m[b],
                                         mesh_.vertices_m[c]};
    items[t] = {palpate::bounds_of(corners), corners[0] + corners[1] + corners[2], t};
  }
  tree_ = BoxTree(std::move(items), kLeafTriangles);
  std::vector<std::array<std::uint32_t, 3>> triangles;
  triangles.reserve(mesh_.triangles.size());
  for (const std::uint32_t t : tree_.order()) triangles.push_back(mesh_.triangles[t]);
  mesh_.triangles = std::move(triangles);
  tree_.forget_order();

  // normals of faces; of corners, weighted by the face's angle there; of edges
  vertex_normals_.assign(mesh_.vertices_m.size(), Vector3::Zero());
  for (const auto& triangle : mesh_.triangles) {
    const auto corner = [&](std::size_t i) { return mesh_.vertices_m[triangle[i % 3]]; };
    const Vector3 normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
    face_normals_.push_back(normal);
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector3 to_next = (corner(i + 1) - corner(i)).normalized();
      const Vector3 to_last = (corner(i + 2) - corner(i)).normalized();
      vertex_normals_[triangle[i]] +=
          std::acos(std::clamp(to_next.dot(to_last), -1.0, 1.0)) * normal;
    }
  }
  edge_normals_.resize(mesh_.triangles.size());
  is_closed_ = true;
  const std::vector<DirectedEdge> edges = sorted_edges(mesh_);
  visit_edges(edges, [&](std::size_t first, std::size_t count) {
    is_closed_ = is_closed_ && count == 2;
    Vector3 sum = Vector3::Zero();
    for (std::size_t i = first; i < first + count; ++i) sum += face_normals_[edges[i].triangle];
    for (std::size_t i = first; i < first + count; ++i) {
      edge_normals_[edges[i].triangle][edges[i].side] = sum;
    }
  });
}

// At t past an edge, a neighbour at the angle θ is t sin θ away from the facet's plane. An edge or
// a corner seen at the distance d is round with the radius d: t²/2d away from the plane that may
// follow.
double TriangleSurface::trust_radius_m(const Foot& foot, const Vector3& point_m) const noexcept {
  const auto& triangle = mesh_.triangles[foot.triangle];
  const Vector3& n = face_normals_[foot.triangle];
  const auto corner = [&](std::size_t i) -> const Vector3& {
    return mesh_.vertices_m[triangle[i % 3]];
  };
  double longest2 = 0.0;
  for (std::size_t i = 0; i < 3; ++i) {
    longest2 = std::max(longest2, (corner(i + 1) - corner(i)).squaredNorm());
  }
  const double twice_area = (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm();
  const double altitude_m = twice_area / std::sqrt(longest2);
  if (foot.edge >= 0 || foot.corner >= 0) {
    const double radius_m = std::sqrt(foot.squared_distance);
    return std::clamp(std::min(altitude_m, std::sqrt(2.0 * radius_m * kTrustedError)),
                      kMinTrustRadiusM, kMaxTrustRadiusM);
  }

  double trust_m = kMaxTrustRadiusM;
  double to_nearest_edge_m = kMaxTrustRadiusM;
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector3 along = (corner(i + 1) - corner(i)).normalized();
    const Vector3 inwards = n.cross(along);
    const double to_edge_m = std::abs(inwards.dot(foot.point_m - corner(i)));
    to_nearest_edge_m = std::min(to_nearest_edge_m, to_edge_m);

    // the neighbour becomes the nearer facet at the edge, and on the concave side at the plane that
    // halves the angle
    const Vector3& sum = edge_normals_[foot.triangle][i];
    const Vector3 neighbor = sum - n;
    const double sine = n.dot(neighbor) > 0.0 ? n.cross(neighbor).norm() : 1.0;
    double to_neighbor_m = to_edge_m;
    const double length = sum.norm();
    if (inwards.dot(neighbor) * n.dot(point_m - foot.point_m) > 0.0 && length > 0.0) {
      to_neighbor_m =
          std::min(to_neighbor_m, std::abs(along.cross(sum).dot(point_m - corner(i))) / length);
    }
    trust_m = std::min(trust_m, to_neighbor_m + kTrustedError / std::max(sine, kLeastSine));
  }
  trust_m = std::min(trust_m, to_nearest_edge_m + altitude_m);
  return std::clamp(trust_m, kMinTrustRadiusM, kMaxTrustRadiusM);
}

SurfaceView TriangleSurface::view(const Vector3& point_m, SurfaceHint& hint) const noexcept {
  SurfaceView view;
  view.distance_m = std::numeric_limits<double>::infinity();

  // the hinted triangle bounds the search; of equally near ones the first counts, whatever the hint
  Foot best;
  best.squared_distance = std::numeric_limits<double>::max();
  const auto offer = [&](std::uint32_t triangle) {
    const auto& [a, b, c] = mesh_.triangles[triangle];
    const Foot foot{
        foot_on_facet(mesh_.vertices_m[a], mesh_.vertices_m[b], mesh_.vertices_m[c], point_m),
        triangle};
    if (foot.squared_distance < best.squared_distance ||
        (foot.squared_distance == best.squared_distance && triangle < best.triangle)) {
      best = foot;
    }
    return best.squared_distance;
  };
  if (hint.cell < mesh_.triangles.size()) offer(hint.cell);
  tree_.visit_nearest(point_m, best.squared_distance, offer);
  if (!(best.squared_distance < std::numeric_limits<double>::max())) return view;
  hint.cell = best.triangle;

  // which side
  const auto triangle = mesh_.triangles[best.triangle];
  Vector3 side = face_normals_[best.triangle];
  if (best.corner >= 0) side = vertex_normals_[triangle[static_cast<std::size_t>(best.corner)]];
  if (best.edge >= 0) {
    side = edge_normals_[best.triangle][static_cast<std::size_t>(best.edge)];
  }
  Vector3 along = Vector3::Zero();
  if (best.edge >= 0) {
    const auto from = static_cast<std::size_t>(best.edge);
    along = (mesh_.vertices_m[triangle[(from + 1) % 3]] - mesh_.vertices_m[triangle[from]])
                .normalized();
  }
  view = view_of_facet(best, side, face_normals_[best.triangle], along, point_m);
  view.trust_radius_m = trust_radius_m(best, point_m);
  return view;
}

std::size_t TriangleSurface::bytes() const noexcept {
  return mesh_.vertices_m.capacity() * sizeof(Vector3) +
         mesh_.triangles.capacity() * sizeof(mesh_.triangles[0]) +
         face_normals_.capacity() * sizeof(Vector3) +
         edge_normals_.capacity() * sizeof(edge_normals_[0]) +
         vertex_normals_.capacity() * sizeof(Vector3) + tree_.bytes();
}

}  // namespace palpate::physics
