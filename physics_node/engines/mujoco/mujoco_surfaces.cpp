// SPDX-License-Identifier: Apache-2.0
#include "physics_node/engines/mujoco/mujoco_surfaces.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

namespace palpate::engines {
namespace {

using Eigen::Vector3d;
using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr int kAround = 24;           // vertices of a circle
constexpr int kArc = 6;               // rings from the equator to a pole
constexpr double kUnbounded_m = 0.1;  // half width of a plane without a size

/// Row `index` of one of MuJoCo's arrays of vectors.
template <class Number>
Vector3d vector(const Number* array, int index) {
  using Row = Eigen::Matrix<Number, 3, 1>;
  return Eigen::Map<const Row>(array + std::ptrdiff_t{3} * index).template cast<double>();
}

/// Moves the vertices of a closed surface outwards.
void inflate(std::vector<Vector3d>& vertices_m, const std::vector<std::uint32_t>& triangles,
             double distance_m) {
  std::vector<Vector3d> normals(vertices_m.size(), Vector3d::Zero());
  for (std::size_t i = 0; i < triangles.size(); i += 3) {
    const Vector3d& a = vertices_m[triangles[i]];
    const Vector3d area =
        (vertices_m[triangles[i + 1]] - a).cross(vertices_m[triangles[i + 2]] - a);
    for (std::size_t j = i; j < i + 3; ++j) normals[triangles[j]] += area;
  }
  for (std::size_t i = 0; i < vertices_m.size(); ++i) {
    vertices_m[i] += distance_m * normals[i].normalized();
  }
}

/// A geom in its own frame.
struct Body {
  std::vector<Vector3d> vertices_m;
  std::vector<std::uint32_t> triangles;
};

/// A profile of (radius, z) turned around z, from the lower end to the upper one.
Body turned(const std::vector<std::pair<double, double>>& profile) {
  Body body;
  for (const auto& [radius_m, z_m] : profile) {
    for (int i = 0; i < kAround; ++i) {
      const double angle_rad = 2.0 * M_PI * i / kAround;
      body.vertices_m.emplace_back(radius_m * std::cos(angle_rad), radius_m * std::sin(angle_rad),
                                   z_m);
    }
  }
  for (std::uint32_t ring = 0; ring + 1 < profile.size(); ++ring) {
    for (std::uint32_t i = 0; i < kAround; ++i) {
      const std::uint32_t a = ring * kAround + i;
      const std::uint32_t b = ring * kAround + (i + 1) % kAround;
      body.triangles.insert(body.triangles.end(), {a, b, b + kAround, a, b + kAround, a + kAround});
    }
  }
  return body;
}

/// A sphere cut at its equator, the halves moved apart by 2 half lengths.
Body capsule(double radius_m, double half_length_m) {
  std::vector<std::pair<double, double>> profile;
  for (int i = -kArc; i <= kArc; ++i) {
    const double angle_rad = 0.5 * M_PI * i / kArc;
    const double z_m = radius_m * std::sin(angle_rad);
    if (i <= 0) profile.emplace_back(radius_m * std::cos(angle_rad), z_m - half_length_m);
    if (i >= 0) profile.emplace_back(radius_m * std::cos(angle_rad), z_m + half_length_m);
  }
  return turned(profile);
}

Body box(const Vector3d& half_m) {
  Body body;
  for (int i = 0; i < 8; ++i) {
    body.vertices_m.emplace_back((i & 1) != 0 ? half_m.x() : -half_m.x(),
                                 (i & 2) != 0 ? half_m.y() : -half_m.y(),
                                 (i & 4) != 0 ? half_m.z() : -half_m.z());
  }
  body.triangles = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                    2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  return body;
}

Body plane(double x_m, double y_m) {
  return {.vertices_m = {{-x_m, -y_m, 0.0}, {x_m, -y_m, 0.0}, {x_m, y_m, 0.0}, {-x_m, y_m, 0.0}},
          .triangles = {0, 1, 2, 0, 2, 3}};
}

Body mesh(const mjModel& model, int id) {
  Body body;
  const float* const vertices = model.mesh_vert + std::ptrdiff_t{3} * model.mesh_vertadr[id];
  for (int i = 0; i < model.mesh_vertnum[id]; ++i) {
    body.vertices_m.push_back(vector(vertices, i));
  }
  const int* const face = model.mesh_face + std::ptrdiff_t{3} * model.mesh_faceadr[id];
  body.triangles.assign(face, face + std::ptrdiff_t{3} * model.mesh_facenum[id]);
  return body;
}

/// Empty for kinds that are not drawn (height fields).
Body body_of(const mjModel& model, int geom) {
  const Vector3d size = vector(model.geom_size, geom);
  switch (model.geom_type[geom]) {
    case mjGEOM_PLANE:
      return plane(size.x() > 0.0 ? size.x() : kUnbounded_m,
                   size.y() > 0.0 ? size.y() : kUnbounded_m);
    case mjGEOM_SPHERE:
      return capsule(size.x(), 0.0);
    case mjGEOM_CAPSULE:
      return capsule(size.x(), size.y());
    case mjGEOM_CYLINDER:
      return turned(
          {{0.0, -size.y()}, {size.x(), -size.y()}, {size.x(), size.y()}, {0.0, size.y()}});
    case mjGEOM_ELLIPSOID: {
      Body body = capsule(1.0, 0.0);
      for (Vector3d& vertex : body.vertices_m) vertex = vertex.cwiseProduct(size);
      return body;
    }
    case mjGEOM_BOX:
      return box(size);
    case mjGEOM_MESH:
      return mesh(model, model.geom_dataid[geom]);
    default:
      return {};
  }
}

std::string name_of(const mjModel& model, mjtObj kind, int id, const std::string& otherwise) {
  const char* const name = mj_id2name(&model, kind, id);
  return name != nullptr && *name != '\0' ? name : otherwise + std::to_string(id);
}

/// Whether each body moves a skin.
std::vector<bool> skinned_bodies(const mjModel& model) {
  std::vector<bool> is_skinned(static_cast<std::size_t>(model.nbody), false);
  for (int bone = 0; bone < model.nskinbone; ++bone) {
    is_skinned[static_cast<std::size_t>(model.skin_bonebodyid[bone])] = true;
  }
  return is_skinned;
}

void write(const std::vector<Vector3d>& vertices_m, const Vector3d& position_m,
           const Eigen::Matrix3d& rotation, std::vector<float>& out_m) {
  out_m.clear();
  for (const Vector3d& vertex : vertices_m) {
    const Eigen::Vector3f at = (position_m + rotation * vertex).cast<float>();
    out_m.insert(out_m.end(), {at.x(), at.y(), at.z()});
  }
}

}  // namespace

MujocoSurfaces::MujocoSurfaces(const mjModel& model, const mjData& data,
                               const std::function<bool(int)>& is_hidden)
    : model_(model) {
  for (int skin = 0; skin < model_.nskin; ++skin) add_skin(data, skin);
  const std::vector<bool> is_skinned = skinned_bodies(model_);
  for (int geom = 0; geom < model_.ngeom; ++geom) {
    const auto body = static_cast<std::size_t>(model_.geom_bodyid[geom]);
    if (!is_hidden(geom) && !is_skinned[body]) add_geom(data, geom);
  }
}

void MujocoSurfaces::add_skin(const mjData& data, int skin) {
  sdk::Surface& surface = at_rest_.emplace_back();
  surface.name = name_of(model_, mjOBJ_SKIN, skin, "skin");
  const int* const face = model_.skin_face + std::ptrdiff_t{3} * model_.skin_faceadr[skin];
  surface.triangles.assign(face, face + std::ptrdiff_t{3} * model_.skin_facenum[skin]);
  read_skin(data, skin, surface.vertices_m);
}

void MujocoSurfaces::add_geom(const mjData& data, int geom) {
  Body body = body_of(model_, geom);
  if (body.vertices_m.empty()) return;
  sdk::Surface& surface = at_rest_.emplace_back();
  surface.name = name_of(model_, mjOBJ_GEOM, geom, "geom");
  surface.triangles = std::move(body.triangles);
  Geom& shown = geoms_.emplace_back();
  shown.id = geom;
  shown.vertices_m = std::move(body.vertices_m);
  shown.position_m = vector(data.geom_xpos, geom);
  shown.rotation = Eigen::Map<const RowMajor>(data.geom_xmat + std::ptrdiff_t{9} * geom);
  write(shown.vertices_m, shown.position_m, shown.rotation, surface.vertices_m);
}

void MujocoSurfaces::read_skin(const mjData& data, int skin, std::vector<float>& vertices_m) const {
  const float* const at_bind = model_.skin_vert + std::ptrdiff_t{3} * model_.skin_vertadr[skin];
  const auto count = static_cast<std::size_t>(model_.skin_vertnum[skin]);
  std::vector<Vector3d> vertices(count, Vector3d::Zero());
  for (int i = 0; i < model_.skin_bonenum[skin]; ++i) {
    const int bone = model_.skin_boneadr[skin] + i;
    const int body = model_.skin_bonebodyid[bone];
    const float* const quaternion = model_.skin_bonebindquat + std::ptrdiff_t{4} * bone;
    const Eigen::Quaterniond bind(quaternion[0], quaternion[1], quaternion[2], quaternion[3]);
    const Vector3d bind_m = vector(model_.skin_bonebindpos, bone);
    const Eigen::Matrix3d rotation =
        Eigen::Map<const RowMajor>(data.xmat + std::ptrdiff_t{9} * body) *
        bind.conjugate().toRotationMatrix();
    const Vector3d position_m = vector(data.xpos, body);
    const int first = model_.skin_bonevertadr[bone];
    for (int j = first; j < first + model_.skin_bonevertnum[bone]; ++j) {
      const int id = model_.skin_bonevertid[j];
      vertices[static_cast<std::size_t>(id)] +=
          model_.skin_bonevertweight[j] * (position_m + rotation * (vector(at_bind, id) - bind_m));
    }
  }
  inflate(vertices, at_rest_[static_cast<std::size_t>(skin)].triangles, model_.skin_inflate[skin]);
  write(vertices, Vector3d::Zero(), Eigen::Matrix3d::Identity(), vertices_m);
}

bool MujocoSurfaces::update(const mjData& data, std::size_t surface,
                            std::vector<float>& vertices_m) {
  const auto skins = static_cast<std::size_t>(model_.nskin);
  if (surface < skins) {
    read_skin(data, static_cast<int>(surface), vertices_m);
    return true;
  }
  Geom& shown = geoms_[surface - skins];
  const Vector3d position_m = vector(data.geom_xpos, shown.id);
  const Eigen::Matrix3d rotation =
      Eigen::Map<const RowMajor>(data.geom_xmat + std::ptrdiff_t{9} * shown.id);
  if (position_m == shown.position_m && rotation == shown.rotation) return false;
  shown.position_m = position_m;
  shown.rotation = rotation;
  write(shown.vertices_m, position_m, rotation, vertices_m);
  return true;
}

}  // namespace palpate::engines
