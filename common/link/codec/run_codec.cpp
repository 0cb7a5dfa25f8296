// SPDX-License-Identifier: Apache-2.0
// run_codec.cpp — RunState of hop 5, hop 7: RunRequest; markers and ideal forces as recorded.
#include <algorithm>
#include <string>

#include "common/link/codec/run_wire.h"
#include "common/link/codec/viewer_codec.h"
#include "common/link/codec/wire_format.h"
#include "palpate/v1/run.pb.h"
#include "palpate/v1/viewer.pb.h"

namespace palpate {

using namespace wire;

namespace {

void expect_line(const std::string& text, std::size_t most_bytes, Verdict& verdict) {
  verdict.expect(text.size() <= most_bytes &&
                 std::none_of(text.begin(), text.end(),
                              [](unsigned char byte) { return byte < 0x20 || byte == 0x7F; }));
}

void put(const Marker& m, v1::Marker& to) {
  to.set_at_ns(m.at_ns);
  to.set_text(m.text);
  to.set_origin(m.origin);
  to.set_kind(static_cast<v1::Marker::Kind>(m.kind));
  to.set_device_session_id(m.device_session_id);
  to.set_device_sequence(m.device_sequence);
}
void check(const v1::Marker& m, Verdict& verdict) {
  expect_line(m.text(), Marker::kMostTextBytes, verdict);
  expect_line(m.origin(), Marker::kMostOriginBytes, verdict);
  verdict.expect(v1::Marker::Kind_IsValid(m.kind()));
}
void put(const ReplayState& replay, v1::ReplayState& to) {
  to.set_file(replay.file);
  to.set_position_s(replay.position_s);
  to.set_length_s(replay.length_s);
  to.set_speed_ratio(replay.speed_ratio);
  to.set_is_paused(replay.is_paused);
  to.set_begin_ns(replay.begin_ns);
  to.set_runs(replay.runs);
}
/// In place, so that strings keep their memory.
void read(const v1::Marker& m, Marker& to) {
  to.at_ns = m.at_ns();
  to.text = m.text();
  to.origin = m.origin();
  to.kind = static_cast<Marker::Kind>(m.kind());
  to.device_session_id = m.device_session_id();
  to.device_sequence = m.device_sequence();
}
void read(const v1::ReplayState& replay, ReplayState& to) {
  to.file = replay.file();
  to.position_s = replay.position_s();
  to.length_s = replay.length_s();
  to.speed_ratio = replay.speed_ratio();
  to.is_paused = replay.is_paused();
  to.begin_ns = replay.begin_ns();
  to.runs = replay.runs();
}
/// Empty if the field is left out.
template <class T>
void read(bool has, const T& value, std::optional<T>& to) {
  if (!has) {
    to.reset();
  } else if (to) {
    *to = value;
  } else {
    to = value;
  }
}

}  // namespace

void wire::put(const RunState& run, v1::Health& to) {
  for (const Marker& marker : run.markers) palpate::put(marker, *to.add_markers());
  if (run.replay) palpate::put(*run.replay, *to.mutable_replay());
}

void wire::put(const TaskState& task, v1::TaskState& to) {
  to.set_phase(static_cast<v1::TaskState::Phase>(task.phase));
  to.set_briefing(task.briefing);
  to.set_kind(static_cast<v1::TaskState::Kind>(task.kind));
  to.set_elapsed_s(task.elapsed_s);
  to.set_time_s(task.time_s);
  to.set_marks(task.marks);
  to.set_is_started_by_person(task.is_started_by_person);
  if (task.traction) {
    v1::TaskState::Traction& traction = *to.mutable_goal();
    put(task.traction->target_m, *traction.mutable_target_m());
    traction.set_tolerance_m(task.traction->tolerance_m);
    traction.set_hold_s(task.traction->hold_s);
    traction.set_held_s(task.traction->held_s);
    traction.set_is_holding(task.traction->is_holding);
    traction.set_is_at_target(task.traction->is_at_target);
  }
  for (const std::string& finding : task.findings) to.add_findings(finding);
  for (const auto& [label, value] : task.figures) {
    v1::TaskState::Figure& figure = *to.add_figures();
    figure.set_label(label);
    figure.set_value(value);
  }
}

std::string encode_marker(const Marker& marker) {
  v1::Marker wire;
  put(marker, wire);
  return wire.SerializeAsString();
}

std::optional<Marker> decode_marker(std::string_view payload) {
  v1::Marker wire;
  if (payload.size() > kMaxFrameBytes<RunRequest> ||
      !wire.ParseFromArray(payload.data(), static_cast<int>(payload.size()))) {
    return std::nullopt;
  }
  Verdict verdict;
  check(wire, verdict);
  if (verdict.error() != DecodeError::kNone) return std::nullopt;
  Marker marker;
  read(wire, marker);
  return marker;
}

std::string encode_ideal(const IdealForces& ideal) {
  v1::IdealForces wire;
  wire.set_side(ideal.side);
  for (const IdealForce& force : ideal.records) {
    v1::IdealForce& to = *wire.add_records();
    to.set_sampled_at_ns(ns(force.sampled_at));
    wire::put(force.force_on_hand_newton, *to.mutable_force_on_hand_newton());
    to.set_is_in_contact(force.is_in_contact);
    if (force.ideal_tool_position_world_m.allFinite()) {
      wire::put(force.ideal_tool_position_world_m, *to.mutable_ideal_tool_position_world_m());
    }
    if (!force.comparison) continue;
    const ForceComparison::Integrals& i = force.comparison->integrals();
    for (const double integral : {i.judged_s, i.transparency_s, i.along_n2s, i.reference_n2s,
                                  i.error_n2s, i.error_ns, i.beyond_jnd_s}) {
      to.add_integrals(integral);
    }
  }
  return wire.SerializeAsString();
}

std::optional<IdealForces> decode_ideal(std::string_view payload) {
  v1::IdealForces wire;
  if (payload.size() > kMaxFrameBytes<DeviceBatch> ||
      !wire.ParseFromArray(payload.data(), static_cast<int>(payload.size()))) {
    return std::nullopt;
  }
  Verdict verdict;
  IdealForces ideal{.side = wire.side()};
  for (const v1::IdealForce& force : wire.records()) {
    verdict.time(force.sampled_at_ns());
    verdict.require(force.has_force_on_hand_newton());
    const Vector3 newton = vector(force.force_on_hand_newton());
    for (const double component : newton) verdict.finite(component);
    const auto& i = force.integrals();
    verdict.expect(i.empty() || i.size() == 7);
    for (const double integral : i) verdict.finite(integral);
    IdealForce& read = ideal.records.emplace_back();
    read = {.sampled_at = time(force.sampled_at_ns()),
            .force_on_hand_newton = newton,
            .is_in_contact = force.is_in_contact()};
    if (force.has_ideal_tool_position_world_m()) {
      read.ideal_tool_position_world_m = vector(force.ideal_tool_position_world_m());
      for (const double component : read.ideal_tool_position_world_m) verdict.finite(component);
    }
    if (i.size() == 7) {
      read.comparison.emplace(ForceComparison::Integrals{.judged_s = i[0],
                                                         .transparency_s = i[1],
                                                         .along_n2s = i[2],
                                                         .reference_n2s = i[3],
                                                         .error_n2s = i[4],
                                                         .error_ns = i[5],
                                                         .beyond_jnd_s = i[6]});
    }
  }
  if (verdict.error() != DecodeError::kNone) return std::nullopt;
  return ideal;
}

template <>
struct WireFormat<RunState> {
  using Message = v1::RunState;

  static void fill(const RunState& m, v1::RunState& wire) {
    for (const Marker& one : m.markers) palpate::put(one, *wire.add_markers());
    if (m.replay) palpate::put(*m.replay, *wire.mutable_replay());
  }

  static void check(const v1::RunState& wire, Verdict& verdict) {
    verdict.expect(wire.markers_size() <= static_cast<int>(RunState::kMostMarkers));
    for (const v1::Marker& one : wire.markers()) palpate::check(one, verdict);
    if (!wire.has_replay()) return;
    const v1::ReplayState& replay = wire.replay();
    for (const double time_s : {replay.position_s(), replay.length_s()}) {
      verdict.number(time_s, 0.0, RunRequest::kLongest_s);
    }
    verdict.number(replay.speed_ratio(), RunRequest::kSlowest_ratio, RunRequest::kFastest_ratio);
  }

  static void read(const v1::RunState& wire, RunState& m) {
    m.markers.resize(static_cast<std::size_t>(wire.markers_size()));
    for (int i = 0; i < wire.markers_size(); ++i) {
      palpate::read(wire.markers(i), m.markers[static_cast<std::size_t>(i)]);
    }
    if (!wire.has_replay()) {
      m.replay.reset();
      return;
    }
    if (!m.replay) m.replay.emplace();
    palpate::read(wire.replay(), *m.replay);
  }
};
template class Codec<RunState>;

template <>
struct WireFormat<RunRequest> {
  using Message = v1::RunRequest;

  static void fill(const RunRequest& m, v1::RunRequest& wire) {
    if (m.marker) wire.set_marker(*m.marker);
    if (m.seek_s) wire.set_seek_s(*m.seek_s);
    if (m.is_paused) wire.set_is_paused(*m.is_paused);
    if (m.speed_ratio) wire.set_speed_ratio(*m.speed_ratio);
    if (m.is_recording) wire.set_is_recording(*m.is_recording);
    wire.set_marker_kind(static_cast<v1::Marker::Kind>(m.marker_kind));
  }

  static void check(const v1::RunRequest& wire, Verdict& verdict) {
    verdict.expect(v1::Marker::Kind_IsValid(wire.marker_kind()));
    if (wire.has_marker()) expect_line(wire.marker(), Marker::kMostTextBytes, verdict);
    if (wire.has_seek_s()) verdict.number(wire.seek_s(), 0.0, RunRequest::kLongest_s);
    if (wire.has_speed_ratio()) {
      verdict.number(wire.speed_ratio(), RunRequest::kSlowest_ratio, RunRequest::kFastest_ratio);
    }
  }

  static void read(const v1::RunRequest& wire, RunRequest& m) {
    palpate::read(wire.has_marker(), wire.marker(), m.marker);
    palpate::read(wire.has_seek_s(), wire.seek_s(), m.seek_s);
    palpate::read(wire.has_is_paused(), wire.is_paused(), m.is_paused);
    palpate::read(wire.has_speed_ratio(), wire.speed_ratio(), m.speed_ratio);
    palpate::read(wire.has_is_recording(), wire.is_recording(), m.is_recording);
    m.marker_kind = static_cast<Marker::Kind>(wire.marker_kind());
  }
};
template class Codec<RunRequest>;

}  // namespace palpate
