// SPDX-License-Identifier: Apache-2.0
// cell_regions.h — which array of a VTK file tells the region of each cell.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace palpate::physics {

/// VTK does not say which array it is. In this order: the one with a name by which programs call
/// regions, case ignored; the first of whole numbers that takes few values.
class CellRegions {
 public:
  /// An array with one value for each cell. @param is_whole  by its type
  void offer(std::string_view name, bool is_whole, std::vector<double> values) {
    const bool are_whole = std::all_of(values.begin(), values.end(), [](double value) {
      return std::abs(value) < kMost && value == std::floor(value);
    });
    if (!are_whole) return;
    const std::size_t rank = rank_of(name);
    if (rank >= best_rank_) return;
    if (rank == kNames.size() && (!is_whole || !takes_few_values(values))) return;
    best_rank_ = rank;
    values_ = std::move(values);
  }
  /// 0 if no array told.
  [[nodiscard]] std::int64_t of(std::size_t cell) const {
    return cell < values_.size() ? static_cast<std::int64_t>(values_[cell]) : 0;
  }

 private:
  static constexpr double kMost = 9e15;
  static constexpr std::size_t kFew = 256;
  // meshio, Gmsh, Medit by meshio, and what people call them
  static constexpr std::array<std::string_view, 12> kNames{
      "gmsh:physical", "cellentityids", "medit:ref", "region",     "regions",     "label",
      "labels",        "tag",           "material",  "materialid", "materialids", "subdomains"};

  static std::size_t rank_of(std::string_view name) {
    std::string lower(name);
    for (char& c : lower) {
      if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    }
    return static_cast<std::size_t>(std::find(kNames.begin(), kNames.end(), lower) -
                                    kNames.begin());
  }
  static bool takes_few_values(const std::vector<double>& values) {
    std::set<double> distinct;
    for (const double value : values) {
      distinct.insert(value);
      if (distinct.size() > kFew) return false;
    }
    return true;
  }

  std::size_t best_rank_ = kNames.size() + 1;
  std::vector<double> values_;
};

}  // namespace palpate::physics
