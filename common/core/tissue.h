// SPDX-License-Identifier: Apache-2.0
// tissue.h — what a tissue is made of: simple shapes, material, motion. Both sides of hop 3 know
// it; and the part of hop 3 with which mofc_node evaluates tissue itself, and its acknowledgement
// on hop 2.
//
// mofc_node keeps a store: up to kMaxDescribed tissues, and kTileSlots tiles of their surfaces.
// physics_node alone decides what is in which slot. It numbers the messages that carry something
// and repeats what is not acknowledged. A store that is emptied has a new id, which makes all that
// was said about the old one void.
#pragma once

#include <array>
#include <cstdint>
#include <variant>
#include <vector>

#include "common/core/time.h"
#include "common/core/vector.h"

namespace palpate {

// Ranges that no real tissue leaves. Sessions give nothing beyond them, physics_node reduces what
// it derives (forces, slopes) to them, and the codec of hop 3 refuses what exceeds them.
inline constexpr double kMaxStiffnessNewtonPerM = 1e6;  // cortical bone under a blunt tip
inline constexpr double kMaxDampingNewtonSPerM = 1e4;
inline constexpr double kMaxStiffeningNewtonPerM3 = 1e9;
inline constexpr double kMaxExponent = 5.0;  // a cone on linear tissue: 2
inline constexpr double kMinExponentDepthM = 1e-4;
inline constexpr double kMaxExponentDepthM = 0.1;
inline constexpr double kMaxFrictionCoefficient = 10.0;
inline constexpr double kMinRelaxationS = 1e-3;
inline constexpr double kMaxRelaxationS = 1e3;
inline constexpr double kMaxTissueSpeedMPerS = 10.0;  // along each axis; a heart: 0.2
inline constexpr double kMaxTissueFrequencyHz = 20.0;
inline constexpr double kMaxTissueForceNewton = 1e4;  // each component
inline constexpr double kMaxStoredEnergyJoule = 1e3;
inline constexpr double kMaxSlopeNewtonPerM = 1e7;  // ∂f/∂x: stiffness, its gradients, stiffening
inline constexpr double kMaxStiffeningNewtonPerM2 = 1e10;  // 3 k₃ p
inline constexpr double kMaxCurvaturePerM = 1e9;

/// Everything on the side of the plane opposite to `normal`.
struct HalfSpaceGeometry {
  Vector3 point_m = Vector3::Zero();
  Vector3 normal = Vector3::UnitZ();  ///< unit vector, out of the tissue
};
struct SphereGeometry {
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.01;
};
/// Aligned with the axes of W.
struct BoxGeometry {
  Vector3 center_m = Vector3::Zero();
  Vector3 size_m = Vector3::Constant(0.1);  ///< full edge lengths
};
/// All points within `radius_m` of the line from one end to the other.
struct CapsuleGeometry {
  Vector3 from_m = Vector3::Zero();
  Vector3 to_m = Vector3::Zero();  ///< equal to `from_m`: a sphere
  double radius_m = 0.01;
};
/// A ball of different stiffness and damping inside a tissue, such as a tumour; smooth transition.
struct InclusionConfig {
  Vector3 center_m = Vector3::Zero();
  double radius_m = 0.005;      ///< where half of the transition is reached
  double transition_m = 0.002;  ///< thickness of the transition
  double stiffness_newton_per_m = 0.0;
  double damping_newton_s_per_m = 0.0;
};

/// Force along the normal, k·p + b·ṗ for penetration p > 0, with the extensions of soft tissue
/// below; or, with an exponent, the law of Hunt and Crossley: k·p·(p/p₁)ⁿ⁻¹ + b·(p/p₁)ⁿ·ṗ, without
/// isotropic damping, stiffening, relaxation and inclusions.
struct KelvinVoigtMaterial {
  double stiffness_newton_per_m = 500.0;  ///< k
  double damping_newton_s_per_m = 0.0;    ///< b
  double exponent = 0.0;                  ///< n ≥ 1 of Hunt and Crossley; 0: Kelvin–Voigt
  double exponent_depth_m = 1e-3;         ///< p₁ > 0, where that law's k and b are given
  bool is_damping_isotropic = false;      ///< b acts on the tangential motion too
  bool is_adhesive = false;               ///< may pull while p > 0
  double stiffening_newton_per_m3 = 0.0;  ///< k₃: adds k₃ p³
  double relaxing_stiffness_newton_per_m = 0.0;  ///< k₁: adds k₁ (p − z), τ ż = p − z
  double relaxation_time_s = 0.0;                ///< τ
  std::vector<InclusionConfig> inclusions{};
  double friction_coefficient = 0.0;             ///< μ ≥ 0 of Coulomb friction; 0: slippery
  double friction_stiffness_newton_per_m = 0.0;  ///< tangential stiffness while the tip sticks
  double puncture_newton = 0.0;  ///< normal force at which the tip punctures; 0: never
  double cutting_newton = 0.0;   ///< largest drag of punctured tissue
};
/// Rigid oscillation of the tissue, as with breath or pulse: a sin(2πft + φ).
struct TissueMotionConfig {
  Vector3 amplitude_m = Vector3::Zero();
  double frequency_hz = 0.0;
  double phase_rad = 0.0;
};

/// A spherical tip with a straight shaft behind it.
struct ToolShape {
  double tip_radius_m = 0.0;  ///< 0: a point
  double shaft_length_m =
      0.0;  ///< from the centre of the tip to the handle, along +z of T; 0: none
  double shaft_radius_m = 0.0;
};

// --- what is sent of it ------------------------------------------------------------------------

inline constexpr std::size_t kMaxDescribed = 8;
inline constexpr std::size_t kTileSlots = 4096;
inline constexpr std::size_t kMaxTileFacets = 32;
inline constexpr std::size_t kMaxTileVertices = 32;
inline constexpr std::size_t kMaxTilePoints = 12;
inline constexpr std::size_t kMaxTilesPerMessage = 16;
/// The same of receivers that do not report theirs.
inline constexpr std::size_t kLeastTileSlots = 1024;
inline constexpr std::size_t kLeastTilesPerMessage = 4;
inline constexpr std::size_t kMaxPendingTiles = 32;
inline constexpr std::size_t kMaxDescribedInclusions = 8;

/// A surface of triangles, or a point cloud, sent in tiles.
struct TiledGeometry {
  bool is_sheet = false;  ///< open triangles: they have no inside
  bool is_cloud = false;
};
using DescribedGeometry =
    std::variant<HalfSpaceGeometry, SphereGeometry, BoxGeometry, CapsuleGeometry, TiledGeometry>;

/// All of a tissue but its tiles; W, before any motion of the tissue.
struct TissueDescription {
  std::uint32_t slot = 0;     ///< < kMaxDescribed; a new version replaces what was there, and all
                              ///< its tiles
  std::uint32_t version = 0;  ///< of the content of the slot
  std::uint32_t tissue = 0;   ///< index in the scene
  DescribedGeometry geometry{};
  KelvinVoigtMaterial material{};  ///< its list of inclusions is empty
  std::array<InclusionConfig, kMaxDescribedInclusions> inclusions{};
  std::uint32_t inclusion_count = 0;
  TissueMotionConfig motion{};
  ToolShape tool{};
};

/// 1 in the integers of a TilePoint.
inline constexpr float kTilePointScale = 32767.0F;
/// A point of a cloud with its quadric (common/contact/cloud/cloud_blend.h).
struct TilePoint {
  std::array<std::uint16_t, 3> place{};     ///< as a vertex
  std::uint16_t reach = 0;                  ///< ρ > 0, in steps of the lattice
  std::array<std::int16_t, 3> normal{};     ///< n · 32767
  std::int16_t offset = 0;                  ///< c / ρ · 32767
  std::array<std::int16_t, 6> curvature{};  ///< H ρ · 32767: xx xy xz yy yz zz
  float stiffness_ratio = 1.0F;             ///< ≥ 0

  [[nodiscard]] bool operator==(const TilePoint&) const noexcept = default;
};

/// Neighbouring triangles of one surface, or neighbouring points of a cloud; sent with its
/// description until that is acknowledged. A vertex is at `origin_m` + `step_m` · its three
/// integers; all tiles of a surface have the same origin and step, so vertices that they share
/// coincide.
struct SurfaceTile {
  std::uint32_t slot = 0;            ///< < kTileSlots; replaces what was there
  std::uint32_t described_slot = 0;  ///< of the tissue
  std::uint32_t version = 0;         ///< of the content of the slot
  Vector3 origin_m = Vector3::Zero();
  double step_m = 0.0;  ///< > 0
  std::array<std::array<std::uint16_t, 3>, kMaxTileVertices> vertices{};
  std::uint32_t vertex_count = 0;
  /// Indices of `vertices`, counter-clockwise seen from outside the tissue; no triangle is flat.
  std::array<std::array<std::uint8_t, 3>, kMaxTileFacets> facets{};
  std::uint32_t facet_count = 0;
  std::array<TilePoint, kMaxTilePoints> points{};
  std::uint32_t point_count = 0;  ///< > 0: a tile without triangles
};

/// Every facet of a described tissue, or every point of a cloud that reaches, into this region
/// around the tool (in the tissue's rest frame) is in the store or in a pending tile.
struct SurfaceCoverage {
  std::uint32_t described_slot = 0;
  std::uint32_t description_version = 0;
  CapsuleGeometry region{.radius_m = 0.0};
};
/// A tile that the store may lack: until it arrives nothing is known within this sphere, in the
/// tissue's rest frame.
struct PendingTile {
  std::uint32_t slot = 0;
  std::uint32_t described_slot = 0;
  std::uint32_t version = 0;  ///< 0: it has not been sent yet
  std::array<float, 3> center_m{};
  float radius_m = 0.0F;
};

/// Hop 3. Void unless `store_id` is that of the receiver's store.
struct SurfaceNews {
  std::uint64_t store_id = 0;  ///< 0: none
  std::uint64_t number = 0;    ///< of messages that carry something, from 1; 0: this one does not
  TissueDescription description{};
  bool has_description = false;
  std::array<SurfaceTile, kMaxTilesPerMessage> tiles{};
  std::uint32_t tile_count = 0;
  std::array<SurfaceCoverage, kMaxDescribed> coverages{};
  std::uint32_t coverage_count = 0;
  std::array<PendingTile, kMaxPendingTiles> pending{};
  std::uint32_t pending_count = 0;
};

/// Messages that SurfaceReceipts::received covers.
inline constexpr std::uint64_t kReceiptBits = 64;
/// Hop 2.
struct SurfaceReceipts {
  std::uint64_t store_id = 0;  ///< 0: the sender keeps no store
  std::uint64_t newest = 0;    ///< highest number received; 0: none
  std::uint64_t received = 0;  ///< bit i: number `newest` − i was received
  Duration loop_age{};         ///< from a DeviceState to the first use of its answer
  std::uint32_t tile_slots = kLeastTileSlots;
  std::uint32_t tiles_per_message = kLeastTilesPerMessage;  ///< at most
};

}  // namespace palpate
