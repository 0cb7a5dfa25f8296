// SPDX-License-Identifier: Apache-2.0
#include "device_node/drivers/leader/c/palpate_leader.h"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "device_node/drivers/damiao/damiao_leader.h"
#include "device_node/drivers/dynamixel/dynamixel_leader.h"
#include "device_node/drivers/leader/leader.h"

using palpate::device::DamiaoJoint;
using palpate::device::DamiaoLeader;
using palpate::device::DamiaoSettings;
using palpate::device::DynamixelJoint;
using palpate::device::DynamixelLeader;
using palpate::device::DynamixelSettings;
using palpate::device::kMostLeaderJoints;
using palpate::device::Leader;
using palpate::device::LeaderJoint;
using palpate::device::LeaderReading;
using palpate::device::LeaderSettings;
using palpate::device::LeaderValues;

static_assert(kMostLeaderJoints == PALPATE_MOST_JOINTS);

struct palpate_leader {
  std::unique_ptr<Leader> arm;
  std::string text;
};

namespace {

LeaderJoint place_of(int id, const palpate_joint_place& place) {
  return {.id = id,
          .sign = place.sign,
          .offset_rad = place.offset_rad,
          .gear = place.gear,
          .lowest_rad = place.lowest_rad,
          .highest_rad = place.highest_rad,
          .fastest_rad_per_s = place.fastest_rad_per_s,
          .play_rad = place.play_rad};
}

LeaderSettings times_of(const char* port, const palpate_leader_times& times) {
  return {.port = port,
          .answer_limit_s = times.answer_limit_s,
          .longest_delay_s = times.longest_delay_s,
          .longest_cycle_s = times.longest_cycle_s};
}

DynamixelJoint joint_of(const palpate_dynamixel_joint& joint) {
  return {place_of(joint.id, joint.place), joint.torque_newton_m_per_ampere,
          joint.current_limit_ampere};
}

DamiaoJoint joint_of(const palpate_damiao_joint& joint) {
  return {place_of(joint.id, joint.place), joint.feedback_id,
          joint.model == nullptr ? "" : joint.model, joint.torque_limit_newton_m,
          joint.torque_ratio};
}

/// @param make  an arm of the joints in C++
template <class Joint, class Settings, class Make>
palpate_leader* open(const Joint* joints, size_t count, const Settings* settings, char* error,
                     size_t size, const Make& make) {
  const auto say = [&](const char* text) -> palpate_leader* {
    if (error != nullptr && size > 0) std::snprintf(error, size, "%s", text);
    return nullptr;
  };
  if (joints == nullptr || settings == nullptr || settings->port == nullptr) {
    return say("leader: joints, settings and port are needed");
  }
  try {
    std::vector<decltype(joint_of(*joints))> made;
    for (const Joint& joint : std::span(joints, std::min<size_t>(count, 99))) {
      made.push_back(joint_of(joint));
    }
    auto leader = std::make_unique<palpate_leader>();
    leader->arm = make(made);
    say("");
    return leader.release();
  } catch (const std::exception& problem) {
    return say(problem.what());
  }
}

/// Neither out of memory nor anything else reaches a caller in C.
const char* keep(palpate_leader* leader, std::string (Leader::*text)() const) noexcept {
  if (leader == nullptr) return "no arm";
  try {
    leader->text = (leader->arm.get()->*text)();
    return leader->text.c_str();
  } catch (const std::exception&) {
    return "no memory";
  }
}

}  // namespace

palpate_leader* palpate_leader_open_dynamixel(const palpate_dynamixel_joint* joints, size_t count,
                                              const palpate_dynamixel_settings* settings,
                                              char* error, size_t size) {
  return open(joints, count, settings, error, size, [&](const std::vector<DynamixelJoint>& made) {
    return std::make_unique<DynamixelLeader>(
        made,
        DynamixelSettings{times_of(settings->port, settings->times), settings->bits_per_second,
                          settings->watchdog_units, settings->may_write_eeprom != 0});
  });
}

palpate_leader* palpate_leader_open_damiao(const palpate_damiao_joint* joints, size_t count,
                                           const palpate_damiao_settings* settings, char* error,
                                           size_t size) {
  return open(joints, count, settings, error, size, [&](const std::vector<DamiaoJoint>& made) {
    return std::make_unique<DamiaoLeader>(
        made, DamiaoSettings{times_of(settings->port, settings->times), settings->is_fd != 0,
                             settings->timeout_s});
  });
}

void palpate_leader_close(palpate_leader* leader) { delete leader; }

int palpate_leader_enable(palpate_leader* leader) {
  return leader != nullptr && leader->arm->enable() ? 1 : 0;
}

int palpate_leader_read(palpate_leader* leader, palpate_leader_reading* reading) {
  if (leader == nullptr || reading == nullptr) return 0;
  *reading = {};
  LeaderReading read;
  if (!leader->arm->read(read)) return 0;
  std::copy(read.position_rad.begin(), read.position_rad.end(), reading->position_rad);
  std::copy(read.velocity_rad_per_s.begin(), read.velocity_rad_per_s.end(),
            reading->velocity_rad_per_s);
  std::copy(read.torque_newton_m.begin(), read.torque_newton_m.end(), reading->torque_newton_m);
  reading->elapsed_s = read.elapsed_s;
  reading->is_known = read.is_known ? 1 : 0;
  reading->repeated = read.repeated;
  return 1;
}

int palpate_leader_write(palpate_leader* leader, const double* torque_newton_m,
                         double* made_newton_m) {
  if (leader == nullptr || torque_newton_m == nullptr || made_newton_m == nullptr) return 0;
  LeaderValues torque{};
  std::copy_n(torque_newton_m, kMostLeaderJoints, torque.begin());
  LeaderValues made{};
  const bool is_sent = leader->arm->write(torque, made);
  std::copy(made.begin(), made.end(), made_newton_m);
  return is_sent ? 1 : 0;
}

void palpate_leader_release(palpate_leader* leader) {
  if (leader != nullptr) leader->arm->release();
}

const char* palpate_leader_error(palpate_leader* leader) {
  return keep(leader, &Leader::fault_text);
}
const char* palpate_leader_description(palpate_leader* leader) {
  return keep(leader, &Leader::description);
}

double palpate_leader_lease_s(const palpate_leader* leader) {
  return leader == nullptr ? 0.0 : leader->arm->lease_s();
}

double palpate_leader_resolution_rad(const palpate_leader* leader, size_t joint) {
  return leader == nullptr || joint >= leader->arm->count() ? 0.0
                                                            : leader->arm->resolution_rad(joint);
}

double palpate_leader_largest_torque_newton_m(const palpate_leader* leader, size_t joint) {
  return leader == nullptr || joint >= leader->arm->count()
             ? 0.0
             : leader->arm->largest_torque_newton_m(joint);
}
