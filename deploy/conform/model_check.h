// SPDX-License-Identifier: Apache-2.0
// model_check.h — are the contact models of a physics those of its own answers? The parts of one
// answer are compared with each other, and what it predicts with the answers that come next.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "deploy/conform/mofc_side.h"

namespace palpate {

class ModelCheck {
 public:
  /// A motion through the tissue.
  void add(const std::vector<AnsweredPlace>& trace);
  /// The tool rests in tissue that has come to rest.
  void add_rest(const std::vector<AnsweredPlace>& trace);

  /// What is wrong with the parts of one answer, or with the side that a force is on; empty:
  /// nothing.
  [[nodiscard]] std::string contacts_problem() const;
  /// What is wrong with the predictions; empty: nothing.
  [[nodiscard]] std::string model_problem() const;
  /// Error of the predictions into the tissue and out of it, as a share of the change of the force:
  /// the lower quartile, so that a few events count little.
  [[nodiscard]] double worst_error() const { return std::max(error(kInwards), error(kOutwards)); }
  /// False: no contact has predicted anything.
  [[nodiscard]] bool is_compared() const;

 private:
  enum Direction : std::size_t { kInwards, kOutwards, kAcross };
  /// What is wrong with several answers; of the worst of them.
  struct Fault {
    std::size_t count = 0;
    double newton = 0.0;
    std::string text = {};
    void note(double by_newton, std::string what);
  };
  void judge_parts(const AnsweredPlace& place);
  void judge_contact(const Contact& contact, const AnsweredPlace& place);
  void predict(const std::vector<AnsweredPlace>& trace, double span_m);
  [[nodiscard]] double error(Direction direction) const;

  Fault sum_;
  Fault law_;
  Fault against_;
  std::size_t touches_ = 0;                    // contacts with a force …
  std::size_t across_count_ = 0;               // … across their normal
  double surface_newton_ = 0.0;                // sums over the contacts: stiffness · penetration
  double elastic_newton_ = 0.0;                // … and the elastic force along the normal
  std::array<std::vector<double>, 3> errors_;  // of the predictions, by direction
  std::vector<double> trusts_m_;
  std::string rest_problem_;
};

}  // namespace palpate
