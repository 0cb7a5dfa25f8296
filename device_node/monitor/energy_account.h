// SPDX-License-Identifier: Apache-2.0
// energy_account.h — the monitor's own lower bound of the energy that the hand has put in
// (docs/theory.md §2.3, §2.5). Written from the equations; shares no code with the controllers.
#pragma once

#include <array>
#include <cstdint>

#include "common/core/vector.h"
#include "common/session/device_profile.h"

namespace palpate::device {

/// M ≤ E(t) = ∫ (friction + rendered force, both resisting the hand)·v dt, from readings within
/// ±q/2 per axis and from the forces that acted between them. F is the force on the hand.
///
///   M = carried − Σ G·Δx̂ − (q/2) (|G(k−1)|₁ + |G(0)|₁ + Σ |ΔG|₁)
///       − v (s(k)|F(k−1)| + s(0)|F(0)| + Σ s|ΔF|) − Σ turning₊
///       + Σ over paths f_d Σ (|Δx̂| − w)₊²/Δt
///
/// Δ is the change at the place of the reading: of held currents, whose force there is no longer
/// the one that was reported but F(k−1) + turned, without what has turned.
///
/// G = F − h with |h| ≤ f_co: Coulomb friction dissipates at least h·d over any way d. Which h is
/// free. Here, on axis i, |hᵢ| ≤ f_co Lᵢ/|L| with L the recent path: all of that, against the hand,
/// in a step in which the reading goes on, and else what changes Gᵢ least. One path in space with
/// w = √3 q for isotropic friction, or one on each axis with w = q; Δx̂ and Δt of windows. A reading
/// and a switch that are s apart differ by up to v s, v the fastest hand, and Δt is s longer. All
/// sums are rounded down. Lemmas: telescoping, skew, held_friction, quantised_path. No allocation,
/// no throw.
class EnergyAccount {
 public:
  /// @param v_skew_m_per_s  v: finite
  /// @param turning_per_m   κ: a force that is v s away is up to κ v s larger
  explicit EnergyAccount(const DeviceProfile& profile, double v_skew_m_per_s = 0.0,
                         double turning_per_m = 0.0) noexcept;

  /// M = joule at this reading; what was before no longer counts.
  void restart(const Vector3& position_m, double joule) noexcept;

  /// Of the readings that follow.
  /// @param skew_s         s
  /// @param turning_joule  of the stretch that ends at the next one
  /// @param turned_newton  DeviceSample::turned_newton of the next one
  void next_reading(double skew_s, double turning_joule, const Vector3& turned_newton) noexcept;

  /// One force acted for `duration_s` > 0 and the position at the end was read.
  void book(double duration_s, const Vector3& force_on_hand_newton,
            const Vector3& position_at_end_m) noexcept;

  /// A force that ended by itself, and no force until the reading.
  struct Release {
    Vector3 force_on_hand_newton = Vector3::Zero();  ///< not zero
    double acted_s = 0.0;                            ///< at least
    /// and at most; less than acted_s: as long as that
    double acted_at_most_s = 0.0;
    double duration_s = 0.0;                      ///< ≥ acted_s: until the reading
    Vector3 position_at_end_m = Vector3::Zero();  ///< the reading
    double v_max_m_per_s = 0.0;                   ///< may be infinite: unknown
    double held_ratio = 1.0;  ///< ≥ 1: |F| elsewhere is at most so many times that; may be infinite
    double most_drawn_joule = 0.0;  ///< upper bound of the loss; may be infinite
  };
  /// Lemmas: release_reach, release_between, release_energy.
  void book_release(const Release& release) noexcept;

  [[nodiscard]] double joule() const noexcept;
  /// A force was booked since restart(), with the error that its work carries on.
  [[nodiscard]] bool has_worked() const noexcept { return has_worked_; }
  /// Last reading.
  [[nodiscard]] const Vector3& position_m() const noexcept { return position_m_; }

  /// Every member, to be written to a file or read from one: state_text.h.
  template <class Archive>
  void list(Archive& archive) {
    archive(resolution_m_);
    archive(v_skew_m_per_s_);
    archive(turning_per_m_);
    archive(isotropic_coulomb_newton_);
    for (Path& path : paths_) path.list(archive);
    archive(used_);
    if constexpr (Archive::kIsReading) archive.require(used_ <= paths_.size());
    archive(carried_joule_);
    archive(work_joule_);
    archive(has_worked_);
    archive(last_force_newton_);
    archive(held_newton_);
    archive(held_change_newton_);
    archive(skewed_joule_);
    archive(skew_s_);
    archive(next_skew_s_);
    archive(turning_joule_);
    archive(turned_newton_);
    archive(next_turned_newton_);
    archive(position_m_);
    archive(window_start_m_);
    archive(play_m_);
    archive(recent_path_m_);
  }

 private:
  /// Friction along one path, on the axes first … first + count − 1.
  struct Path {
    int first = 0;
    int count = 3;
    double viscous_newton_s_per_m = 0.0;
    double coulomb_newton = 0.0;
    double w_m = 0.0;

    double closed_viscous_joule = 0.0;
    double window_s = 0.0;

    template <class Archive>
    void list(Archive& archive) {
      archive(first);
      archive(count);
      archive(viscous_newton_s_per_m);
      archive(coulomb_newton);
      archive(w_m);
      archive(closed_viscous_joule);
      archive(window_s);
      if constexpr (Archive::kIsReading) {
        archive.require(first >= 0 && count >= 0 && first <= 3 && count <= 3 - first);
      }
    }
    [[nodiscard]] double norm_m(const Vector3& moved_m) const noexcept;
    [[nodiscard]] double viscous_joule(const Vector3& window_moved_m) const noexcept;
  };

  /// What a change of force by 1 N costs whose reading may be s apart from it. Lemma:
  /// turned_switch.
  [[nodiscard]] double skew_m(double skew_s) const noexcept {
    const double way_m = v_skew_m_per_s_ * skew_s;
    return way_m * (1.0 + turning_per_m_ * way_m);
  }
  void finish_reading() noexcept;
  void change_force(const Vector3& force_newton) noexcept;
  void hold(const Vector3& position_m) noexcept;
  void count_work(const Vector3& position_m) noexcept;
  void follow(const Vector3& position_m, double duration_s) noexcept;
  void begin_window(Path& path) noexcept;
  [[nodiscard]] Vector3 window_moved_m() const noexcept { return position_m_ - window_start_m_; }
  [[nodiscard]] double least_release_joule(const Release& release) const noexcept;

  double resolution_m_;
  double v_skew_m_per_s_;
  double turning_per_m_;
  double isotropic_coulomb_newton_;  // 0 with friction per axis
  std::array<Path, 3> paths_;
  std::size_t used_;

  double carried_joule_ = 0.0;
  double work_joule_ = 0.0;  // −Σ G·Δx̂
  bool has_worked_ = false;
  Vector3 last_force_newton_ = Vector3::Zero();
  Vector3 held_newton_ = Vector3::Zero();         // G(k−1)
  double held_change_newton_ = 0.0;               // |G(0)|₁ + Σ |ΔG|₁
  double skewed_joule_ = 0.0;                     // v (s(0)|F(0)| + Σ s|ΔF|)
  double skew_s_ = 0.0;                           // of the last reading
  double next_skew_s_ = 0.0;                      // of the next one
  double turning_joule_ = 0.0;                    // of the stretch up to it
  Vector3 turned_newton_ = Vector3::Zero();       // of the last reading
  Vector3 next_turned_newton_ = Vector3::Zero();  // of the next one
  Vector3 position_m_ = Vector3::Zero();
  Vector3 window_start_m_ = Vector3::Zero();  // of each axis
  Vector3 play_m_ = Vector3::Zero();          // outputs of play operators of half-width q/2
  Vector3 recent_path_m_ = Vector3::Zero();   // L: theirs
};

}  // namespace palpate::device
