// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/import/imported_organ.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>

#include "common/contact/bounds.h"
#include "common/core/check.h"
#include "common/core/user/temp_folder.h"
#include "common/session/materials.h"
#include "common/session/session_file.h"
#include "deploy/palpate/import/chosen_segments.h"
#include "deploy/palpate/import/import_site.h"
#include "deploy/palpate/import/import_text.h"
#include "deploy/palpate/import/solve_speed.h"
#include "physics_node/elastic_tissue/elastic_body.h"
#include "physics_node/files/tetrahedral_files.h"

namespace palpate {
namespace {

constexpr double kTipRadius_m = 0.006;
constexpr double kPoisson = 0.45;
constexpr std::size_t kMostParts = 64;  // of an elastic body in a session
constexpr double kHeldShare = 0.2;      // of the height, from below
constexpr std::uint64_t kManyVoxels = 5000;
constexpr std::size_t kMostLabels = 1000;
constexpr double kDegrees = 180.0 / std::numbers::pi;

bool is_in(const std::vector<std::uint32_t>& segments, std::uint32_t segment) {
  return std::find(segments.begin(), segments.end(), segment) != segments.end();
}

struct Chosen {
  double young_pa = kAssumedYoung_pa;
  const TissueMaterial* source = nullptr;
};

class Import {
 public:
  Import(scan::LabelMap map, const ImportOptions& options, std::string file)
      : map_(std::move(map)), options_(options), file_(std::move(file)) {}

  ImportedOrgan take() {
    gravity_ = world_of_ras(options_.up) * scan_gravity_m_per_s2(options_.scanned);
    choose_labels();
    map_.ras_of_index_m = Eigen::Affine3d(world_of_ras(options_.up)) * map_.ras_of_index_m;
    std::vector<scan::Region> regions = scan::keep_largest_part(map_, segments_);
    refuse_dropped(regions);
    const Site site = site_of(map_, largest_lesion(regions));
    organ_ = scan::organ_mesh_of(map_, std::move(regions),
                                 {.cell_m = options_.cell_m,
                                  .tetrahedra = options_.tetrahedra,
                                  .fine = lesions_,
                                  .site_m = site.top_m});
    place(site);
    choose_materials();

    ImportedOrgan result;
    for (std::size_t r = 0; r < organ_.regions.size() && organ_.regions.size() > 1; ++r) {
      if (organ_.regions[r].elements == 0) continue;
      std::string name = surface_name_of(organ_.mesh.region_names[r]);
      while (result.files.contains(name + ".stl")) name += "_" + std::to_string(r);
      result.files[name + ".stl"] =
          stl_text(scan::surface_of_region(organ_.mesh, static_cast<std::uint16_t>(r)));
    }
    const physics::TriangleMesh surface = physics::surface_of(organ_.mesh);
    result.files["surface.stl"] = stl_text(surface);
    reach_ = propose_reach(surface, options_.device,
                           {.tip_radius_m = kTipRadius_m, .below_m = press_m()});
    drop_empty_regions();
    result.files[kImportedMesh] = physics::msh_text(organ_.mesh);
    result.files[kImportedSession] = session();
    std::string body;
    try {
      body = checked(result.files);
    } catch (const SetupError& error) {
      const bool is_too_soft =
          std::string(error.what()).find(physics::kNoUnloadedShape) != std::string::npos;
      if (!is_too_soft || gravity_.isZero(0.0)) throw;
      gravity_.setZero();
      result.files[kImportedSession] = session();
      body = checked(result.files) + "\n  WARNING: without gravity: " + physics::kNoUnloadedShape +
             "; another --tetrahedra may have one";
    }
    result.files[kImportedSession] = session();  // with the solve rate
    result.report = report() + "\nAs the session uses it\n  " + body + "\n";
    if (options_.is_timed) result.report += speed_report(speed_, organ_.mesh.tetrahedra.size());
    result.files[kImportedReport] = result.report;
    return result;
  }

 private:
  void choose_labels() {
    segments_ = segments_named(map_, options_.labels, "--label");
    if (segments_.empty()) {
      for (std::uint32_t s = 0; s < map_.segments.size(); ++s) segments_.push_back(s);
    }
    if (segments_.size() > kMostLabels) {
      throw SetupError(std::to_string(segments_.size()) +
                       " labels: at most 1000 make one body; choose with --label");
    }
    lesions_ = segments_named(map_, options_.lesions, "--lesion");
    fixed_ = segments_named(map_, options_.fixed, "--fixed");
    for (const auto* list : {&lesions_, &fixed_}) {
      for (const std::uint32_t segment : *list) {
        if (!is_in(segments_, segment)) {
          throw SetupError("\"" + map_.segments[segment].name +
                           "\" is not one of --label; add it there");
        }
      }
    }
    if (lesions_.empty() && segments_.size() > 1) {
      for (const std::uint32_t s : segments_) {
        if (is_lesion(map_.segments[s].name, map_.segments[s].code)) lesions_.push_back(s);
      }
    }
  }

  /// Lesions and supports that were asked for must be left; lesions by name are forgotten.
  void refuse_dropped(const std::vector<scan::Region>& regions) {
    const auto is_gone = [&](std::uint32_t segment) {
      return std::none_of(regions.begin(), regions.end(), [&](const scan::Region& region) {
        return region.segment == segment && region.voxels > region.dropped_voxels;
      });
    };
    const auto refuse = [&](const std::vector<std::uint32_t>& segments, const char* option) {
      const auto gone = std::find_if(segments.begin(), segments.end(), is_gone);
      if (gone == segments.end()) return;
      throw SetupError(std::string(option) + " \"" + map_.segments[*gone].name +
                       "\": all its voxels lie apart from the largest part of the body, and only "
                       "that part is meshed; choose the labels of one body with --label");
    };
    if (!options_.lesions.empty()) refuse(lesions_, "--lesion");
    refuse(fixed_, "--fixed");
    std::erase_if(lesions_, is_gone);
  }

  /// The lesion with most voxels, which the hand presses above; nothing: there is none.
  [[nodiscard]] std::optional<std::uint32_t> largest_lesion(
      const std::vector<scan::Region>& regions) const {
    std::optional<std::uint32_t> largest;
    double most_m3 = 0.0;
    for (const scan::Region& region : regions) {
      if (!is_in(lesions_, region.segment) || region.voxels_m3 <= most_m3) continue;
      most_m3 = region.voxels_m3;
      largest = region.segment;
    }
    return largest;
  }

  /// The point of the surface above the target becomes the origin of W.
  void place(const Site& site) {
    const physics::TriangleMesh surface = physics::surface_of(organ_.mesh);
    Column column = column_at(surface, site.top_m.x(), site.top_m.y());
    if (!std::isfinite(column.top_m) || !std::isfinite(column.below_m)) {
      column.top_m = site.top_m.z();
      column.below_m = site.top_m.z() - map_.spacing_m().maxCoeff();
    }
    thickness_m_ = column.top_m - column.below_m;
    moved_m_ = -Vector3(site.top_m.x(), site.top_m.y(), column.top_m);
    for (Vector3& node_m : organ_.mesh.nodes_m) node_m += moved_m_;
    bounds_ = bounds_of(organ_.mesh.nodes_m);
    check_extent(bounds_, file_);
    target_m_ = site.centre_m + moved_m_;
  }

  void choose_materials() {
    std::size_t largest = 0;
    for (std::size_t r = 0; r < organ_.regions.size(); ++r) {
      const scan::Segment& segment = map_.segments[organ_.regions[r].segment];
      Chosen chosen;
      chosen.source = material_for(segment.name, segment.code);
      if (chosen.source != nullptr) chosen.young_pa = chosen.source->young_pa;
      chosen_.push_back(chosen);
      if (organ_.regions[r].mesh_m3 > organ_.regions[largest].mesh_m3) largest = r;
    }
    base_ = largest;
    std::size_t parts = 0;
    for (std::size_t r = 0; r < chosen_.size(); ++r) {
      if (is_part(r)) ++parts;
    }
    if (parts > kMostParts) {
      throw SetupError(std::to_string(parts) +
                       " labels differ in stiffness from the largest: a session takes 64 parts; "
                       "choose with --label");
    }
  }
  [[nodiscard]] bool is_part(std::size_t r) const {
    return r != base_ && organ_.regions[r].elements > 0 &&
           (is_in(lesions_, organ_.regions[r].segment) ||
            chosen_[r].young_pa != chosen_[base_].young_pa);
  }

  /// A physical volume without elements has no place in a mesh.
  void drop_empty_regions() {
    std::vector<std::uint16_t> place(organ_.regions.size(), 0);
    std::vector<std::string> names;
    for (std::size_t r = 0; r < place.size(); ++r) {
      place[r] = static_cast<std::uint16_t>(names.size());
      if (organ_.regions[r].elements > 0) names.push_back(organ_.mesh.region_names[r]);
    }
    for (std::uint16_t& region : organ_.mesh.regions) region = place[region];
    organ_.mesh.region_names = std::move(names);
  }

  [[nodiscard]] const std::string& name_of(std::size_t r) const {
    return map_.segments[organ_.regions[r].segment].name;
  }

  [[nodiscard]] static std::string source_of(const Chosen& chosen) {
    if (chosen.source == nullptr)
      return "assumed: the table has no figure for this name; give one that you trust";
    return palpate::source_of(*chosen.source);
  }

  /// The line of the session: the material by its name, or the assumed modulus.
  [[nodiscard]] static std::string stiffness_of(const Chosen& chosen, const char* indent) {
    return chosen.source == nullptr ? text_of("%syoung_pa: %.4g\n", indent, chosen.young_pa)
                                    : text_of("%smaterial: \"%s\"  # %.3g kPa\n", indent,
                                              chosen.source->name, 1e-3 * chosen.young_pa);
  }

  [[nodiscard]] std::string held() const {
    if (fixed_.empty()) {
      const double z =
          bounds_.lowest_m.z() + kHeldShare * (bounds_.highest_m.z() - bounds_.lowest_m.z());
      return text_of(
          "      # where it is held: the lowest fifth; change it to where the organ is attached\n"
          "      fixed { half_space { point_m { z: %.5g } } }\n",
          z);
    }
    std::string text;
    for (const std::uint32_t segment : fixed_)
      text += "      fixed { tag: \"" + map_.segments[segment].name + "\" }\n";
    return text;
  }

  /// Gravity in the scan, and in the session, whose +z is up.
  [[nodiscard]] std::string gravity() const {
    if (gravity_.isZero(0.0)) return "";
    return text_of(
        "      # the scan was made %s: its shape is that under this load. Turn gravity_m_per_s2 "
        "for "
        "another posture\n"
        "      scan_gravity_m_per_s2 { x: %.4g  y: %.4g  z: %.4g }\n"
        "      gravity_m_per_s2      { x: 0  y: 0  z: %.4g }\n",
        options_.scanned.c_str(), gravity_.x(), gravity_.y(), gravity_.z(), -kGravity_m_per_s2);
  }

  [[nodiscard]] bool is_linear() const {
    return organ_.mesh.tetrahedra.size() > scan::kMostQuadratic;
  }

  [[nodiscard]] std::string session() const {
    // the hand drifts over the place
    constexpr double kSwing_m = 0.012;
    const double drift_m = std::min(0.018, 0.15 * (bounds_.highest_m.x() - bounds_.lowest_m.x()));
    const Vector3 centre_m = reach_.hand_m(Vector3(0, 0, kTipRadius_m - press_m() + kSwing_m));
    const Vector3 amplitude_m = Vector3(drift_m, drift_m / 6.0, kSwing_m) / reach_.scale_ratio;
    std::string parts;
    for (std::size_t r = 0; r < chosen_.size(); ++r) {
      if (!is_part(r)) continue;
      parts += text_of("      # %s\n      part {\n        where { tag: \"%s\" }\n%s      }\n",
                       source_of(chosen_[r]).c_str(), name_of(r).c_str(),
                       stiffness_of(chosen_[r], "        ").c_str());
    }
    return "# Written by `palpate import` from a segmentation; yours to edit. report.txt tells "
           "what was done, and from where\n"
           "# the figures of the materials are: confirm or change them before the session is used "
           "for anything.\n"
           "# All fields: docs/session.md. What an elastic body is: docs/elastic.md.\n\n"
           "name: \"imported\"\nduration_s: 10\n\n"
           "# A simulated hand that presses on the organ and slides over it. With a device of your "
           "own: docs/first_device.md.\n"
           "device {\n  rate_hz: 1000\n  simulated {}\n"
           "  # what of the organ is reached: report.txt\n" +
           text_of("  workspace { scale_ratio: %.4g  offset_m { x: %.4g  y: %.4g  z: %.4g } }\n",
                   reach_.scale_ratio, reach_.offset_m.x(), reach_.offset_m.y(),
                   reach_.offset_m.z()) +
           "}\n\nhand {\n  pointer {}\n  sinusoid {\n" +
           text_of(
               "    center_m     { x: %.4g  y: %.4g  z: %.4g }\n    amplitude_m  { x: %.4g  y: "
               "%.4g  z: %.4g }\n",
               centre_m.x(), centre_m.y(), centre_m.z(), amplitude_m.x(), amplitude_m.y(),
               amplitude_m.z()) +
           "    frequency_hz { x: 0.07   y: 0.03   z: 0.7 }\n    phase_rad    { x: -0.94  y: 0     "
           " z: 1.57 }\n  }\n}\n\n"
           "mofc {\n  controller: mofc\n  mode: guard\n}\n\nphysics { rate_hz: 1000 }\n\n"
           "scene {\n" +
           text_of("  tool { tip_radius_m: %.4g }\n", kTipRadius_m) +
           "  tissue {\n    name: \"organ\"\n"
           "    # the surface above the target is at the origin; +z is " +
           options_.up +
           "\n"
           "    tetrahedral_mesh { file: \"" +
           kImportedMesh +
           "\" }\n"
           "    elastic {\n      # " +
           name_of(base_) + " — " + source_of(chosen_[base_]) + "\n" +
           stiffness_of(chosen_[base_], "      ") +
           text_of("      poisson_ratio: %.3g\n", kPoisson) +
           (is_linear() ? "      linear_elements: true\n" : "") +
           "      viscosity_ms: 5\n      friction_coefficient: 0.1\n" + gravity() + held() + parts +
           text_of("      # see the end of report.txt\n      solve_rate_hz: %g\n", speed_.rate_hz) +
           "    }\n  }\n}\n";
  }

  /// Loads what will be written, as a session does. @return the line of `palpate scene check`
  [[nodiscard]] std::string checked(const std::map<std::string, std::string>& files) {
    const TempFolder folder;
    for (const char* name : {kImportedMesh, kImportedSession}) folder.write(name, files.at(name));
    const Session session = load_session(folder.path() / kImportedSession, {});
    std::vector<std::shared_ptr<const physics::ElasticBody>> bodies;
    try {
      bodies = physics::elastic_bodies_of(session.scene);
    } catch (const SetupError& error) {
      const std::string text = error.what();
      const std::size_t at = text.find("elastic body");
      throw SetupError(
          "the " + (at == std::string::npos ? text : text.substr(at)) +
          "\nchoose other labels (--label), where it is held (--fixed), or a smaller --cell-mm");
    }
    if (options_.is_timed) speed_ = solve_speed_of(*bodies.front(), kTipRadius_m, press_m());
    return physics::mesh_report(*bodies.front());
  }

  /// What the hand presses: a fifth of the thickness, at most 8 mm.
  [[nodiscard]] double press_m() const { return std::min(0.008, 0.2 * thickness_m_); }

  [[nodiscard]] const char* warning_of(const scan::Region& region, double error) const {
    const bool matters = is_in(lesions_, region.segment) || is_in(fixed_, region.segment);
    if (region.elements == 0) return "  WARNING: nothing of it is in the mesh";
    if (matters && std::abs(error) > 10.0)
      return "  WARNING: more than 10 %; give more --tetrahedra or a smaller --cell-mm";
    if (std::abs(error) > 1.0 && region.voxels - region.dropped_voxels >= kManyVoxels)
      return "  WARNING: more than 1 %; give a smaller --cell-mm";
    return "";
  }

  [[nodiscard]] std::string report() const {
    const Vector3 spacing_mm = 1e3 * map_.spacing_m();
    std::string text = text_of(
        "palpate import: %s\n\nSegmentation\n  %u x %u x %u voxels of %.3g x %.3g x %.3g mm\n",
        file_.c_str(), map_.size[0], map_.size[1], map_.size[2], spacing_mm.x(), spacing_mm.y(),
        spacing_mm.z());
    for (const std::string& note : map_.notes) text += "  " + note + "\n";

    text +=
        "\nLabels                          voxels  dropped   voxels ml     mesh ml    error  "
        "tetrahedra\n";
    for (std::size_t r = 0; r < organ_.regions.size(); ++r) {
      const scan::Region& region = organ_.regions[r];
      const double error =
          region.voxels_m3 > 0.0 ? 100.0 * (region.mesh_m3 / region.voxels_m3 - 1.0) : 0.0;
      text +=
          text_of("  %s %8llu %8llu %11.3f %11.3f %+7.2f %% %10zu%s\n",
                  column(name_of(r), 28).c_str(), static_cast<unsigned long long>(region.voxels),
                  static_cast<unsigned long long>(region.dropped_voxels), 1e6 * region.voxels_m3,
                  1e6 * region.mesh_m3, error, region.elements, warning_of(region, error));
    }
    text += "  dropped: voxels that are not connected to the largest part by faces\n";
    text += missing_report(map_, moved_m_, bounds_, organ_.cell_m);

    text += text_of(
        "\nMesh\n  %zu tetrahedra, %zu nodes; cells of %.2f mm at the place of touch and at "
        "lesions, up to four times as "
        "large elsewhere\n  smoothed over %.2f mm; boundaries of labels lie within a cell of those "
        "of the voxels\n",
        organ_.mesh.tetrahedra.size(), organ_.mesh.nodes_m.size(), 1e3 * organ_.cell_m,
        1e3 * organ_.smoothing_m);
    if (is_linear()) {
      text += text_of(
          "  more than %zu tetrahedra: as linear elements, which are some 14 %% too stiff; "
          "fewer are quadratic, and truer\n",
          scan::kMostQuadratic);
    }
    if (organ_.lost_m3 > 0.0)
      text += text_of(
          "  dropped: %.3f ml that touch the rest in an edge or a node only, or not at all\n",
          1e6 * organ_.lost_m3);
    text += text_of(
        "  angles between faces %.1f to %.1f degrees, %zu slivers (an angle below %g degrees)\n",
        kDegrees * organ_.angles.least_rad, kDegrees * organ_.angles.largest_rad,
        organ_.angles.slivers, scan::kSliverAngle_degrees);
    std::uint64_t all = 0;
    for (const std::uint64_t count : organ_.angles.histogram) all += count;
    for (std::size_t bin = 0; bin < organ_.angles.histogram.size(); ++bin) {
      const double share = static_cast<double>(organ_.angles.histogram[bin]) /
                           static_cast<double>(std::max<std::uint64_t>(all, 1));
      text += text_of("  %3zu-%-3zu %6.2f %% ", 10 * bin, 10 * bin + 10, 100.0 * share) +
              std::string(static_cast<std::size_t>(std::lround(150.0 * share)), '#') + "\n";
    }

    const Vector3 low_mm = 1e3 * bounds_.lowest_m;
    const Vector3 high_mm = 1e3 * bounds_.highest_m;
    text += text_of(
        "\nPlace (frame W, not scaled)\n  +z is %s; the surface above the %s is at the origin, its "
        "centre %.1f mm below\n"
        "  the body reaches from (%.0f, %.0f, %.0f) to (%.0f, %.0f, %.0f) mm\n",
        options_.up.c_str(), lesions_.empty() ? "middle of the body" : "largest lesion",
        -1e3 * target_m_.z(), low_mm.x(), low_mm.y(), low_mm.z(), high_mm.x(), high_mm.y(),
        high_mm.z());
    const Matrix3 turn = world_of_ras(options_.up);
    text +=
        "  ImageToPatient of OpenIGTLink, from the scan (right, anterior, superior) to W, in mm:\n";
    for (int row = 0; row < 3; ++row) {
      text += text_of("    %4.0f %4.0f %4.0f %10.3f\n", turn(row, 0), turn(row, 1), turn(row, 2),
                      1e3 * moved_m_[row]);
    }
    text += "       0    0    0      1.000\n";
    text += fixed_.empty() ? "  held: the lowest fifth of the body. WARNING: a guess; set `fixed` "
                             "in the session, or give --fixed LABEL\n"
                           : "  held: the labels given with --fixed\n";

    text += reach_report(reach_, options_.device);

    text += "\nMaterials: proposals, to be confirmed or edited in session.txtpb\n";
    for (std::size_t r = 0; r < chosen_.size(); ++r) {
      if (organ_.regions[r].elements == 0) continue;
      text += text_of("  %s %8.4g kPa  %s%s%s\n", column(name_of(r), 28).c_str(),
                      1e-3 * chosen_[r].young_pa, chosen_[r].source == nullptr ? "WARNING: " : "",
                      source_of(chosen_[r]).c_str(), r == base_ ? " (of the body)" : "");
    }
    return text;
  }

  scan::LabelMap map_;
  Vector3 gravity_ = Vector3::Zero();  // in the scan, in W; 0: left out
  const ImportOptions& options_;
  std::string file_;
  std::vector<std::uint32_t> segments_;
  std::vector<std::uint32_t> lesions_;
  std::vector<std::uint32_t> fixed_;
  scan::OrganMesh organ_;
  std::vector<Chosen> chosen_;  // of the regions
  std::size_t base_ = 0;        // the largest region
  Bounds bounds_{};
  Vector3 moved_m_ = Vector3::Zero();
  Vector3 target_m_ = Vector3::Zero();
  double thickness_m_ = 0.0;
  SolveSpeed speed_{};
  Reach reach_{};
};

}  // namespace

std::string label_list(const scan::LabelMap& map, const std::string& file) {
  const Vector3 spacing_mm = 1e3 * map.spacing_m();
  std::string text =
      text_of("%s: %u x %u x %u voxels of %.3g x %.3g x %.3g mm\n", file.c_str(), map.size[0],
              map.size[1], map.size[2], spacing_mm.x(), spacing_mm.y(), spacing_mm.z());
  for (const std::string& note : map.notes) text += "  " + note + "\n";
  text += "  value      voxels          ml  label\n";
  for (const scan::Segment& segment : map.segments) {
    const TissueMaterial* material = material_for(segment.name, segment.code);
    text += text_of(
        "  %5u %11llu %11.3f  %s%s%s\n", segment.value,
        static_cast<unsigned long long>(segment.voxels),
        1e6 * static_cast<double>(segment.voxels) * map.voxel_m3(), segment.name.c_str(),
        segment.code.empty() ? "" : (" (" + segment.code + ")").c_str(),
        material == nullptr
            ? ""
            : text_of(", as %s: %.3g kPa", material->name, 1e-3 * material->young_pa).c_str());
  }
  return text;
}

ImportedOrgan imported_organ(scan::LabelMap map, const ImportOptions& options,
                             const std::string& file) {
  return Import(std::move(map), options, file).take();
}

}  // namespace palpate
