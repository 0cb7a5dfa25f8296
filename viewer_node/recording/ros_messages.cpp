#include "viewer_node/recording/ros_messages.h"

#include <bit>

#include "viewer_node/recording/mcap_format.h"

namespace palpate::viewer::ros {
namespace {

/// Numbers are aligned to their size, counted from the end of the encapsulation header.
class Cdr {
 public:
  Cdr() : bytes_("\x00\x01\x00\x00", kHead) {}

  Cdr& number(std::uint32_t value) { return aligned(value); }
  Cdr& number(double value) { return aligned(std::bit_cast<std::uint64_t>(value)); }
  Cdr& text(std::string_view text) {
    number(static_cast<std::uint32_t>(text.size() + 1));
    bytes_ += text;
    bytes_ += '\0';
    return *this;
  }
  Cdr& vector(const Vector3& v) { return number(v.x()).number(v.y()).number(v.z()); }
  Cdr& header(const Header& header) {
    constexpr std::uint64_t kSecond = 1'000'000'000;
    return number(static_cast<std::uint32_t>(header.wall_ns / kSecond))
        .number(static_cast<std::uint32_t>(header.wall_ns % kSecond))
        .text(header.frame_id);
  }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  static constexpr std::size_t kHead = 4;

  template <class Unsigned>
  Cdr& aligned(Unsigned value) {
    while ((bytes_.size() - kHead) % sizeof(Unsigned) != 0) bytes_ += '\0';
    mcap::Bytes(bytes_).number(value);
    return *this;
  }
  std::string bytes_;
};

}  // namespace

std::string pose_stamped(const Header& header, const Vector3& position_m,
                         const Quaternion& orientation) {
  return Cdr()
      .header(header)
      .vector(position_m)
      .vector(orientation.vec())
      .number(orientation.w())
      .bytes();
}

std::string wrench_stamped(const Header& header, const Vector3& force_newton,
                           const Vector3& torque_newton_m) {
  return Cdr().header(header).vector(force_newton).vector(torque_newton_m).bytes();
}

}  // namespace palpate::viewer::ros
