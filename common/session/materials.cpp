// SPDX-License-Identifier: Apache-2.0
#include "common/session/materials.h"

#include <algorithm>
#include <cstdio>

namespace palpate {
namespace {

constexpr std::size_t kPrefix = 5;  // a shorter word stands for itself alone
constexpr const char* kLesionWords =
    "lesion tumor tumour metasta carcinoma cancer neoplasm nodule mass masses";
// SNOMED: mass, neoplasm, primary neoplasm, metastasis.
constexpr const char* kLesionCodes = "SCT:4147007 SCT:108369006 SCT:86049000 SCT:14799000";
constexpr const char* kCarcinomaCode = "SCT:25370001";

/// Calls `visit` with each word of a list; true as soon as it returns true.
template <class Visit>
bool any_word(std::string_view list, Visit visit) {
  while (!list.empty()) {
    const std::size_t space = std::min(list.find(' '), list.size());
    if (space > 0 && visit(list.substr(0, space))) return true;
    list.remove_prefix(std::min(space + 1, list.size()));
  }
  return false;
}

bool has_word(std::string_view name, std::string_view words) {
  std::string lower(name);
  std::transform(lower.begin(), lower.end(), lower.begin(), [](char c) {
    if (c == '_' || c == '-') return ' ';
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return any_word(words, [&](std::string_view word) {
    return any_word(lower, [&](std::string_view own) {
      return own == word || (word.size() >= kPrefix && own.starts_with(word));
    });
  });
}

bool has_code(std::string_view code, std::string_view codes) {
  return !code.empty() && any_word(codes, [&](std::string_view one) { return one == code; });
}

}  // namespace

const std::array<TissueMaterial, 6>& tissue_materials() {
  // Shear moduli G are given as E = 2 (1 + ν) G = 2.9 G for ν = 0.45.
  static constexpr std::array<TissueMaterial, 6> kTable = {{
      {"hepatocellular carcinoma", 68e3, 57e3, 68e3,
       "shear modulus 23.4 kPa (diseased liver 19.8 kPa), times 2.9", "PMC6925591, table 1",
       "2026-11", "hepatocellular hcc", "", kCarcinomaCode},
      {"focal lesion", 20.2e3, 10.7e3, 35.9e3,
       "shear-wave elastography, median of malignant lesions; benign 10.7, cholangiocarcinoma 35.9 "
       "kPa",
       "Egyptian Journal of Radiology and Nuclear Medicine 2020", "2026-11", kLesionWords, "",
       kLesionCodes},
      {"hepatic artery", 210e3, 163e3, 257e3, "as printed there", "PMC6925591, table 1", "2026-11",
       "artery arteries", "", "SCT:76015000 SCT:51114001"},
      {"gallbladder", 85e3, 85e3, 85e3, "as printed there", "PMC6925591, table 1", "2026-11",
       "gallbladder", "", "SCT:28231008"},
      {"bile duct", 166e3, 166e3, 166e3, "as printed there", "PMC6925591, table 1", "2026-11",
       "bile", "", "SCT:28273000"},
      {"liver", 5.2e3, 4.1e3, 6.4e3, "shear modulus 1.8 ± 0.4 kPa, times 2.9",
       "PMC6925591, table 1", "2026-11", "liver hepar hepatic", "vessel vein veins duct ducts",
       "SCT:10200004"},
  }};
  return kTable;
}

const TissueMaterial* material_for(std::string_view name, std::string_view code) {
  for (const TissueMaterial& material : tissue_materials()) {
    if (has_code(code, material.codes)) return &material;
  }
  for (const TissueMaterial& material : tissue_materials()) {
    if (has_word(name, material.words) && !has_word(name, material.not_words)) return &material;
  }
  return nullptr;
}

bool is_lesion(std::string_view name, std::string_view code) {
  return has_code(code, kLesionCodes) || has_code(code, kCarcinomaCode) ||
         has_word(name, kLesionWords) || has_word(name, "hcc");
}

const TissueMaterial* material_named(std::string_view name) {
  const auto& all = tissue_materials();
  const auto* found = std::find_if(all.begin(), all.end(),
                                   [&](const TissueMaterial& one) { return one.name == name; });
  return found == all.end() ? nullptr : found;
}

std::string source_of(const TissueMaterial& material) {
  char range[80] = "";  // NOLINT: for snprintf
  if (material.least_pa < material.largest_pa) {
    std::snprintf(range, sizeof range, ", %.3g to %.3g kPa", 1e-3 * material.least_pa,
                  1e-3 * material.largest_pa);
  }
  return std::string(material.name) + range + ": " + material.method + "; " + material.source +
         " (read " + material.date + ")";
}

std::string materials_table() {
  std::string table =
      "| material | E | range | method | source | read |\n|---|---|---|---|---|---|\n";
  for (const TissueMaterial& one : tissue_materials()) {
    char figures[120];  // NOLINT: for snprintf
    if (one.least_pa < one.largest_pa) {
      std::snprintf(figures, sizeof figures, "%.3g kPa | %.3g to %.3g kPa", 1e-3 * one.young_pa,
                    1e-3 * one.least_pa, 1e-3 * one.largest_pa);
    } else {
      std::snprintf(figures, sizeof figures, "%.3g kPa | one value", 1e-3 * one.young_pa);
    }
    table += "| " + std::string(one.name) + " | " + figures + " | " + one.method + " | " +
             one.source + " | " + one.date + " |\n";
  }
  return table;
}

}  // namespace palpate
