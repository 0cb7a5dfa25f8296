// SPDX-License-Identifier: Apache-2.0
// Deformed meshes in whole steps, as an audience gets them.
#include "viewer_node/audience/mesh_steps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "common/core/random.h"

namespace palpate::viewer {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr double kStep_m = kDetailSteps_m.front();

SceneState flat_scene(std::size_t vertices) {
  SceneState scene;
  scene.header.session_id = 5;
  scene.revision = 3;
  scene.tissues.resize(1);
  scene.tissues[0].mesh.vertices_m.resize(3 * vertices);
  return scene;
}

/// What a client makes of it.
std::vector<float> rebuilt_vertices_m(const SceneState& scene, const MeshSteps& steps) {
  std::vector<float> vertices_m = scene.tissues[0].mesh.vertices_m;
  for (const MeshSteps::Tissue& tissue : steps.tissues) {
    std::size_t at = 0;
    std::size_t next = 0;
    for (std::size_t run = 0; run < tissue.runs.size(); ++run) {
      for (std::size_t i = 0; i < 3 * std::size_t{tissue.runs[run]}; ++i, ++at) {
        if (run % 2 == 0) continue;
        vertices_m[at] += static_cast<float>(steps.step_m * tissue.displacement_steps[next++]);
      }
    }
  }
  return vertices_m;
}

// A dent of 20 000 vertices, up to 8 mm deep: the largest error of a coordinate is half a step, and
// the rounding of float at 0.3 m, 15 nm.
TEST(MeshSteps, ErrByHalfAStepAtMost) {
  constexpr std::size_t kVertices = 20'000;
  SceneState scene = flat_scene(kVertices);
  Random random(1);
  for (float& x_m : scene.tissues[0].mesh.vertices_m) {
    x_m = static_cast<float>(random.uniform(-0.3, 0.3));
  }
  MeshFrame frame;
  frame.vertices_m = scene.tissues[0].mesh.vertices_m;
  for (float& x_m : frame.vertices_m) x_m += static_cast<float>(random.uniform(-0.008, 0.008));

  for (const double step_m : kDetailSteps_m) {
    const MeshSteps steps = mesh_steps(scene, std::array{frame}, step_m);
    const std::vector<float> vertices_m = rebuilt_vertices_m(scene, steps);
    double largest_m = 0.0;
    for (std::size_t i = 0; i < vertices_m.size(); ++i) {
      const double error_m =
          static_cast<double>(vertices_m[i]) - static_cast<double>(frame.vertices_m[i]);
      largest_m = std::max(largest_m, std::abs(error_m));
    }
    std::printf("step %.2f mm: largest error of a coordinate %.5f mm, %zu bytes\n", 1e3 * step_m,
                1e3 * largest_m, encode_mesh_steps(steps).size());
    EXPECT_LE(largest_m, 0.5 * step_m + 60e-9);
    EXPECT_GE(largest_m, 0.49 * step_m);  // the test does reach the bound
  }
}

TEST(MeshSteps, HoldTheDisplacedVerticesOnly) {
  const SceneState scene = flat_scene(20'000);
  MeshFrame frame;
  frame.vertices_m = scene.tissues[0].mesh.vertices_m;
  frame.vertices_m[3 * 700 + 2] = -0.001F;
  frame.vertices_m[3 * 701] = 0.0004F;
  frame.vertices_m[3 * 900 + 1] = 0.00002F;  // less than half a step

  const MeshSteps steps = mesh_steps(scene, std::array{frame}, kStep_m);
  EXPECT_EQ(steps.session_id, 5u);
  EXPECT_EQ(steps.scene_revision, 3u);
  ASSERT_THAT(steps.tissues, SizeIs(1));
  EXPECT_THAT(steps.tissues[0].runs, ElementsAre(700, 2));
  EXPECT_THAT(steps.tissues[0].displacement_steps, ElementsAre(0, 0, -20, 8, 0, 0));
  EXPECT_LT(encode_mesh_steps(steps).size(), 60u);
}

TEST(MeshSteps, HoldTheMotionOfAWholeTissue) {
  const SceneState scene = flat_scene(10);
  MeshFrame frame;
  frame.displacement_world_m = {0.01, 0.0, -0.002};
  const MeshSteps steps = mesh_steps(scene, std::array{frame}, kStep_m);
  ASSERT_THAT(steps.tissues, SizeIs(1));
  EXPECT_THAT(steps.tissues[0].runs, IsEmpty());
  EXPECT_THAT(steps.tissues[0].offset_steps, ElementsAre(200, 0, -40));

  frame.displacement_world_m.setZero();
  EXPECT_THAT(mesh_steps(scene, std::array{frame}, kStep_m).tissues, IsEmpty());
}

}  // namespace
}  // namespace palpate::viewer
