// SPDX-License-Identifier: Apache-2.0
// mujoco_surfaces.h — the skins and geoms of a MuJoCo scene as viewers draw them.
#pragma once

#include <mujoco/mujoco.h>

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <vector>

#include "physics_node/sdk/physics.h"

namespace palpate::engines {

/// Every skin, and every geom of a body that no skin covers.
class MujocoSurfaces {
 public:
  /// @param model      must outlive it
  /// @param data       after mj_forward
  /// @param is_hidden  geoms that viewers draw already
  MujocoSurfaces(const mjModel& model, const mjData& data,
                 const std::function<bool(int)>& is_hidden);

  [[nodiscard]] const std::vector<sdk::Surface>& at_rest() const { return at_rest_; }
  /// The vertices now, in W; false for a geom at rest.
  bool update(const mjData& data, std::size_t surface, std::vector<float>& vertices_m);

 private:
  struct Geom {
    int id = 0;
    std::vector<Eigen::Vector3d> vertices_m;  // in its own frame
    Eigen::Vector3d position_m;               // when last drawn …
    Eigen::Matrix3d rotation;                 // … and how
  };
  void add_skin(const mjData& data, int skin);
  void add_geom(const mjData& data, int geom);
  /// Linear blend skinning, then inflated along the normals as the scene says.
  void read_skin(const mjData& data, int skin, std::vector<float>& vertices_m) const;

  const mjModel& model_;
  std::vector<Geom> geoms_;  // behind the skins
  std::vector<sdk::Surface> at_rest_;
};

}  // namespace palpate::engines
