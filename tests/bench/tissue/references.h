// SPDX-License-Identifier: Apache-2.0
// references.h — the answers of the four problems: at rest, on finer quadratic meshes, with what
// the last refinement changed; and checks of these solutions against closed forms where those hold.
#pragma once

#include <string>
#include <vector>

#include "physics_node/elastic/material.h"

namespace palpate::bench {

struct Reference {
  double value = 0.0;
  double changed_ratio = 0.0;  ///< by the last refinement: how far it may be off
  std::size_t nodes = 0;
};

/// A solution of the same code beside a closed form that shares nothing with it.
struct Check {
  std::string name;
  double found = 0.0;
  double closed_form = 0.0;
};

/// All of them are computed when they are first asked for. Coarse: for a quick look and for tests.
class References {
 public:
  explicit References(bool is_coarse) : is_coarse_(is_coarse) {}

  // of the stable neo-Hookean law
  [[nodiscard]] Reference sag_m() const;
  [[nodiscard]] Reference press_newton() const;
  [[nodiscard]] Reference torque_newton_m() const;

  /// The force under the sphere at `along_m` from the middle over that in the middle: an even
  /// polynomial through three places, each on a mesh that is refined there.
  class Along {
   public:
    explicit Along(bool is_coarse);
    [[nodiscard]] double at(double along_m) const;

   private:
    double square_ = 0.0;
    double fourth_ = 0.0;
  };

  [[nodiscard]] std::vector<Check> sag_checks() const;
  [[nodiscard]] std::vector<Check> press_checks() const;
  [[nodiscard]] std::vector<Check> torque_checks() const;

 private:
  bool is_coarse_;
};

}  // namespace palpate::bench
