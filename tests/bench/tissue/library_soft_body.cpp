// SPDX-License-Identifier: Apache-2.0
#include <spdlog/fmt/fmt.h>
#include <unistd.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

#include "physics_node/files/tetrahedral_files.h"
#include "physics_node/library/palpate_tissue.hpp"
#include "tests/bench/tissue/soft_body.h"
#include "tests/bench/tissue/tissue_problems.h"
#include "tests/support/elastic/tetrahedra_of.h"

namespace palpate::bench {
namespace {

/// A folder of its own for the file of the mesh.
class Folder {
 public:
  Folder()
      : path_(std::filesystem::temp_directory_path() / fmt::format("tissue_bench_{}", getpid())) {
    std::filesystem::create_directories(path_);
  }
  ~Folder() {
    std::error_code ignored;  // in a temporary folder
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

tissue::Scene scene_of(const elastic::BodyDescription& description, bool is_quadratic) {
  const Folder folder;
  double top_m = 0.0;
  for (const elastic::Vector3d& node_m : description.mesh.nodes_m) {
    top_m = std::max(top_m, node_m.z());
  }
  std::ofstream(folder.path() / "body.msh")
      << physics::msh_text(test::tetrahedra_of(description.mesh));
  const bool is_hanging = !description.gravity_m_per_s2.isZero(0.0);
  const std::string held = is_hanging
                               ? fmt::format("point_m {{ z: {} }} normal {{ z: -1 }}", top_m - 1e-4)
                               : std::string("point_m { z: 1e-4 }");
  const elastic::Material& material = description.materials[0];
  return tissue::Scene::parse(
      fmt::format("scene {{ tool {{ tip_radius_m: {} }} tissue {{ name: \"body\" "
                  "tetrahedral_mesh {{ file: \"body.msh\" }} elastic {{ young_pa: {} "
                  "poisson_ratio: {} density_kg_per_m3: {} linear_elements: {} "
                  "gravity_m_per_s2 {{ z: {} }} fixed {{ half_space {{ {} }} }} }} }} }}",
                  kSphereRadius_m, material.young_modulus_pa, material.poisson_ratio,
                  material.density_kg_per_m3, !is_quadratic, description.gravity_m_per_s2.z(),
                  held),
      folder.path().string());
}

class LibrarySoftBody : public SoftBody {
 public:
  LibrarySoftBody(const elastic::BodyDescription& description, bool is_quadratic)
      : batch_(scene_of(description, is_quadratic), 1, 1, 1) {
    std::fill_n(batch_.tool().position_m, 3, 10.0);  // away from everything
  }

  void step(double dt_s) override { batch_.step(dt_s); }

  void move_sphere(const elastic::Vector3d& centre_m) override {
    std::copy_n(centre_m.data(), 3, batch_.tool().position_m);
  }

  double sag_m() override {
    const palpate_surface surface = batch_.surface();
    double least_m = 0.0;
    for (std::size_t i = 0; i < surface.vertex_count; ++i) {
      least_m = std::min(least_m, double{surface.vertices_m[3 * i + 2]});
    }
    return -least_m;
  }

  double force_on_sphere_newton() override { return batch_.force().force_on_tool_newton[2]; }

 private:
  tissue::Batch batch_;
};

}  // namespace

std::unique_ptr<SoftBody> library_soft_body(const elastic::BodyDescription& description,
                                            bool is_quadratic) {
  return std::make_unique<LibrarySoftBody>(description, is_quadratic);
}

}  // namespace palpate::bench
