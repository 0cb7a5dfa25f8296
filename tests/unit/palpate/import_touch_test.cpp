// SPDX-License-Identifier: Apache-2.0
// What a hand feels of an imported organ, as physics_node renders its session.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/session/session_file.h"
#include "deploy/palpate/import/import_site.h"
#include "deploy/palpate/import/imported_organ.h"
#include "deploy/palpate/import/organ_labels.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"
#include "physics_node/elastic_tissue/elastic_tissues.h"
#include "physics_node/files/tetrahedral_files.h"
#include "tests/property/seeds.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

constexpr double kDepth_m = 0.004;
constexpr double kAbove_m = 0.002;
constexpr double kSpeed_m_per_s = 0.02;
constexpr double kHeld_s = 0.3;
constexpr double kEnd_s = (kDepth_m + kAbove_m) / kSpeed_m_per_s + kHeld_s;

/// The organ of `palpate make-organ --labels`, imported and loaded as a session is.
class Organ {
 public:
  explicit Organ(std::size_t tetrahedra) {
    const scan::LabelMap map =
        scan::parse_nrrd(organ_labels_text({.voxel_mm = {2, 2, 2}}, false), "a.seg.nrrd");
    const ImportedOrgan organ =
        imported_organ(map, {.fixed = {"ligament"}, .tetrahedra = tetrahedra}, "a.seg.nrrd");
    const test::TempFolder folder;
    for (const auto& [name, content] : organ.files) folder.write(name, content);
    scene_ = load_session(folder.path() / kImportedSession, {}).scene;
    bodies_ = physics::elastic_bodies_of(scene_);
    surface_ = physics::surface_of(physics::parse_msh(organ.files.at(kImportedMesh), "organ.msh"));
  }

  [[nodiscard]] Vector3 tip_m(double x_m, double time_s) const {
    const double depth_m = std::min(kDepth_m, kSpeed_m_per_s * time_s - kAbove_m);
    return {x_m, 0.0, column_at(surface_, x_m, 0.0).top_m + scene_.tip_radius_m - depth_m};
  }
  /// As the session renders it: every millisecond, with a full solution at its rate.
  [[nodiscard]] double rendered_newton(double x_m) const {
    physics::ElasticTissues tissues(bodies_, 1, scene_.tip_radius_m,
                                    physics::ElasticPace::kVirtual);
    physics::SceneForce force;
    for (double time_s = 0.0; time_s < kEnd_s; time_s += 0.001) {
      force = {};
      tissues.step(0, tip_m(x_m, time_s), time_s, 0.05, force);
    }
    return force.force_on_tool_newton.z();
  }
  /// By full solutions alone.
  [[nodiscard]] double solved_newton(double x_m) const {
    constexpr double kStep_s = 0.04;
    physics::ElasticSimulation simulation(*bodies_.front(), 1, scene_.tip_radius_m, kStep_s);
    for (double time_s = 0.0; time_s < kEnd_s; time_s += kStep_s) {
      const std::vector<std::optional<physics::TipState>> tips{
          physics::TipState{.tip_m = tip_m(x_m, time_s), .place_m = tip_m(x_m, 0.0)}};
      simulation.step(tips);
    }
    return simulation.touch(0).force_on_tool_newton.z();
  }

 private:
  SceneConfig scene_;
  std::vector<std::shared_ptr<const physics::ElasticBody>> bodies_;
  physics::TriangleMesh surface_;
};

TEST(ImportedOrgan, FeelsStifferAboveItsLesionAsAFullSolutionOnAFinerMeshDoes) {
  if (test::kIsSanitized) GTEST_SKIP() << "takes too long; the code is that of the other tests";
  constexpr double kBeside_m = -0.022;  // of the lesion, whose radius is 7 mm
  const Organ session(3000);
  const Organ finer(9000);

  const double stiffer = session.rendered_newton(0.0) / session.rendered_newton(kBeside_m);
  const double reference = finer.solved_newton(0.0) / finer.solved_newton(kBeside_m);

  RecordProperty("stiffer", std::to_string(stiffer));
  RecordProperty("reference", std::to_string(reference));
  EXPECT_GT(reference, 1.0);
  EXPECT_GT(stiffer, 1.0);
  EXPECT_NEAR(stiffer / reference, 1.0, 0.05);
}

}  // namespace
}  // namespace palpate
