// SPDX-License-Identifier: Apache-2.0
// elastic_reference.h — what an elastic body does to one tool without condensed model and delay: a
// full solution at every step, for comparison.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "physics_node/elastic_tissue/ablation/ablation.h"
#include "physics_node/elastic_tissue/blade/blade_sweep.h"
#include "physics_node/elastic_tissue/body_compliance.h"
#include "physics_node/elastic_tissue/elastic_contact.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"
#include "physics_node/elastic_tissue/jaw.h"
#include "physics_node/elastic_tissue/needle/piercing.h"
#include "physics_node/elastic_tissue/touching/touching_bodies.h"
#include "physics_node/scene/scene_force.h"

namespace palpate::physics {

/// The elastic bodies of a scene under one tip. Not for the haptic step: milliseconds a step.
class ElasticReference {
 public:
  /// @param bodies  may be empty   @param step_s  > 0
  /// @param gripper, electrode  none: the tool only touches. A needle goes in along −z, a blade
  /// where
  ///     it faces in an upright tool
  ElasticReference(std::vector<std::shared_ptr<const ElasticBody>> bodies, double tip_radius_m,
                   double step_s, const std::optional<GripperConfig>& gripper = {},
                   const std::optional<ElectrodeConfig>& electrode = {});

  /// Makes a step with the tip there whenever one is due, and adds the contacts: at a step the
  /// force is that of the full solution, between two it follows Hertz's law.
  /// @param time_s     not before that of the last call
  /// @param is_closed  the jaws; they slip, tear and lose as SlippingJaw says, at every step
  /// @param is_energised  the electrode: elements take up their doses at every step here, and the
  ///     bodies that are left come as late as in a simulation (Ablation::kLatency_s)
  void advance(double time_s, const Vector3& tip_m, SceneForce& sum, bool is_closed = false,
               bool is_energised = false);

  /// The force on a tip elsewhere since the last step, by that law.
  [[nodiscard]] Vector3 force_at(const Vector3& tip_m) const noexcept;

  /// As they are in the session.
  [[nodiscard]] std::vector<std::shared_ptr<const ElasticBody>> bodies() const { return whole_; }

  /// Full solutions that failed (elastic_simulation.h).
  [[nodiscard]] std::uint64_t failed_steps() const noexcept;

 private:
  struct One {
    std::shared_ptr<const ElasticBody> whole;
    std::shared_ptr<const ElasticBody> body;
    std::unique_ptr<ElasticSimulation> simulation;
    TipSide side{};
    double stiffness_newton_per_m = 0.0;
    Contact contact{};
    Rubbing rubbing{};
    Vector3 full_newton = Vector3::Zero();         // on the tool
    std::shared_ptr<BodyCompliance> compliance{};  // with a gripper or an electrode
    std::unique_ptr<Ablation> ablation{};          // with an electrode or a blade
    Jaw held{};
    SlippingJaw jaw{};
    Vector3 velocity_m_per_s = Vector3::Zero();  // of the tool that holds it, at the last step
    Piercing piercing{};
    std::uint32_t punctures = 0;
    bool is_leaving = false;  // a blade that is through; its tip is still in the body
    BladeSweep sweep{};
    std::array<std::optional<TipState>, 1> tips{};  // of this step
  };
  [[nodiscard]] Vector3 force_at(const One& one, const Vector3& tip_m) const noexcept;
  void prepare(One& one, const Vector3& tip_m, double time_s) const;
  void step();
  void read(One& one, const Vector3& tip_m) const;
  void close(const Vector3& tip_m, bool is_closed);
  void hold(One& one, const Vector3& tip_m) const;
  void pierce(One& one, const Vector3& tip_m) const;
  void change_body(One& one) const;

  std::vector<std::shared_ptr<const ElasticBody>> whole_;
  double tip_radius_m_;
  double step_s_;
  std::optional<GripperConfig> gripper_;
  std::optional<double> next_s_;
  bool is_closed_ = false;
  std::uint32_t closings_ = 0;
  std::vector<One> bodies_;
  std::vector<std::vector<std::size_t>> members_;  // of each island
  std::vector<Island> islands_;
  Vector3 tip_m_ = Vector3::Zero();  // of the last step
};

}  // namespace palpate::physics
