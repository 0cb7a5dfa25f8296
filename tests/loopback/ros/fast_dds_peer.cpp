// SPDX-License-Identifier: Apache-2.0
// fast_dds_peer — what a node of ROS 2 does, by the other vendor's DDS (Fast DDS, the default of
// ROS 2) and with encoders of its own: nothing is shared with palpate_ros.
//
//   fast_dds_peer DOMAIN NAMESPACE source [FAULT]   servo_cp in, measured_cf out: a half-space of
//                                                   400 N/m below z = 0, or a fault
//   fast_dds_peer DOMAIN NAMESPACE listen [reliable]  prints the poses and forces that it hears
//   fast_dds_peer DOMAIN NAMESPACE read             prints the newest message of every other topic
//   fast_dds_peer DOMAIN NAMESPACE dump             prints the first message of every topic, as it
//                                                   came: hexadecimal
//   fast_dds_peer DOMAIN NAMESPACE arm [FAULT]      measured_cp, operating_state and buttons out,
//   servo_cf
//                                                   in: an arm and the hand that moves it
//
// A fault begins 1.5 mm deep after SIGUSR1: stop, repeat, nan, huge (1000 N), late (20 ms),
// too_late (300 ms), lose (three of four), reorder, flood; or at once: own_clock, wrong_hash, milli
// (in mN), other_frame, wrong_type. Ends with SIGTERM and prints what was sent and received.
//
// The arm's x points away from the person, its y to the left; the middle of its workspace is at
// z = 0.1. A fault begins after SIGUSR1: stop, repeat, nan, unhomed, let_go (of the button).
// kept_state: its state is told once, and kept. disabled: until SIGUSR1.
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <deque>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "tests/loopback/ros/fast_dds_types.h"

namespace palpate::peer {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr double kStiffness_newton_per_m = 400.0;
constexpr double kDeepEnough_m = 0.0015;
constexpr const char* kPoseHash =
    "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8";
constexpr const char* kWrenchHash =
    "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77";
constexpr const char* kStateHash =
    "RIHS01_5cc57eea589b217fe5194bf2735b91d4a7f2dd5ac1245ae657f7ea7590c2c80e";
constexpr const char* kJoyHash =
    "RIHS01_0d356c79cad3401e35ffeb75a96a96e08be3ef896b8b83841d73e890989372c5";
constexpr const char* kWrongHash =
    "RIHS01_0000000000000000000000000000000000000000000000000000000000000000";

std::atomic<bool> has_fault{false};
std::atomic<bool> has_ended{false};

/// Of this machine only, as ROS 2 is with discovery range LOCALHOST.
dds::DomainParticipantQos on_loopback(std::uint32_t domain) {
  dds::DomainParticipantQos qos = dds::PARTICIPANT_QOS_DEFAULT;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.emplace_back("127.0.0.1");
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(udp);
  for (std::uint32_t i = 0; i < 8; ++i) {
    rtps::Locator_t peer;
    rtps::IPLocator::setIPv4(peer, "127.0.0.1");
    peer.port = 7410 + 250 * domain + 2 * i;
    qos.wire_protocol().builtin.initialPeersList.push_back(peer);
  }
  return qos;
}

void set_hash(dds::UserDataQosPolicy& data, const char* hash) {
  const std::string text = std::string("typehash=") + hash + ";";
  data.setValue(std::vector<rtps::octet>(text.begin(), text.end()));
}

class Peer {
 public:
  Peer(std::uint32_t domain, std::string name_space)
      : name_space_(std::move(name_space)),
        participant_(dds::DomainParticipantFactory::get_instance()->create_participant(
            domain, on_loopback(domain))),
        pose_type_(new StampedType<7>("geometry_msgs::msg::dds_::PoseStamped_")),
        wrench_type_(new StampedType<6>("geometry_msgs::msg::dds_::WrenchStamped_")) {
    if (participant_ == nullptr) {
      std::fprintf(stderr, "fast_dds_peer: no participant in domain %u\n", domain);
      std::exit(1);
    }
    publisher_ = participant_->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
    subscriber_ = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
  }
  ~Peer() {
    participant_->delete_contained_entities();
    dds::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  dds::DataWriter* writer_of_poses() { return writer("measured_cp", pose_type_, kPoseHash); }
  dds::DataWriter* writer_of_wrenches(const char* hash, bool is_pose = false) {
    return writer("measured_cf", is_pose ? pose_type_ : wrench_type_, hash);
  }
  dds::DataWriter* writer_of_news(const char* name, const char* type, NewsType::Write write,
                                  const char* hash, bool is_kept = false) {
    return writer(name, dds::TypeSupport(new NewsType(type, write)), hash, is_kept);
  }
  /// @param is_kept  reliable, and its newest message is for those that come later, too
  dds::DataWriter* writer(const char* name, const dds::TypeSupport& type, const char* hash,
                          bool is_kept = false) {
    dds::DataWriterQos qos = dds::DATAWRITER_QOS_DEFAULT;
    qos.reliability().kind = dds::BEST_EFFORT_RELIABILITY_QOS;
    qos.durability().kind = dds::VOLATILE_DURABILITY_QOS;
    qos.history().depth = 5;
    if (is_kept) {
      qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
      qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
      qos.history().depth = 1;
    }
    set_hash(qos.user_data(), hash);
    return publisher_->create_datawriter(topic(name, type), qos);
  }
  dds::DataReader* reader(const char* name, bool is_pose, bool is_reliable,
                          dds::DataReaderListener* listener) {
    dds::DataReaderQos qos = dds::DATAREADER_QOS_DEFAULT;
    qos.reliability().kind =
        is_reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
    qos.history().depth = 5;
    set_hash(qos.user_data(), is_pose ? kPoseHash : kWrenchHash);
    return subscriber_->create_datareader(topic(name, is_pose ? pose_type_ : wrench_type_), qos,
                                          listener);
  }

  /// As a node that asks for the usual: reliable, and of `is_latched` what was before it came.
  /// @param topic  without rt/
  dds::DataReader* reader_of_words(const std::string& topic, const char* type, Read read,
                                   bool is_sensor_data, bool is_latched,
                                   dds::DataReaderListener* listener) {
    if (participant_->find_type(type).empty()) {
      dds::TypeSupport(new WordsType(type, read)).register_type(participant_);
    }
    dds::DataReaderQos qos = dds::DATAREADER_QOS_DEFAULT;
    qos.reliability().kind =
        is_sensor_data ? dds::BEST_EFFORT_RELIABILITY_QOS : dds::RELIABLE_RELIABILITY_QOS;
    if (is_latched) qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
    qos.history().depth = 10;
    qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
    return subscriber_->create_datareader(
        participant_->create_topic("rt/" + topic, type, dds::TOPIC_QOS_DEFAULT), qos, listener);
  }
  [[nodiscard]] const std::string& name_space() const { return name_space_; }

 private:
  dds::Topic* topic(const char* name, const dds::TypeSupport& type) {
    type.register_type(participant_);
    return participant_->create_topic("rt/" + name_space_ + "/" + name, type.get_type_name(),
                                      dds::TOPIC_QOS_DEFAULT);
  }

  std::string name_space_;
  dds::DomainParticipant* participant_;
  dds::TypeSupport pose_type_;
  dds::TypeSupport wrench_type_;
  dds::Publisher* publisher_ = nullptr;
  dds::Subscriber* subscriber_ = nullptr;
};

/// Answers each pose, on the thread that receives it.
class Source final : public dds::DataReaderListener {
 public:
  Source(Peer& peer, std::string fault)
      : fault_(std::move(fault)),
        writer_(peer.writer_of_wrenches(fault_ == "wrong_hash" ? kWrongHash : kWrenchHash,
                                        fault_ == "wrong_type")) {
    reader_ = peer.reader("servo_cp", true, false, this);
  }
  ~Source() override { reader_->set_listener(nullptr); }
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;

  void on_data_available(dds::DataReader* reader) override {
    Pose pose;
    dds::SampleInfo info;
    while (reader->take_next_sample(&pose, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      ++received_;
      answer(pose);
    }
  }
  /// Beside the answers; until the end.
  void run() {
    while (!has_ended) {
      std::this_thread::sleep_for(fault_ == "flood" && is_wrong_ ? 0ms : 1ms);
      const std::scoped_lock lock(mutex_);
      if (fault_ == "repeat" && is_wrong_) write(last_);
      if (fault_ == "flood" && is_wrong_) {
        for (int i = 0; i < 100; ++i) write(last_);
      }
      while (!late_.empty() && late_.front().due <= Clock::now()) {
        write(late_.front().wrench);
        late_.pop_front();
      }
    }
    std::printf("received=%llu sent=%llu\n", static_cast<unsigned long long>(received_.load()),
                static_cast<unsigned long long>(sent_));
  }

 private:
  struct Late {
    Clock::time_point due;
    Wrench wrench;
  };

  void answer(const Pose& pose) {
    const std::scoped_lock lock(mutex_);
    Wrench wrench{.sec = pose.sec, .nanosec = pose.nanosec};
    wrench.numbers[2] = kStiffness_newton_per_m * std::max(0.0, -pose.numbers[2]);
    if (fault_ == "own_clock") {
      const std::int64_t now_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
                                      std::chrono::system_clock::now().time_since_epoch())
                                      .count();
      wrench.sec = static_cast<std::int32_t>(now_ns / 1'000'000'000);
      wrench.nanosec = static_cast<std::uint32_t>(now_ns % 1'000'000'000);
    }
    if (fault_ == "milli") wrench.numbers[2] *= 1000.0;
    if (fault_ == "other_frame") wrench.frame = "ft_sensor";
    is_wrong_ = is_wrong_ || (has_fault && pose.numbers[2] < -kDeepEnough_m);
    if (is_wrong_ && fault_ == "stop") return;
    if (is_wrong_ && fault_ == "repeat") return;
    if (is_wrong_ && fault_ == "nan") wrench.numbers[2] = std::numeric_limits<double>::quiet_NaN();
    if (is_wrong_ && fault_ == "huge") wrench.numbers = {0.0, 0.0, 1000.0, 0.0, 0.0, 0.0};
    if (is_wrong_ && (fault_ == "late" || fault_ == "too_late")) {
      late_.push_back({Clock::now() + (fault_ == "late" ? 20ms : 300ms), wrench});
      return;
    }
    if (is_wrong_ && fault_ == "lose" && ++answers_ % 4 != 0) return;
    if (is_wrong_ && fault_ == "reorder" && ++answers_ % 2 == 1) {
      held_ = wrench;
      return;
    }
    if (fault_ == "wrong_type") {
      Pose other{.sec = pose.sec, .nanosec = pose.nanosec};
      if (writer_->write(&other)) ++sent_;
      return;
    }
    write(wrench);
    last_ = wrench;
    if (is_wrong_ && fault_ == "reorder") write(held_);
  }
  void write(Wrench& wrench) {
    if (writer_->write(&wrench)) ++sent_;
  }

  const std::string fault_;
  dds::DataWriter* writer_;
  dds::DataReader* reader_ = nullptr;
  std::mutex mutex_;
  std::atomic<bool> is_wrong_{false};
  std::atomic<std::uint64_t> received_{0};
  std::uint64_t sent_ = 0;
  std::uint64_t answers_ = 0;
  Wrench last_;
  Wrench held_;
  std::deque<Late> late_;
};

/// Of one topic.
template <class T>
class Ear final : public dds::DataReaderListener {
 public:
  void on_data_available(dds::DataReader* reader) override {
    T message;
    dds::SampleInfo info;
    while (reader->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      const std::scoped_lock lock(mutex_);
      newest_ = message;
      ++count_;
    }
  }
  void print(const char* name) {
    const std::scoped_lock lock(mutex_);
    std::printf("%s=%llu frame=%s", name, static_cast<unsigned long long>(count_),
                newest_.frame.c_str());
    for (const double number : newest_.numbers) std::printf(" %.6f", number);
    std::printf("\n");
  }

 private:
  std::mutex mutex_;
  T newest_;
  std::uint64_t count_ = 0;
};

void listen(Peer& peer, bool is_reliable) {
  Ear<Pose> poses;
  Ear<Wrench> wrenches;
  const std::array readers{peer.reader("measured_cp", true, is_reliable, &poses),
                           peer.reader("measured_cf", false, is_reliable, &wrenches)};
  while (!has_ended) {
    std::this_thread::sleep_for(100ms);
    poses.print("measured_cp");
    wrenches.print("measured_cf");
    std::fflush(stdout);
  }
  for (dds::DataReader* reader : readers) reader->set_listener(nullptr);
}

/// An arm of 45 g with friction, and a hand that holds it by a spring and presses it down every
/// second. What the hand has put in is counted here, from its own force and motion.
class Arm final : public dds::DataReaderListener {
 public:
  Arm(Peer& peer, std::string fault)
      : fault_(std::move(fault)),
        poses_(peer.writer_of_poses()),
        states_(peer.writer_of_news("operating_state", "crtk_msgs::msg::dds_::OperatingState_",
                                    &write_state, kStateHash, fault_ == "kept_state")),
        buttons_(
            peer.writer_of_news("buttons", "sensor_msgs::msg::dds_::Joy_", &write_joy, kJoyHash)),
        reader_(peer.reader("servo_cf", false, false, this)) {}
  ~Arm() override { reader_->set_listener(nullptr); }
  Arm(const Arm&) = delete;
  Arm& operator=(const Arm&) = delete;

  /// Without a next one a force goes on.
  void on_data_available(dds::DataReader* reader) override {
    Wrench wrench;
    dds::SampleInfo info;
    while (reader->take_next_sample(&wrench, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      const std::scoped_lock lock(mutex_);
      ++forces_;
      std::copy_n(wrench.numbers.begin(), 3, force_newton_.begin());
      frame_ = wrench.frame;
    }
  }
  void run() {
    const Clock::time_point began = Clock::now();
    Clock::time_point moved_until = began;
    std::uint64_t tick = 0;
    Clock::time_point fault_at{};
    double zero_after_ms = -1.0;
    Pose pose;
    ArmNews news{.buttons = {1}};
    while (!has_ended) {
      std::this_thread::sleep_until(began + ++tick * 1ms);
      const Clock::time_point now = Clock::now();
      const bool is_wrong = has_fault && (fault_at != Clock::time_point{} || place_m_[2] < 0.097);
      if (is_wrong && fault_at == Clock::time_point{}) fault_at = now;
      std::array<double, 3> force;
      {
        const std::scoped_lock lock(mutex_);
        force = force_newton_;
      }
      move(std::chrono::duration<double>(now - began).count(),
           std::chrono::duration<double>(now - moved_until).count(), force);
      moved_until = now;
      const double norm = std::hypot(force[0], force[1], force[2]);
      largest_newton_ = std::max(largest_newton_, norm);
      if (is_wrong && zero_after_ms < 0.0 && norm == 0.0) {
        zero_after_ms = std::chrono::duration<double, std::milli>(now - fault_at).count();
      }
      if (is_wrong && fault_ == "unhomed") news.is_homed = false;
      if (is_wrong && fault_ == "let_go") news.buttons = {0};
      if (fault_ == "disabled") news.state = has_fault ? "ENABLED" : "DISABLED";
      if (fault_ == "kept_state" ? tick == 1 : tick % 20 == 0) states_->write(&news);
      if (tick % 20 == 0) buttons_->write(&news);
      if (is_wrong && fault_ == "stop") continue;
      if (!(is_wrong && fault_ == "repeat")) {
        const auto wall = std::chrono::duration_cast<std::chrono::nanoseconds>(
                              std::chrono::system_clock::now().time_since_epoch())
                              .count();
        pose.sec = static_cast<std::int32_t>(wall / 1'000'000'000);
        pose.nanosec = static_cast<std::uint32_t>(wall % 1'000'000'000);
        pose.frame = "base";
        pose.numbers = {place_m_[0], place_m_[1], place_m_[2], 0.0, 0.0, 0.0, 1.0};
        if (is_wrong && fault_ == "nan") {
          pose.numbers[2] = std::numeric_limits<double>::quiet_NaN();
        }
      }
      poses_->write(&pose);
    }
    std::printf(
        "ticks=%llu forces=%llu frame=%s largest_newton=%.3f least_joule=%.9f last_newton=%.3f "
        "zero_after_ms=%.1f\n",
        static_cast<unsigned long long>(tick), static_cast<unsigned long long>(forces_),
        frame_.c_str(), largest_newton_, least_joule_,
        std::hypot(force_newton_[0], force_newton_[1], force_newton_[2]), zero_after_ms);
  }

 private:
  /// In steps of at most 50 µs; the force is that on the hand, in the arm's frame.
  void move(double time_s, double duration_s, const std::array<double, 3>& force) {
    constexpr double kMass_kg = 0.045;
    constexpr double kViscous = 0.1;
    constexpr double kCoulomb_newton = 0.1;
    constexpr double kSpring_newton_per_m = 300.0;
    constexpr double kDamper = 4.0;
    const int steps = 1 + static_cast<int>(duration_s / 50e-6);
    const double dt = duration_s / steps;
    for (int i = 0; i < steps; ++i) {
      const double t = time_s - duration_s + dt * i;
      const double speed = std::hypot(velocity_[0], velocity_[1], velocity_[2]);
      const std::array<double, 3> aim{0.0, 0.0, 0.1 + 0.01 * std::cos(2.0 * M_PI * t)};
      for (std::size_t k = 0; k < 3; ++k) {
        const double hand = kSpring_newton_per_m * (aim[k] - place_m_[k]) - kDamper * velocity_[k];
        const double friction = (kViscous + kCoulomb_newton / std::max(speed, 1e-3)) * velocity_[k];
        const double before = velocity_[k];
        velocity_[k] += dt / kMass_kg * (hand + force[k] - friction);
        const double step_m = 0.5 * dt * (before + velocity_[k]);
        place_m_[k] += step_m;
        put_in_joule_ += hand * step_m;
      }
      least_joule_ = std::min(least_joule_, put_in_joule_);
    }
  }

  const std::string fault_;
  dds::DataWriter* poses_;
  dds::DataWriter* states_;
  dds::DataWriter* buttons_;
  std::mutex mutex_;
  std::array<double, 3> force_newton_{};
  std::string frame_;
  std::uint64_t forces_ = 0;
  std::array<double, 3> place_m_{0.0, 0.0, 0.11};
  std::array<double, 3> velocity_{};
  double put_in_joule_ = 0.0;
  double least_joule_ = 0.0;
  double largest_newton_ = 0.0;
  dds::DataReader* reader_;
};

/// Prints each message of a topic that is not like the one before, at most ten a second.
class Reading final : public dds::DataReaderListener {
 public:
  void on_data_available(dds::DataReader* reader) override {
    Words words;
    dds::SampleInfo info;
    while (reader->take_next_sample(&words, &info) == ReturnCode_t::RETCODE_OK) {
      const std::scoped_lock lock(mutex_);
      if (!info.valid_data) continue;
      newest_ = words.text;
      if (first_.empty()) first_ = words.cdr;
    }
  }
  void print(const std::string& topic) {
    const std::scoped_lock lock(mutex_);
    if (!newest_.empty()) std::printf("%s: %s\n", topic.c_str(), newest_.c_str());
    newest_.clear();
  }
  /// Once.
  void dump(const std::string& topic, const char* type) {
    const std::scoped_lock lock(mutex_);
    if (is_dumped_ || first_.empty()) return;
    is_dumped_ = true;
    std::printf("%s %s ", topic.c_str(), type);
    for (const char byte : first_) std::printf("%02x", static_cast<unsigned char>(byte));
    std::printf("\n");
  }

 private:
  std::mutex mutex_;
  std::string newest_;
  std::string first_;  // bytes
  bool is_dumped_ = false;
};

void read_all(Peer& peer, bool is_dump) {
  struct Topic {
    std::string name;
    const char* type;
    Read read;
    bool is_sensor_data = true;
    bool is_latched = false;
  };
  const std::string prefix = peer.name_space() + "/";
  std::vector<Topic> topics{
      {prefix + "measured_cv", "geometry_msgs::msg::dds_::TwistStamped_", &read_twist},
      {prefix + "servo_cf", "geometry_msgs::msg::dds_::WrenchStamped_", &read_wrench},
      {prefix + "measured_js", "sensor_msgs::msg::dds_::JointState_", &read_joints},
      {prefix + "operating_state", "crtk_msgs::msg::dds_::OperatingState_", &read_state, false,
       true},
      {prefix + "ledger_energy_joule", "std_msgs::msg::dds_::Float64_", &read_number},
      {prefix + "true_energy_joule", "std_msgs::msg::dds_::Float64_", &read_number},
      {prefix + "clamped_ratio", "std_msgs::msg::dds_::Float64_", &read_number},
      {prefix + "tissues", "visualization_msgs::msg::dds_::Marker_", &read_marker, false, true},
      {"tf", "tf2_msgs::msg::dds_::TFMessage_", &read_frames, false},
      {"tf_static", "tf2_msgs::msg::dds_::TFMessage_", &read_frames, false, true}};
  if (is_dump) {
    topics.push_back({prefix + "measured_cp", "geometry_msgs::msg::dds_::PoseStamped_",
                      [](Cdr&) { return std::string(); }});
    topics.push_back(
        {prefix + "measured_cf", "geometry_msgs::msg::dds_::WrenchStamped_", &read_wrench});
  }
  std::deque<Reading> readings(topics.size());
  std::vector<dds::DataReader*> readers;
  for (std::size_t i = 0; i < topics.size(); ++i) {
    readers.push_back(peer.reader_of_words(topics[i].name, topics[i].type, topics[i].read,
                                           topics[i].is_sensor_data, topics[i].is_latched,
                                           &readings[i]));
  }
  while (!has_ended) {
    std::this_thread::sleep_for(100ms);
    for (std::size_t i = 0; i < topics.size(); ++i) {
      if (is_dump) {
        readings[i].dump(topics[i].name, topics[i].type);
      } else {
        readings[i].print(topics[i].name);
      }
    }
    std::fflush(stdout);
  }
  for (dds::DataReader* reader : readers) reader->set_listener(nullptr);
}

int run(int argc, char** argv) {
  if (argc < 4) return 2;
  const std::string mode = argv[3];
  const std::string more = argc > 4 ? argv[4] : "";
  std::signal(SIGUSR1, [](int) { has_fault = true; });
  std::signal(SIGTERM, [](int) { has_ended = true; });
  Peer peer(static_cast<std::uint32_t>(std::stoul(argv[1])), argv[2]);
  std::fprintf(stderr, "ready\n");
  if (mode == "source") {
    Source(peer, more).run();
  } else if (mode == "arm") {
    Arm(peer, more).run();
  } else if (mode == "read" || mode == "dump") {
    read_all(peer, mode == "dump");
  } else {
    listen(peer, more == "reliable");
  }
  return 0;
}

}  // namespace
}  // namespace palpate::peer

int main(int argc, char** argv) { return palpate::peer::run(argc, argv); }
