// SPDX-License-Identifier: Apache-2.0
#include "common/telemetry/flight_recorder.h"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>

#include "common/core/user/files.h"

namespace palpate {
namespace {

std::string number(double value) { return std::isnan(value) ? "nan" : fmt::format("{}", value); }
std::string vector(const Vector3& v) {
  return number(v.x()) + ',' + number(v.y()) + ',' + number(v.z());
}
std::string vector_columns(const char* field) { return fmt::format("{0}_x,{0}_y,{0}_z", field); }
std::int64_t ns(TimePoint time) { return time.time_since_epoch().count(); }

}  // namespace

void write_flight_header(std::ostream& out, const DeviceTick&) {
  out << "sequence,sampled_at_ns,switched_at_ns,lateness_ns,reply_time_ns,"
      << vector_columns("measured_hand_position_m") << ','
      << vector_columns("measured_tool_position_world_m") << ','
      << vector_columns("force_on_hand_newton") << ",guard,is_answered,is_peak_limited,is_clutched,"
      << vector_columns("true_tool_position_world_m") << ','
      << vector_columns("true_tool_velocity_world_m_per_s")
      << ",true_energy_joule,minimum_true_energy_joule\n";
}

void write_flight_row(std::ostream& out, const DeviceTick& t) {
  out << t.sequence << ',' << ns(t.sampled_at) << ',' << ns(t.switched_at) << ','
      << t.lateness.count() << ',' << t.reply_time.count() << ','
      << vector(t.measured_hand_position_m) << ',' << vector(t.measured_tool_position_world_m)
      << ',' << vector(t.force_on_hand_newton) << ',' << name(t.guard) << ',' << t.is_answered
      << ',' << t.is_peak_limited << ',' << t.is_clutched << ','
      << vector(t.true_tool_position_world_m) << ',' << vector(t.true_tool_velocity_world_m_per_s)
      << ',' << number(t.true_energy_joule) << ',' << number(t.minimum_true_energy_joule) << '\n';
}

void write_flight_header(std::ostream& out, const MofcTick&) {
  out << "device_session_id,device_sequence,device_sampled_at_ns,"
      << vector_columns("requested_force_on_hand_newton") << ','
      << vector_columns("commanded_force_on_hand_newton") << ',' << vector_columns("f_max_newton")
      << ",ledger_energy_joule,force_age_ns,state,is_clamped,is_in_contact\n";
}

void write_flight_row(std::ostream& out, const MofcTick& t) {
  out << t.device_session_id << ',' << t.device_sequence << ',' << ns(t.device_sampled_at) << ','
      << vector(t.requested_force_on_hand_newton) << ',' << vector(t.commanded_force_on_hand_newton)
      << ',' << vector(t.f_max_newton) << ',' << number(t.ledger_energy_joule) << ','
      << t.force_age.count() << ',' << name(t.state) << ',' << t.is_clamped << ','
      << t.is_in_contact << '\n';
}

void write_flight_header(std::ostream& out, const PhysicsTick&) {
  out << "sequence,stepped_at_ns,device_sequence," << vector_columns("tool_position_world_m") << ','
      << vector_columns("force_on_tool_newton")
      << ",stored_energy_joule,contact_count,compute_time_ns,penetration_m,"
         "stiffness_newton_per_m\n";
}

void write_flight_row(std::ostream& out, const PhysicsTick& t) {
  out << t.sequence << ',' << ns(t.stepped_at) << ',' << t.device_sequence << ','
      << vector(t.tool_position_world_m) << ',' << vector(t.force_on_tool_newton) << ','
      << number(t.stored_energy_joule) << ',' << t.contact_count << ',' << t.compute_time.count()
      << ',' << number(t.penetration_m) << ',' << number(t.stiffness_newton_per_m) << '\n';
}

std::string new_flight_file(const FlightFiles& files) {
  const auto now = std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now());
  const std::time_t second = std::chrono::system_clock::to_time_t(now);
  const std::string name =
      fmt::format("flight-{}-{}-{:%Y%m%dT%H%M%S}.{:03}Z.csv", files.node, files.session,
                  fmt::gmtime(second), now.time_since_epoch().count() % 1000);
  std::string file = (files.folder / name).string();
  if (const std::string why = make_private_folder(files.folder); !why.empty()) {
    files.log.error("event=flight_recording_failed file={} error=\"{}\"", file, why);
    return "";
  }
  const int made = open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (made < 0) {
    files.log.error("event=flight_recording_failed file={} error=\"{}\"", file,
                    std::strerror(errno));
    return "";
  }
  close(made);
  return file;
}

void report_flight_file(const FlightFiles& files, const std::string& file, const char* reason,
                        std::size_t ticks, bool is_written) {
  if (is_written) {
    files.log.info("event=flight_recording reason={} ticks={} file={}", reason, ticks, file);
  } else {
    files.log.error("event=flight_recording_failed file={} error=\"the file is incomplete\"", file);
  }
}

}  // namespace palpate
