// elastic_simulation.h — an elastic body in motion, touched by the tips of the tools: the full
// solution.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/contact/surface_view.h"
#include "physics_node/elastic/dynamics.h"
#include "physics_node/elastic_tissue/elastic_body.h"

namespace palpate::physics {

/// Where a tip is, and the friction that acts on it.
struct TipState {
  Vector3 tip_m = Vector3::Zero();
  Vector3 friction_on_tool_newton = Vector3::Zero();
};

/// One simulation of a body; deterministic. One thread calls it; allocates.
class ElasticSimulation {
 public:
  /// @param body  must outlive it   @param step_s  > 0
  ElasticSimulation(const ElasticBody& body, std::size_t tools, double tip_radius_m, double step_s);

  /// One step of backward Euler with the tips at these places; none: the tool is not there. The
  /// sphere that the body meets follows its tip by at most half a radius of depth and a radius of
  /// way a step, so that a tool that appears inside is pushed out the way it came. The friction
  /// acts on the points that were pressed in the last step, in proportion. False: skipped, at rest
  /// and untouched.
  bool step(std::span<const std::optional<TipState>> tips);

  struct Touch {
    bool is_near = false;                ///< the tip may touch within the next steps
    Vector3 centre_m = Vector3::Zero();  ///< of the sphere in the last step
    Vector3 force_on_tool_newton = Vector3::Zero();
    std::vector<elastic::Vector3d> forces_on_body_newton;  ///< of body.points; empty: none
  };
  [[nodiscard]] const Touch& touch(std::size_t tool) const { return touches_[tool]; }
  [[nodiscard]] const elastic::VectorXd& x_m() const noexcept { return dynamics_.x_m(); }
  [[nodiscard]] elastic::EquilibriumSearch& search() noexcept { return dynamics_.search(); }
  [[nodiscard]] const elastic::StepReport& report() const noexcept { return report_; }
  [[nodiscard]] const ElasticBody& body() const noexcept { return body_; }
  [[nodiscard]] double step_s() const noexcept { return step_s_; }

  /// Equivalent strain √(⅔ dev E : dev E) at the body's surface nodes, mean of their elements.
  void surface_strain(std::vector<float>& strain) const;

 private:
  /// The potential of all spheres that are near.
  class Tips final : public elastic::Obstacle {
   public:
    std::vector<elastic::SphereContact> contacts;
    std::vector<char> is_near;
    std::vector<std::pair<std::uint32_t, Vector3>> rubbed_newton;  // by node of the body
    double add_gradient(const double* x_m, double* gradient) const override;
    void add_stiffness(const double* x_m, const elastic::BlockPattern& pattern,
                       elastic::BlockValues& values) const override;
  };

  void rub(const Touch& touch, const Vector3& friction_on_tool_newton);
  [[nodiscard]] Vector3 follow(std::size_t tool, const Vector3& tip_m);

  const ElasticBody& body_;
  double tip_radius_m_;
  double step_s_;
  elastic::Dynamics dynamics_;
  Tips tips_;
  std::vector<Touch> touches_;
  std::vector<SurfaceHint> hints_;
  elastic::StepReport report_;
};

}  // namespace palpate::physics
