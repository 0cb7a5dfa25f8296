// SPDX-License-Identifier: Apache-2.0
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/core/check.h"
#include "common/core/user/files.h"
#include "common/core/user/output_file.h"
#include "common/process/options.h"
#include "common/process/terminal.h"
#include "deploy/palpate/commands.h"
#include "deploy/palpate/import/import_site.h"
#include "deploy/palpate/import/imported_organ.h"

namespace palpate {
namespace {

struct ImportCommand {
  std::string labels_file;
  std::string folder;
  std::string names_file;
  std::optional<double> cell_mm;
  std::string device_file;
  std::vector<double> workspace_mm;
  ImportOptions options;
  bool may_overwrite = false;

  void add_to(CLI::App& app) {
    app.add_option("LABELS", labels_file, "segmentation (*.nii, *.nii.gz, *.nrrd, *.seg.nrrd)")
        ->required()
        ->type_name("");
    app.add_option("-o,--output", folder,
                   "write mesh, surfaces, session and report into this folder, which is made; "
                   "without it the labels are listed")
        ->type_name("FOLDER");
    app.add_option("--label", options.labels,
                   "name or value of a label that is part of the body, repeatable (default: all)")
        ->type_name("NAME")
        ->allow_extra_args(false);
    app.add_option("--lesion", options.lesions,
                   "label to search for: the mesh is fine at its boundary, and the hand presses "
                   "above it; repeatable (default: "
                   "labels that are called lesion, tumour and the like)")
        ->type_name("NAME")
        ->allow_extra_args(false);
    app.add_option("--fixed", options.fixed,
                   "label that is held, repeatable (default: the lowest fifth of the body)")
        ->type_name("NAME")
        ->allow_extra_args(false);
    app.add_option("--names", names_file,
                   "names of labels in lines 'value name', or ITK-SNAP's label descriptions")
        ->type_name("FILE");
    app.add_option("--up", options.up,
                   "side of the patient that is up: anterior (default), posterior, right, left, "
                   "superior or inferior")
        ->type_name("SIDE");
    app.add_option("--scanned", options.scanned,
                   "posture in the scan, whose gravity is in the organ's shape: supine, "
                   "prone, left, right (the side that is down), standing or none (default)")
        ->type_name("POSTURE");
    app.add_option("--tetrahedra", options.tetrahedra,
                   "at most this many (default 6000); more are truer and slower")
        ->type_name("N")
        ->check(CLI::Range(200, 200'000));
    app.add_option("--cell-mm", cell_mm,
                   "edge of the lattice's cells where it is finest, instead of --tetrahedra")
        ->type_name("MM")
        ->check(CLI::Range(0.05, 100.0));
    auto* device = app.add_option(
        "--device", device_file,
        "session of the device whose workspace is to be laid over the organ (default: the "
        "simulated device, 160 x 120 x 70 mm)");
    device->type_name("SESSION");
    app.add_option("--workspace-mm", workspace_mm, "the same by the size of its workspace")
        ->type_name("X Y Z")
        ->expected(3)
        ->check(CLI::Range(1.0, 10'000.0))
        ->excludes(device);
    add_overwrite_flag(app, may_overwrite);
  }

  int run(const Verbosity& verbosity) {
    scan::LabelMap map;
    {
      const BusyLine busy("import: reading", verbosity.is_quiet);
      map = scan::load_label_map(labels_file);
    }
    if (!names_file.empty()) {
      const FileContent names = read_text_file(names_file, 10'000'000);
      if (!names.complaint.empty()) throw SetupError(names_file + ": " + names.complaint);
      scan::name_segments(map, names.bytes, names_file);
    }
    if (folder.empty()) {
      for (const auto& [name, is_given] : {std::pair{"--label", !options.labels.empty()},
                                           {"--lesion", !options.lesions.empty()},
                                           {"--fixed", !options.fixed.empty()},
                                           {"--cell-mm", cell_mm.has_value()}}) {
        if (is_given)
          throw SetupError(std::string(name) +
                           ": without -o labels are listed only; add -o FOLDER");
      }
      std::fputs(label_list(map, labels_file).c_str(), stdout);
      return 0;
    }
    if (!device_file.empty()) options.device = reach_device_of(device_file);
    if (!workspace_mm.empty()) {
      options.device =
          reach_device_of_size(Vector3(workspace_mm[0], workspace_mm[1], workspace_mm[2]));
    }
    if (cell_mm) options.cell_m = 1e-3 * *cell_mm;
    options.is_timed = true;
    ImportedOrgan organ;
    {
      const BusyLine busy("import: meshing", verbosity.is_quiet);
      organ = imported_organ(std::move(map), options, labels_file);
    }
    write(organ);
    if (!verbosity.is_quiet) {
      std::printf("%s\n%s: written. Next: palpate launch %s\n", organ.report.c_str(),
                  folder.c_str(), (std::filesystem::path(folder) / kImportedSession).c_str());
    }
    return 0;
  }

 private:
  /// Of labels that are no longer there: only files that an import wrote.
  static void remove_old_surfaces(const std::filesystem::path& path, const ImportedOrgan& organ) {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(path, error)) {
      const std::string name = entry.path().filename().string();
      if (!name.starts_with("surface_") || !name.ends_with(".stl") || organ.files.contains(name))
        continue;
      std::ifstream file(entry.path(), std::ios::binary);
      std::string begin(std::strlen(kStlBegin), '\0');
      file.read(begin.data(), static_cast<std::streamsize>(begin.size()));
      if (file && begin == kStlBegin) std::filesystem::remove(entry.path(), error);
    }
  }

  void write(const ImportedOrgan& organ) const {
    const std::filesystem::path path(folder);
    std::vector<NamedOutput> outputs;
    for (const auto& [name, content] : organ.files)
      outputs.push_back({"--output", (path / name).string()});
    check_outputs(outputs, {labels_file, names_file}, may_overwrite);
    std::error_code error;
    std::filesystem::create_directories(path, error);
    if (error)
      throw SetupError(folder + ": " + error.message() + "; give a folder that can be made");
    if (may_overwrite) remove_old_surfaces(path, organ);
    // the session last: where it is, the rest is complete
    for (const auto& [name, content] : organ.files) {
      if (name != kImportedSession)
        write_file("import", (path / name).string(), content, may_overwrite);
    }
    write_file("import", (path / kImportedSession).string(), organ.files.at(kImportedSession),
               may_overwrite);
  }
};

}  // namespace

Command add_import_command(CLI::App& app) {
  return add_command<ImportCommand>(
      app, "import", "make an organ that can be touched from a segmentation of a scan");
}

}  // namespace palpate
