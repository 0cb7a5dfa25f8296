// SPDX-License-Identifier: Apache-2.0
// body_ties.h — what ties one elastic body of an island to another one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "physics_node/elastic/attached/tie.h"
#include "physics_node/elastic/condensed/condensed_contact.h"
#include "physics_node/elastic_tissue/elastic_simulation.h"

namespace palpate::physics {

/// Springs from nodes of one body, the attached one, to points of the triangles of another one. The
/// attached body has them in its own stiffness too, as if the other stood still; what a Tie does is
/// the difference. Within a step the bodies are solved one after the other: the first of the two
/// with the ends of the springs on the second where these are expected. From pass to pass the
/// expected places come nearer to those that are found, by Anderson's method of a few passes
/// [Walker11], which for bodies that are much softer than the springs needs far fewer of them.
class BodyTies {
 public:
  /// @param attached, other  members of the island
  BodyTies(std::size_t attached, std::size_t other) : members_{attached, other} {}

  /// The attached one, and the other one.
  [[nodiscard]] const std::array<std::size_t, 2>& members() const noexcept { return members_; }
  /// Before a step: those that hold.
  void look(const ElasticSimulation& attached, const ElasticSimulation& other);
  [[nodiscard]] bool is_there() const noexcept { return !all_.empty(); }
  /// The springs as one of the two has them. Appends.
  void add_ties(const ElasticSimulation& attached, const ElasticSimulation& other, bool is_other,
                std::vector<elastic::Tie>& ties) const;
  /// After a pass. @return  how much the force of a spring is off for ends that are not where they
  ///     were expected, as the depth at which a contact has that much [m]
  double update(const ElasticSimulation& attached, const ElasticSimulation& other);
  /// The end of a step: how far each has been apart.
  void tear(ElasticSimulation& attached, const ElasticSimulation& other) const;
  /// One would tear, as the bodies are.
  [[nodiscard]] bool is_tearing(const ElasticSimulation& attached,
                                const ElasticSimulation& other) const;
  /// On the attached body, by springs whose ends are where they are.
  [[nodiscard]] Vector3 force_on_attached_newton(const ElasticSimulation& attached,
                                                 const ElasticSimulation& other) const;
  /// Of the springs, as far as they give it back, less what the springs of the attached body do.
  [[nodiscard]] double stored_joule(const ElasticSimulation& attached,
                                    const ElasticSimulation& other) const;
  /// For the compliance of one of the two. Appends. @param compliance_of_other  of the two
  void add_tie_points(bool is_other, elastic::SurfaceCompliance& compliance_of_other,
                      std::vector<elastic::TiePoint>& points) const;

 private:
  struct One {
    elastic::SurfacePoint node;    // of the attached body
    elastic::SurfacePoint corner;  // of the other one
    elastic::CohesiveSpring spring = {};
    double in_body_newton_per_m = 0.0;
    Vector3 rest_m = Vector3::Zero();    // of the node
    Vector3 offset_m = Vector3::Zero();  // from the point of the other body to where it is zero
    double contact_newton_per_m = 0.0;   // of a contact in its place
    std::size_t place = 0;               // among those of Tearing
    bool tears = false;

    [[nodiscard]] bool holds() const noexcept { return spring.law.ratio(spring.farthest_m) > 0.0; }
    [[nodiscard]] elastic::Separation separation(const ElasticSimulation& attached,
                                                 const ElasticSimulation& other) const;
  };
  [[nodiscard]] bool is_first_attached() const noexcept { return members_[0] < members_[1]; }
  [[nodiscard]] std::vector<Vector3> ends(const ElasticSimulation& attached,
                                          const ElasticSimulation& other) const;
  void expect(const Eigen::VectorXd& error_m);

  std::array<std::size_t, 2> members_;
  std::vector<One> all_;
  Eigen::VectorXd expected_m_;  // ends on the second body, as the first has them
  // of the passes before, the newest last
  std::vector<Eigen::VectorXd> expectations_m_;
  std::vector<Eigen::VectorXd> errors_m_;
};

}  // namespace palpate::physics
