// SPDX-License-Identifier: Apache-2.0
// wrench_gate.h — which forces of a source beyond our control are taken, and which pose of the tool
// each of them answers. Knows nothing of how they come.
//
// A source that puts the stamp of the pose into its answer says what it answers: the force is
// compared with the tissue where the tool was, and its age is known. Stamps of a clock of its own
// only tell the order: such a force counts for the newest pose. After a second in which nothing
// came they may begin anew.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "common/core/messages.h"
#include "deploy/ros/dds/one_source.h"

namespace palpate::ros {

/// More than twice the shortest time of an answer and this, and a source is behind.
inline constexpr Duration kMostBehind = std::chrono::milliseconds(50);
/// An answer to a pose that is older is refused.
inline constexpr Duration kOldestAnswer = std::chrono::milliseconds(200);

struct WrenchSettings {
  std::string world_frame = "world";  ///< a wrench in this frame is in W
  std::string tool_frame = "tool";    ///< one in this frame turns with the tool
  double max_force_newton = 100.0;    ///< of a force that is taken
  bool is_on_tissue = false;          ///< the source tells the force on the tissue: negated
};

/// As received.
struct Wrench {
  std::uint64_t source = 0;  ///< which writer; not 0
  std::int64_t stamp_ns = 0;
  std::string_view frame;
  Vector3 force_newton = Vector3::Zero();
  bool is_known_type = true;  ///< false: its fields may be others
};

/// Why a wrench is not taken.
enum class WrenchRefusal : std::uint8_t {
  kNone,
  kUnknownType,
  kOtherSource,  ///< another one is heard
  kNotFinite,
  kUnknownFrame,
  kTooLarge,
  kNotNewer,     ///< repeated or reordered
  kTooLate,      ///< it answers a pose older than kOldestAnswer, perhaps forgotten
  kUnknownPose,  ///< no pose with its stamp was sent
};
inline constexpr std::size_t kWrenchRefusals = 9;
/// For people: what it is and what helps.
[[nodiscard]] const char* explain(WrenchRefusal refusal);

/// A pose of the tool that has gone out.
struct SentPose {
  std::int64_t stamp_ns = 0;
  std::uint64_t device_session_id = 0;
  std::uint64_t device_sequence = 0;
  TimePoint device_sampled_at{};
  Vector3 position_m = Vector3::Zero();             ///< W
  Quaternion orientation = Quaternion::Identity();  ///< W from T
  Vector3 velocity_m_per_s = Vector3::Zero();       ///< W
};

/// A force that counts.
struct TakenForce {
  SentPose answers;
  Vector3 force_on_tool_newton = Vector3::Zero();  ///< W
  std::optional<Duration> age{};                   ///< of the pose; none: it names none
};

/// Of one tool. One thread; no allocation.
class WrenchGate {
 public:
  explicit WrenchGate(WrenchSettings settings) : settings_(std::move(settings)) {}

  /// To be called for every pose. @param stamp_ns  larger than that of the pose before
  void sent(const ToolMotion& motion, std::int64_t stamp_ns) noexcept;

  /// @param now     own clock    @param now_ns  the clock of the stamps of poses
  /// @param taken   set unless it is refused
  [[nodiscard]] WrenchRefusal judge(const Wrench& wrench, TimePoint now, std::int64_t now_ns,
                                    TakenForce& taken) noexcept;

  /// Whether the newest pose that a force of any age has named is older than such answers take:
  /// poses wait somewhere on the way, and more of them would only wait longer.
  [[nodiscard]] bool is_behind(std::int64_t now_ns) const noexcept {
    return newest_named_ns_ > 0 &&
           now_ns - newest_named_ns_ > 2 * shortest_answer_ns_ + kMostBehind.count();
  }

  /// When the last force was taken; none: not yet.
  [[nodiscard]] std::optional<TimePoint> taken_at() const noexcept { return source_.taken_at(); }
  /// Whose that was; 0: none yet.
  [[nodiscard]] std::uint64_t source() const noexcept { return source_.source(); }

 private:
  static constexpr std::size_t kPoses = 1024;

  [[nodiscard]] const SentPose* newest() const noexcept;
  [[nodiscard]] const SentPose* with_stamp(std::int64_t stamp_ns) const noexcept;
  [[nodiscard]] bool was_sent(std::int64_t stamp_ns) const noexcept;

  WrenchSettings settings_;
  std::array<SentPose, kPoses> poses_{};  // a ring
  std::uint64_t sent_ = 0;
  OneSource source_;          // of the last force that was taken
  bool names_poses_ = false;  // that source does
  std::int64_t first_sent_ns_ = 0;
  std::int64_t last_named_ns_ = 0;    // of the newest pose whose answer was taken
  std::int64_t newest_named_ns_ = 0;  // likewise, taken or not
  std::int64_t shortest_answer_ns_ = std::numeric_limits<std::int64_t>::max();  // if there is one
  TimePoint heard_at_{};  // a message of the source, taken or not
};

}  // namespace palpate::ros
