// SPDX-License-Identifier: Apache-2.0
#include "deploy/ros/device/process.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <map>
#include <mutex>
#include <thread>
#include <variant>

#include "common/core/check.h"
#include "common/core/time.h"
#include "common/telemetry/event_throttle.h"
#include "deploy/ros/device/device_server.h"

namespace palpate::ros {
namespace {

constexpr Duration kReportInterval = std::chrono::milliseconds(200);
/// Poses and forces are waited for; what ends by time is looked at so often.
constexpr Duration kWait = std::chrono::milliseconds(5);
constexpr std::string_view kRemedy =
    ": give device { plugin { library: \"palpate_ros_device.so\" options: \"socket=PATH …\" } }";
constexpr Duration kLongestLease = std::chrono::seconds(1);

/// The newest bits of each publisher of a topic; of one whose fields may be others none.
template <class T>
class Told {
 public:
  explicit Told(Reader<T>& reader) : reader_(reader) {}

  void note(std::uint64_t source, std::uint32_t bits) {
    has_heard_ = true;
    bits_[source] = reader_.is_known_type(source) ? bits : 0;
  }
  /// The bits that all of them have; none while one of them was not heard yet.
  [[nodiscard]] std::uint32_t of_all() {
    const std::size_t count = reader_.writers();
    if (bits_.size() != count) {
      std::erase_if(bits_, [&](const auto& one) { return !is_there(reader_.get(), one.first); });
    }
    if (count == 0 || bits_.size() != count) return 0;
    std::uint32_t all = ~0U;
    for (const auto& [source, bits] : bits_) all &= bits;
    return all;
  }
  [[nodiscard]] bool has_heard() const { return has_heard_; }

 private:
  Reader<T>& reader_;
  std::map<std::uint64_t, std::uint32_t> bits_;
  bool has_heard_ = false;
};

/// Topics on one side, the plug-in on the other. Forces are passed on by the thread of run(), poses
/// by one of its own.
class Bridge {
 public:
  Bridge(NodeContext& context, const RosDeviceOptions& options, const std::string& socket)
      : context_(context),
        server_(socket),
        node_(options.network),
        options_(options),
        topics_(options.name_space),
        poses_(node_.reader<PoseStamped>(topics_ + "/measured_cp")),
        states_(node_.reader<OperatingState>(topics_ + "/operating_state")),
        kept_states_(node_.reader_of_kept<OperatingState>(topics_ + "/operating_state")),
        buttons_(node_.reader<Joy>(topics_ + "/buttons")),
        forces_(node_.writer<WrenchStamped>(topics_ + "/servo_cf", options.offer)),
        arrivals_(node_.arrivals_of(poses_.get())),
        gate_(options.axes, options.base_frame) {
    context_.log.info("event=ros_device socket={} {} in={}/measured_cp out={}/servo_cf", socket,
                      text_of(options.network), topics_, topics_);
  }

  void run() {
    std::exception_ptr error;
    std::exception_ptr error_of_poses;
    std::jthread poses([&](const std::stop_token& stop) {
      try {
        while (!stop.stop_requested()) {
          if (node_.wait(arrivals_, kWait)) pass_poses();
        }
      } catch (...) {
        error_of_poses = std::current_exception();
        has_failed_ = true;
      }
    });
    try {
      pass_forces();
    } catch (...) {
      error = std::current_exception();
    }
    poses.request_stop();
    poses.join();
    const std::scoped_lock lock(mutex_);
    force_newton_.setZero();
    publish();
    if (error_of_poses) std::rethrow_exception(error_of_poses);
    if (error) std::rethrow_exception(error);
    context_.log.info("event=ros_device_end poses={} refused={} forces={}", counts_.poses,
                      counts_.all_refused(), counts_.forces);
  }

 private:
  struct Counts {
    std::uint64_t poses = 0;
    std::uint64_t forces = 0;
    std::array<std::uint64_t, kPoseRefusals> refused{};

    [[nodiscard]] std::uint64_t all_refused() const {
      std::uint64_t sum = 0;
      for (const std::uint64_t count : refused) sum += count;
      return sum;
    }
  };

  void pass_forces() {
    TimePoint next_report{};
    while (!context_.stop.stop_requested() && !has_failed_) {
      if (const auto force = server_.receive(wait())) take(*force);
      const TimePoint now = context_.clock.now();
      {
        const std::scoped_lock lock(mutex_);
        const bool has_peer = server_.has_peer();
        if (!has_peer) number_ = shown_ = 0;  // the next one counts anew
        if (!has_peer || now >= expires_) end_force();
      }
      if (now < next_report) continue;
      next_report = now + kReportInterval;
      report(now);
    }
  }
  /// Until the lease ends.
  [[nodiscard]] Duration wait() {
    const std::scoped_lock lock(mutex_);
    return force_newton_.isZero(0.0) ? kWait : std::min(kWait, expires_ - context_.clock.now());
  }
  /// Of the plug-in.
  void take(const ros_device_force& force) {
    const std::scoped_lock lock(mutex_);
    force_newton_ = {force.force_newton[0], force.force_newton[1], force.force_newton[2]};
    const TimePoint now = context_.clock.now();
    expires_ = TimePoint(Duration(force.expires_ns));
    // one that comes after its lease, as from a bridge that was stopped, or with none that is one
    if (!(now < expires_ && expires_ < now + kLongestLease) || !force_newton_.allFinite()) {
      force_newton_.setZero();
    }
    number_ = force.number;
    ++counts_.forces;
    publish();
  }
  void end_force() {
    if (force_newton_.isZero(0.0)) return;
    force_newton_.setZero();
    publish();
  }
  void publish() {
    const Vector3 force = gate_.in_base(force_newton_);
    static_cast<void>(forces_.write(
        {.header = header_of(static_cast<std::int64_t>(wall_clock_ns()), gate_.frame()),
         .wrench = {.force = xyz<geometry_msgs_msg_dds__Vector3_>(force), .torque = {}}}));
  }

  void pass_poses() {
    const TimePoint now = context_.clock.now();
    take_side_topics(now);
    const std::scoped_lock lock(mutex_);
    poses_.take([&](const PoseStamped& message, const Arrival& arrival) {
      const auto& p = message.pose.position;
      const auto& q = message.pose.orientation;
      DevicePose pose{.source = arrival.source,
                      .stamp_ns = wall_ns_of(message.header),
                      .frame = message.header.frame_id,
                      .position_m = {p.x, p.y, p.z},
                      .orientation = {q.w, q.x, q.y, q.z},
                      .is_known_type = poses_.is_known_type(arrival.source)};
      const PoseRefusal refusal = gate_.judge(pose, now);
      if (refusal != PoseRefusal::kNone) {
        ++counts_.refused[static_cast<std::size_t>(refusal)];
        return;
      }
      ++counts_.poses;
      // a best-effort message may have been lost: that there is no force is said again
      if (force_newton_.isZero(0.0)) publish();
      send(pose);
    });
    // what comes from now on was received after this force was published
    shown_ = number_;
  }
  void send(const DevicePose& pose) {
    const Quaternion& q = pose.orientation;
    ros_device_pose out{.wire = ROS_DEVICE_WIRE,
                        .force = shown_,
                        .buttons = held_,
                        .is_ready = is_ready_ ? 1U : 0U,
                        .position_m = {},
                        .orientation_wxyz = {q.w(), q.x(), q.y(), q.z()},
                        .received_ns = context_.clock.now().time_since_epoch().count()};
    std::copy_n(pose.position_m.data(), 3, static_cast<double*>(out.position_m));
    server_.send(out);
  }
  /// Ready while everybody who tells the state says so; held is a button that everybody holds who
  /// tells buttons. A publisher that is gone is not ready and holds none.
  void take_side_topics(TimePoint now) {
    const auto take_state = [&](const OperatingState& state, const Arrival& arrival) {
      enabled_.note(arrival.source,
                    std::string_view(state.state) == "ENABLED" && state.is_homed ? 1U : 0U);
    };
    kept_states_.take(take_state);
    states_.take(take_state);
    buttons_.take([&](const Joy& joy, const Arrival& arrival) {
      std::uint32_t held = 0;
      for (std::uint32_t i = 0; i < std::min(joy.buttons._length, 32U); ++i) {
        if (joy.buttons._buffer[i] != 0) held |= 1U << i;
      }
      pressed_.note(arrival.source, held);
      pressed_at_ = now;
    });
    const bool is_told = states_.writers() > 0;
    is_ready_ = is_told ? enabled_.of_all() != 0 : !enabled_.has_heard();
    const bool is_old = options_.button_limit && now - pressed_at_ > *options_.button_limit;
    held_ = is_old ? 0 : pressed_.of_all();
  }
  void report(TimePoint now) {
    node_.note_strangers([&](const char* event, const std::string& line) {
      context_.log.warn("event={} what=\"{}\"", event, line);
    });
    if (const std::string refused = server_.take_refusal(); !refused.empty()) {
      context_.log.warn("event=peer_refused socket={} reason=\"{}\"", server_.path(), refused);
    }
    const bool has_peer = server_.has_peer();
    if (has_peer != had_peer_) {
      context_.log.info("event=device_node {}", has_peer ? "connected" : "gone: no force");
    }
    had_peer_ = has_peer;
    Counts counts;
    {
      const std::scoped_lock lock(mutex_);
      counts = counts_;
    }
    for (std::size_t i = 0; i < kPoseRefusals; ++i) {
      const std::uint64_t due = throttles_[i].note(now, counts.refused[i] - reported_.refused[i]);
      if (due == 0) continue;
      context_.log.warn("event=pose_refused topic={}/measured_cp count={} reason=\"{}\"", topics_,
                        due, explain(static_cast<PoseRefusal>(i)));
    }
    reported_ = counts;
  }

  NodeContext& context_;
  DeviceServer server_;  // before the threads of DDS begin
  Node node_;
  const RosDeviceOptions options_;
  const std::string topics_;
  Reader<PoseStamped> poses_;
  Reader<OperatingState> states_;
  Reader<OperatingState> kept_states_;  // the newest of before, where the arm keeps it
  Reader<Joy> buttons_;
  Writer<WrenchStamped> forces_;
  Entity arrivals_;
  // of the thread of poses
  Told<OperatingState> enabled_{states_};
  Told<Joy> pressed_{buttons_};
  TimePoint pressed_at_{};
  bool is_ready_ = true;
  std::uint32_t held_ = 0;
  std::atomic<bool> has_failed_{false};
  // of both
  std::mutex mutex_;
  PoseGate gate_;
  Vector3 force_newton_ = Vector3::Zero();  // on the hand, D
  TimePoint expires_{};
  std::uint32_t number_ = 0;  // of the newest force
  std::uint32_t shown_ = 0;   // as the poses before were taken
  Counts counts_;
  // of report()
  Counts reported_;
  std::array<EventThrottle, kPoseRefusals> throttles_;
  bool had_peer_ = false;
};

}  // namespace

namespace {

/// Of a plug-in's options, "key=value key=value"; empty: not there.
std::string option_of(const std::string& options, const std::string& key) {
  const std::string text = " " + options + " ";
  const std::size_t at = text.find(" " + key + "=");
  if (at == std::string::npos) return "";
  const std::size_t from = at + key.size() + 2;
  return text.substr(from, text.find(' ', from) - from);
}

const std::string& device_options_of(const Session& session) {
  const auto* plugin = std::get_if<PluginConfig>(&session.side().driver);
  if (plugin != nullptr) return plugin->options;
  throw SetupError("the device of the session is no plug-in" + std::string(kRemedy));
}

}  // namespace

void run_ros_device(NodeContext& context, const RosDeviceOptions& options) {
  const std::string& plugin_options = device_options_of(context.session);
  const std::string socket = option_of(plugin_options, "socket");
  if (socket.empty()) {
    throw SetupError("device.plugin.options have no socket" + std::string(kRemedy));
  }
  Bridge bridge(context, options, socket);
  const std::string patience = option_of(plugin_options, "patience_ms");
  const double patience_ms =
      patience.empty() ? ROS_DEVICE_PATIENCE_MS : std::strtod(patience.c_str(), nullptr);
  const double latency_ms = 1e3 * to_seconds(context.session.side().device.latency);
  if (latency_ms < patience_ms) {
    context.log.warn(
        "event=latency_understated patience_ms={} latency_us={}: poses may be older than the "
        "session says, and the guarantee relies on it; raise device.latency_us or lower "
        "patience_ms",
        patience_ms, 1e3 * latency_ms);
  }
  bridge.run();
}

}  // namespace palpate::ros
