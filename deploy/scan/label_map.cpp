// SPDX-License-Identifier: Apache-2.0
#include "deploy/scan/label_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <unordered_map>

#include "common/core/check.h"
#include "common/core/user/files.h"
#include "common/core/user/utf8.h"
#include "physics_node/files/file_text.h"

namespace palpate::scan {
namespace {

#ifdef PALPATE_DICOM
constexpr bool kReadsDicom = true;
#else
constexpr bool kReadsDicom = false;
#endif
constexpr std::uint32_t kMostLabel = 65'535;
constexpr std::uintmax_t kMostFileBytes = 4'000'000'000;
constexpr double kFinest_m = 1e-6;
constexpr double kCoarsest_m = 0.1;
constexpr double kLongest = 30.0;  // of the edges of a voxel, over the shortest
// Of the volume of a voxel over the product of its edges: 1 for a right angle.
constexpr double kFlattest = 0.1;

std::string lower_end(const std::string& file) {
  std::string end = file.substr(file.size() - std::min<std::size_t>(file.size(), 10));
  for (char& c : end) c = static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  return end;
}

/// Length of the UTF-8 character at the front; 0: there is none, or it is a control character.
std::size_t character_at(std::string_view text) {
  const auto [length, code] = utf8_character_at(text);
  const bool is_control = code < ' ' || (code >= 0x7f && code < 0xa0);
  return is_control ? 0 : length;
}

void make_names_unique(std::vector<Segment>& segments) {
  std::set<std::string> names;
  std::map<std::string, int> next;  // to be tried behind a name
  for (Segment& segment : segments) {
    // a name stands between quotation marks in a session and in a mesh
    for (std::size_t at = 0; at < segment.name.size();) {
      const std::size_t length = character_at(std::string_view(segment.name).substr(at));
      char& c = segment.name[at];
      if (length == 0 || c == '"' || c == '\\') c = '?';
      at += std::max<std::size_t>(length, 1);
    }
    if (segment.name.empty()) segment.name = "label " + std::to_string(segment.value);
    const std::string given = segment.name;
    while (!names.insert(segment.name).second) {
      segment.name = given + " " + std::to_string(++next.try_emplace(given, 1).first->second);
    }
  }
}

}  // namespace

std::uint16_t label_of(double value, std::uint64_t voxel, const std::string& name) {
  if (!(value >= 0.0 && value <= kMostLabel && value == std::floor(value))) {
    char number[32];  // NOLINT: for snprintf
    std::snprintf(number, sizeof number, "%g", value);
    throw SetupError(name + ": voxel " + std::to_string(voxel) + " = " + number +
                     ": labels must be whole numbers from 0 to 65535; is it a picture rather than "
                     "a segmentation?");
  }
  return static_cast<std::uint16_t>(value);
}

void check_grid(const std::array<std::uint64_t, 3>& size, std::uint64_t layers,
                const Eigen::Affine3d& ras_of_index_m, const std::string& name) {
  std::uint64_t all = layers;
  std::string shown;
  for (const std::uint64_t length : size) {
    shown += (shown.empty() ? "" : " x ") + std::to_string(length);
    if (length < 1 || length > kMostVoxels || all > kMostVoxels / length) all = kMostVoxels + 1;
    if (all <= kMostVoxels) all *= length;
  }
  if (all > kMostVoxels) {
    throw SetupError(name + ": " + shown +
                     (layers > 1 ? " in " + std::to_string(layers) + " layers" : "") +
                     ": at most 300 million voxels; crop the segmentation to the organ");
  }
  const Matrix3 linear = ras_of_index_m.linear();
  const Vector3 spacing = linear.colwise().norm();
  if (!ras_of_index_m.matrix().allFinite() || !(spacing.minCoeff() >= kFinest_m) ||
      !(spacing.maxCoeff() <= kCoarsest_m) || !(ras_of_index_m.translation().norm() < 100.0)) {
    throw SetupError(
        name +
        ": the voxels must be 0.001 mm to 100 mm long, and within 100 m of the origin; check the "
        "unit and save the segmentation again");
  }
  if (!(spacing.maxCoeff() <= kLongest * spacing.minCoeff())) {
    throw SetupError(name +
                     ": the voxels must be at most 30 times as long as wide; resample the "
                     "segmentation to slices that are closer");
  }
  if (!(std::abs(linear.determinant()) > kFlattest * spacing.prod())) {
    throw SetupError(
        name + ": the axes of the voxels must not lie in a plane; save the segmentation again");
  }
}

LabelMap label_map_of(const std::array<std::uint64_t, 3>& size,
                      const Eigen::Affine3d& ras_of_index_m, std::vector<Layer> layers,
                      std::vector<Segment> table, const std::string& name) {
  LabelMap map;
  for (std::size_t i = 0; i < 3; ++i) map.size[i] = static_cast<std::uint32_t>(size[i]);
  map.ras_of_index_m = ras_of_index_m;

  // how often each value is in each layer
  std::vector<std::vector<std::uint64_t>> counts(layers.size(),
                                                 std::vector<std::uint64_t>(kMostLabel + 1, 0));
  for (std::size_t l = 0; l < layers.size(); ++l) {
    for (const std::uint16_t value : layers[l]) ++counts[l][value];
  }
  const bool has_table = !table.empty();
  for (std::uint32_t l = 0; l < layers.size(); ++l) {
    for (std::uint32_t value = 1; value <= kMostLabel; ++value) {
      if (counts[l][value] == 0) continue;
      if (!has_table) {
        table.push_back({.value = value, .layer = l});
        continue;
      }
      if (std::none_of(table.begin(), table.end(),
                       [&](const Segment& s) { return s.value == value && s.layer == l; })) {
        throw SetupError(name + ": " + std::to_string(counts[l][value]) +
                         " voxels have the label " + std::to_string(value) +
                         (layers.size() > 1 ? " in layer " + std::to_string(l) : "") +
                         ", which no segment of the header has; save the segmentation again");
      }
    }
  }
  // segments without voxels are left out, and mentioned
  std::vector<std::uint64_t> whole;
  for (const Segment& segment : table) {
    const std::uint64_t count = counts[segment.layer][segment.value];
    if (count == 0) {
      map.notes.push_back("segment \"" + segment.name + "\" has no voxels");
      continue;
    }
    map.segments.push_back(segment);
    whole.push_back(count);
  }
  if (map.segments.empty()) {
    throw SetupError(name +
                     ": all voxels are 0, the background; export the segmentation, not the scan");
  }
  if (map.segments.size() > kMostLabel - 1) throw SetupError(name + ": more than 65534 segments");
  make_names_unique(map.segments);

  map.voxels.assign(layers.front().size(), 0);
  std::vector<std::uint16_t> index_of(kMostLabel + 1);
  std::uint64_t overlapping = 0;
  for (std::uint32_t l = 0; l < layers.size(); ++l) {
    std::fill(index_of.begin(), index_of.end(), std::uint16_t{0});
    for (std::size_t s = 0; s < map.segments.size(); ++s) {
      if (map.segments[s].layer == l)
        index_of[map.segments[s].value] = static_cast<std::uint16_t>(s + 1);
    }
    for (std::size_t v = 0; v < map.voxels.size(); ++v) {
      const std::uint16_t here = index_of[layers[l][v]];
      if (here == 0) continue;
      std::uint16_t& there = map.voxels[v];
      if (there != 0) ++overlapping;
      if (there == 0 || whole[here - 1U] < whole[there - 1U]) there = here;
    }
    layers[l] = {};
  }
  for (const std::uint16_t voxel : map.voxels) {
    if (voxel != 0) ++map.segments[voxel - 1U].voxels;
  }
  if (overlapping > 0) {
    map.notes.push_back(std::to_string(overlapping) +
                        " voxels are in several segments: each counts for the smallest of these");
  }
  const Matrix3 linear = ras_of_index_m.linear();
  if (linear.determinant() < 0.0)
    map.notes.emplace_back("the axes of the file are left-handed: mirrored back");
  return map;
}

LabelMap load_label_map(const std::string& file) {
  const std::string end = lower_end(file);
  const bool is_nifti = end.ends_with(".nii") || end.ends_with(".nii.gz");
  const bool is_dicom = end.ends_with(".dcm");
  if (!is_nifti && !is_dicom && !end.ends_with(".nrrd")) {
    throw SetupError(
        file +
        ": must be a label map, .nii, .nii.gz, .nrrd or .seg.nrrd; export it as one of these");
  }
  if (is_dicom && !kReadsDicom) {
    throw SetupError(file +
                     ": this build does not read DICOM; export the segmentation as .seg.nrrd from "
                     "3D Slicer, or build with -DPALPATE_DICOM=ON (package libdcmtk-dev)");
  }
  const FileContent content = read_regular_file(file, kMostFileBytes);
  if (!content.complaint.empty()) throw SetupError(file + ": " + content.complaint);
#ifdef PALPATE_DICOM
  if (is_dicom) return parse_dicom_seg(content.bytes, file);
#endif
  return is_nifti ? parse_nifti(content.bytes, file) : parse_nrrd(content.bytes, file);
}

void name_segments(LabelMap& map, std::string_view text, const std::string& file_name) {
  if (std::any_of(map.segments.begin(), map.segments.end(),
                  [](const Segment& segment) { return segment.layer > 0; })) {
    throw SetupError(
        file_name +
        ": the segmentation has layers, in which values repeat; name its segments where "
        "it was made");
  }
  physics::FileText lines(text, file_name);
  std::unordered_map<std::uint32_t, std::string> names;
  while (!lines.is_at_end()) {
    const int line_number = lines.line();
    std::string_view line = lines.rest_of_line();
    const auto trim = [&] {
      while (!line.empty() &&
             std::string_view(" \t\r,;:").find(line.front()) != std::string_view::npos)
        line.remove_prefix(1);
      while (!line.empty() && std::string_view(" \t\r").find(line.back()) != std::string_view::npos)
        line.remove_suffix(1);
    };
    trim();
    if (line.empty() || line.front() == '#') continue;
    std::uint32_t value = 0;
    std::size_t digits = 0;
    while (digits < line.size() && line[digits] >= '0' && line[digits] <= '9' &&
           value <= kMostLabel) {
      value = 10 * value + static_cast<std::uint32_t>(line[digits++] - '0');
    }
    if (digits == 0 || value > kMostLabel) {
      lines.fail_at_line(line_number, "must be 'value name', such as '1 liver'");
    }
    line.remove_prefix(digits);
    trim();
    // ITK-SNAP: value, colour, visibility, "name"
    if (line.ends_with('"')) {
      line.remove_suffix(1);
      line = line.substr(std::min(line.rfind('"') + 1, line.size()));
    }
    if (line.empty()) lines.fail_at_line(line_number, "a name must follow the value");
    names[value] = std::string(line);
  }
  for (Segment& segment : map.segments) {
    if (const auto found = names.find(segment.value); found != names.end())
      segment.name = found->second;
  }
  make_names_unique(map.segments);
}

}  // namespace palpate::scan
