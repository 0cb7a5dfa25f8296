// SPDX-License-Identifier: Apache-2.0
// ablation.h — how an elastic body changes: under the electrodes of the tools, where blades cut it,
// and where it is torn off.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <vector>

#include "common/core/vector.h"
#include "common/session/scene_config.h"
#include "physics_node/elastic/attached/tearing.h"
#include "physics_node/elastic_tissue/ablation/ablated_body.h"

namespace palpate::physics {

struct AblationFigures {
  std::uint64_t remade = 0;   ///< bodies that replaced another
  std::uint64_t removed = 0;  ///< elements that are gone
  std::uint64_t loose = 0;    ///< of these: that nothing held any more
  std::uint64_t refused = 0;  ///< bodies that could not be made: the one before goes on
  std::uint64_t restored = 0;
  std::uint64_t faces_cut = 0;  ///< that blades have passed
  double cut_joule = 0.0;       ///< toughness × area that they have swept
  double swept_m2 = 0.0;        ///< that area
  double separated_m2 = 0.0;    ///< of those faces, projected on the planes of the blades
};

/// The doses of the elements, what still holds, what is cut, and the body that is left. Whenever
/// elements have changed their stage (heat.h), attachments have torn further or faces have been
/// cut, the next body is made, one after the other: on a thread of its own, or, for simulations on
/// a time of their own, at once and used kLatency_s later. One thread calls it; allocates.
class Ablation {
 public:
  static constexpr double kLatency_s = 0.1;

  /// @param whole  the body of the session   @param tools  that may be energised
  /// @param electrode  none: nothing is heated   @param is_in_background  else deterministic
  /// @param can_be_cut  by blades
  Ablation(std::shared_ptr<BodyCompliance> whole, const std::optional<ElectrodeConfig>& electrode,
           double tip_radius_m, std::size_t tools, bool is_in_background, bool can_be_cut = false);
  ~Ablation() = default;
  Ablation(const Ablation&) = delete;  // a body may be under way
  Ablation& operator=(const Ablation&) = delete;

  /// Continues as the other would, to the bit. @pre  of the same body, none in the background
  void continue_as(const Ablation& other);

  /// An electrode there heats the present body, whose nodes are at x_m. @pre  an electrode
  /// @param energised_s  ≥ 0, for how long
  void heat(std::size_t tool, const elastic::VectorXd& x_m, const Vector3& tip_m,
            double energised_s);

  /// What a blade has swept since the last call.
  struct Sweep {
    double swept_m2 = 0.0;
    double joule = 0.0;                  ///< toughness × that
    std::vector<elastic::FaceSide> cut;  ///< faces of the session's body
    double cut_m2 = 0.0;                 ///< their projection on the plane of the blade
    // its edge is there now, in the untouched body
    Vector3 from_m = Vector3::Constant(1e9);
    Vector3 to_m = Vector3::Constant(1e9);
  };
  /// @pre  it can be cut   @param reach_m  of the points that it holds
  void cut(std::size_t tool, const Sweep& sweep, double reach_m);
  /// Of the session's body. @pre  it can be cut
  [[nodiscard]] const std::vector<std::int32_t>& opposite_sides() const noexcept {
    return *opposite_;
  }

  /// After a full solution. @param has_torn  further, since the last one
  void tear(const elastic::Tearing& tearing, bool has_torn);

  /// Time goes on. @return the body that from now on is the present one; null: it is still the same
  /// @param x_m  of the present one
  [[nodiscard]] std::shared_ptr<const AblatedBody> advance(double step_s,
                                                           const elastic::VectorXd& x_m);

  /// Nothing has been heated. @return the body of the session, from now on the present one
  [[nodiscard]] std::shared_ptr<const AblatedBody> restore();

  [[nodiscard]] const AblatedBody& present() const noexcept { return *present_; }
  /// Energy per mass that an element of the session's body has taken up, over what makes it
  /// vanish.
  [[nodiscard]] const std::vector<double>& doses() const noexcept { return doses_; }
  [[nodiscard]] const AblationFigures& figures() const noexcept { return figures_; }

 private:
  using Made = std::shared_ptr<const AblatedBody>;
  void order(const elastic::VectorXd& x_m);
  [[nodiscard]] Made received();

  Made whole_;
  Made present_;
  std::optional<ElectrodeConfig> electrode_;
  double tip_radius_m_;
  bool is_in_background_;
  std::vector<double> doses_;         // of the elements of the whole body
  std::vector<std::uint8_t> stages_;  // likewise
  std::vector<Vector3> heated_m_;     // where each tool was energised last
  std::vector<double> attached_;      // stiffness over the intact one, of what tears
  struct Edge {
    Vector3 from_m = Vector3::Constant(1e9);
    Vector3 to_m = Vector3::Constant(1e9);
    double reach_m = 0.0;
  };
  std::vector<Edge> edges_;  // where each tool has cut last, in the untouched body
  std::shared_ptr<const std::vector<std::int32_t>> opposite_;  // null: it is not cut
  std::vector<char> is_cut_;                                   // by side of the whole body
  int quiet_solutions_ = 0;                                    // in which nothing has torn
  bool is_changed_ = false;                                    // a stage, since the last order
  bool is_ordered_ = false;
  bool is_order_void_ = false;   // restored since: it will not be used
  std::future<Made> under_way_;  // in the background
  Made next_;                    // else; null: it could not be made
  double clock_s_ = 0.0;
  double ready_s_ = 0.0;
  AblationFigures figures_;
};

}  // namespace palpate::physics
