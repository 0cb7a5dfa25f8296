// SPDX-License-Identifier: Apache-2.0
#include "physics_node/library/simulation.h"

#include <algorithm>
#include <utility>
#include <variant>

namespace palpate::physics {

namespace {

/// From one orientation to another, the shorter way; W.
Vector3 rotation_vector_rad(const Quaternion& from, const Quaternion& to) {
  if (from.coeffs() == to.coeffs()) return Vector3::Zero();
  const Eigen::AngleAxisd way(to * from.conjugate());
  const double angle_rad = way.angle() > M_PI ? way.angle() - 2.0 * M_PI : way.angle();
  return angle_rad * way.axis();
}

}  // namespace

Simulation::Simulation(std::shared_ptr<const SharedScene> shared, std::size_t tools, bool is_folded)
    : shared_(std::move(shared)), last_(tools) {
  if (!shared_->bodies().empty()) {
    elastic_ =
        std::make_shared<ElasticTissues>(shared_->bodies(), tools, shared_->config().tip_radius_m,
                                         is_folded ? ElasticPace::kFolded : ElasticPace::kVirtual,
                                         shared_->config().holder(), shared_->config().electrode);
  }
  for (std::size_t i = 0; i < tools; ++i) {
    tools_.emplace_back(shared_->scene(), shared_->reach_m(), elastic_, i);
  }
}

void Simulation::step(std::span<const Target> tools, Duration dt, std::uint32_t parts,
                      std::span<ToolForce> forces) {
  const TimePoint from = time_;
  for (std::uint32_t part = 1; part <= parts; ++part) {
    time_ = from + dt * part / parts;
    const double share = static_cast<double>(part) / parts;
    for (std::size_t i = 0; i < tools_.size(); ++i) {
      const ToolState& last = last_[i].value_or(tools[i].tool);
      ToolState now = tools[i].tool;
      if (!tools[i].is_velocity_known) {
        now.velocity.tip_m_per_s = (now.position_m - last.position_m) / to_seconds(dt);
      }
      now.velocity.angular_rad_per_s =
          rotation_vector_rad(last.orientation, now.orientation) / to_seconds(dt);
      now.jaw.velocity_m_per_s = now.velocity.tip_m_per_s;
      if (part < parts) {
        now.position_m = last.position_m + share * (now.position_m - last.position_m);
        now.orientation = last.orientation.slerp(share, now.orientation);
      }
      const SceneForce force = tools_[i].step(now, seconds_of(time_));
      if (part == parts) describe(tools_[i], now, force, forces[i]);
    }
  }
  for (std::size_t i = 0; i < tools_.size(); ++i) last_[i] = tools[i].tool;
}

void Simulation::describe(const SceneTool& tool, const ToolState& state, const SceneForce& force,
                          ToolForce& out) const {
  out = {.force_on_tool_newton = force.force_on_tool_newton,
         .stored_energy_joule = force.stored_energy_joule,
         .contact_count = force.contact_count};
  for (std::uint32_t i = 0; i < force.listed_count; ++i) {
    const Contact& contact = force.contacts[i];
    if (!(contact.penetration_m > 0.0)) continue;
    // elastic tissue does not say where: under the tip
    const bool is_elastic =
        std::holds_alternative<ElasticMaterial>(shared_->config().tissues[contact.tissue].material);
    const Vector3 arm_m = is_elastic
                              ? Vector3((contact.penetration_m - shared_->config().tip_radius_m) *
                                        contact.normal_world)
                              : contact.arm_m;
    TouchedPlace& place = out.places[out.place_count++];
    place = {.point_m = state.position_m + arm_m,
             .normal = contact.normal_world,
             .force_on_tool_newton = contact.force_on_tool_newton,
             .penetration_m = contact.penetration_m,
             .tissue = contact.tissue,
             .is_shaft = contact.is_shaft};
    for (std::size_t k = 0; elastic_ && k < elastic_->tissues().size(); ++k) {
      if (elastic_->tissues()[k]->body().tissue != contact.tissue) continue;
      place.error_newton = elastic_->tissues()[k]->bound_newton(tool.index());
    }
    out.error_newton += place.error_newton;
    out.torque_on_tool_newton_m += arm_m.cross(place.force_on_tool_newton);
  }
}

void Simulation::continue_as(const Simulation& other) {
  for (std::size_t i = 0; i < tools_.size(); ++i) tools_[i].continue_as(other.tools_[i]);
  if (elastic_) elastic_->continue_as(*other.elastic_);
  last_ = other.last_;
  time_ = other.time_;
}

bool Simulation::read_surface(std::size_t tissue, std::vector<float>& vertices_m,
                              std::vector<float>& strain) const {
  for (std::size_t k = 0; elastic_ && k < elastic_->tissues().size(); ++k) {
    const ElasticTissue& one = *elastic_->tissues()[k];
    if (one.body().tissue != tissue) continue;
    const auto body = one.read_surface(vertices_m, strain);
    vertices_m.resize(3 * body->surface_nodes.size());  // without those of its parts
    strain.resize(body->surface_nodes.size());
    return true;
  }
  return false;
}

}  // namespace palpate::physics
