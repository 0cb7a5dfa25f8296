// SPDX-License-Identifier: Apache-2.0
// materials.h — how stiff tissues are, by name, each figure with its source: for `material` in a
// session, and for the labels of a segmentation.
#pragma once

#include <array>
#include <string>
#include <string_view>

namespace palpate {

struct TissueMaterial {
  const char* name;
  double young_pa;  ///< Young's modulus E, of the tissue at rest or at a low frequency
  double least_pa;  ///< of the range that the source gives
  double largest_pa;
  const char* method;
  const char* source;
  const char* date;  ///< when the figure was read
  /// Of which one is a part of a label's name, in lower case; separated by spaces.
  const char* words;
  /// Of which none is; the label is something else, as in "liver_vessels".
  const char* not_words;
  const char* codes;  ///< SNOMED codes of 3D Slicer's terminology, separated by spaces
};

/// In the order in which they are tried.
[[nodiscard]] const std::array<TissueMaterial, 6>& tissue_materials();

/// For labels without a figure; it has no source.
inline constexpr double kAssumedYoung_pa = 10e3;

/// The material of a label by its code, else by its name; nullptr if the table has none.
[[nodiscard]] const TissueMaterial* material_for(std::string_view name, std::string_view code);

/// Whether the label is a lesion, by code or name: what a hand searches for.
[[nodiscard]] bool is_lesion(std::string_view name, std::string_view code);

/// The one with exactly this name, as `material` in a session gives it; nullptr: there is none.
[[nodiscard]] const TissueMaterial* material_named(std::string_view name);

/// "liver, 4.1 to 6.4 kPa: method; source (read date)".
[[nodiscard]] std::string source_of(const TissueMaterial& material);

/// All of them as a table in Markdown: that of docs/materials.md.
[[nodiscard]] std::string materials_table();

}  // namespace palpate
