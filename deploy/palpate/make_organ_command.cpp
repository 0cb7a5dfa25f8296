// SPDX-License-Identifier: Apache-2.0
#include <cstdint>
#include <string>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/import/organ_labels.h"
#include "deploy/palpate/options.h"
#include "deploy/palpate/organ.h"
#include "physics_node/files/ply.h"
#include "physics_node/files/tetrahedral_files.h"

namespace palpate {
namespace {

struct MakeOrganCommand {
  std::string cloud_file;
  std::string mesh_file;
  std::string block_file;
  std::uint32_t points = 3000;
  std::uint32_t subdivisions = 2;
  std::uint32_t cells = 4;
  std::string labels_file;
  std::vector<double> voxel_mm;
  OrganLabels labels;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    app.add_option("--cloud", cloud_file,
                   "write a point cloud to this file (PLY), - for standard output")
        ->type_name("FILE");
    app.add_option("--points", points, "number of points of the cloud (default 3000)")
        ->type_name("N")
        ->check(CLI::Range(10, 100'000'000));
    app.add_option("--mesh", mesh_file,
                   "write a tetrahedral mesh to this file (Gmsh 2.2), - for standard output")
        ->type_name("FILE");
    app.add_option("--subdivisions", subdivisions,
                   "subdivisions of the mesh surface (default 2: 2240 tetrahedra)")
        ->type_name("N")
        ->check(CLI::Range(0, 6));
    app.add_option(
           "--block", block_file,
           "write a block of 100 x 100 x 50 mm in tetrahedra to this file (Gmsh 2.2), - for "
           "standard output")
        ->type_name("FILE");
    app.add_option("--cells", cells,
                   "cells of the block from top to bottom (default 4: 1280 tetrahedra)")
        ->type_name("N")
        ->check(CLI::Range(2, 16));
    app.add_option(
           "--labels", labels_file,
           "write a segmentation with a lesion to this file (*.seg.nrrd with names, *.nii), "
           "for palpate import")
        ->type_name("FILE");
    app.add_option("--voxel-mm", voxel_mm,
                   "edges of the voxels of the segmentation in mm (default 2 2 2)")
        ->type_name("X Y Z")
        ->expected(3)
        ->check(CLI::Range(0.1, 30.0));
    app.add_option("--oblique-degrees", labels.oblique_degrees,
                   "turn the grid of the segmentation by this (default 0)")
        ->type_name("DEGREES")
        ->check(CLI::Range(-180.0, 180.0));
    app.add_flag("--thin-lobe", labels.has_thin_lobe,
                 "give the segmentation a lobe of 4 mm thickness");
    add_overwrite_flag(app, may_overwrite);
  }

  int run(const Verbosity& verbosity) const {
    if (cloud_file.empty() && mesh_file.empty() && block_file.empty() && labels_file.empty()) {
      throw SetupError(
          "make-organ: nothing to write; give --cloud FILE, --mesh FILE, --block FILE or --labels "
          "FILE");
    }
    const bool is_nifti = labels_file.ends_with(".nii");
    if (!labels_file.empty() && !is_nifti && !labels_file.ends_with(".nrrd"))
      throw SetupError("--labels " + labels_file + ": the name must end with .seg.nrrd or .nii");
    check_outputs({{"--cloud", cloud_file},
                   {"--mesh", mesh_file},
                   {"--block", block_file},
                   {"--labels", labels_file}},
                  {}, may_overwrite);
    if (!cloud_file.empty()) {
      Progress progress("make-organ", verbosity.is_quiet);
      const auto cloud = organ_cloud(points, [&](double ratio) { progress.show(ratio); });
      write_file("cloud", cloud_file, physics::ply_text(cloud), may_overwrite);
    }
    if (!mesh_file.empty()) {
      const BusyLine busy("make-organ", verbosity.is_quiet);
      write_file("mesh", mesh_file, physics::msh_text(organ_mesh(subdivisions)), may_overwrite);
    }
    if (!block_file.empty()) {
      write_file("block", block_file, physics::msh_text(block_mesh(cells)), may_overwrite);
    }
    if (!labels_file.empty()) {
      OrganLabels wanted = labels;
      if (!voxel_mm.empty()) wanted.voxel_mm = {voxel_mm[0], voxel_mm[1], voxel_mm[2]};
      write_file("labels", labels_file, organ_labels_text(wanted, is_nifti), may_overwrite);
    }
    say_written({cloud_file, mesh_file, block_file, labels_file}, verbosity);
    return 0;
  }
};

}  // namespace

Command add_make_organ_command(CLI::App& app) {
  return add_command<MakeOrganCommand>(app, "make-organ",
                                       "write an organ-like body as a point cloud, a mesh or a "
                                       "segmentation, for trying out sessions");
}

}  // namespace palpate
