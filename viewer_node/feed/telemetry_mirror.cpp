// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/feed/telemetry_mirror.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "common/telemetry/quantile.h"
#include "common/telemetry/request_comparison.h"

namespace palpate::viewer {
namespace {

// t_k on the device's clock, from either half.
TimePoint sampled_at(const TelemetryMirror::JoinedTick& tick) {
  return tick.device ? tick.device->sampled_at : tick.mofc->device_sampled_at;
}

std::optional<Duration> quantile(std::vector<Duration>& values, double q) {
  if (values.empty()) return std::nullopt;
  return palpate::quantile(values, q);
}

std::optional<Duration> maximum(const std::vector<Duration>& values) {
  if (values.empty()) return std::nullopt;
  return *std::max_element(values.begin(), values.end());
}

// Ticks per second between two ticks, including lost ones.
double rate_hz(std::uint64_t ticks, Duration span) {
  return span.count() > 0 ? static_cast<double>(ticks) / to_seconds(span) : kNaN;
}

double ratio(std::uint64_t part, std::uint64_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : kNaN;
}

}  // namespace

TelemetryMirror::BatchLog::Place TelemetryMirror::BatchLog::note(const Header& header,
                                                                 TimePoint now) {
  const bool is_first = link.sessions == 0;
  // late messages of a session that has ended; after a silence it is the one that speaks again, as
  // a physics that takes over from its standby
  if (!is_first && header.session_id == superseded_session_id && !link.is_gone(now)) {
    return Place::kRefused;
  }
  if (is_first || header.session_id != session_id) {
    superseded_session_id = session_id;
    session_id = header.session_id;
    first = header.sequence;
    newest = header.sequence;
    seen = 1;
    if (std::find(known.begin(), known.end(), session_id) == known.end()) {
      known.push_back(session_id);
      link.sessions = known.size();
    }
    ++link.batches_received;
    link.heard_at = now;
    return Place::kNewest;
  }

  // late: corrects one loss, unless it was sent before the first batch counted here
  if (header.sequence <= newest) {
    const std::uint64_t behind = newest - header.sequence;
    if (behind >= 64 || ((seen >> behind) & 1U) != 0) return Place::kRefused;
    seen |= std::uint64_t{1} << behind;
    if (header.sequence > first) --link.batches_lost;
    ++link.batches_received;
    link.heard_at = now;
    return Place::kLate;
  }

  const std::uint64_t ahead = header.sequence - newest;
  seen = ahead >= 64 ? 1 : (seen << ahead) | 1U;
  newest = header.sequence;
  link.batches_lost += ahead - 1;
  ++link.batches_received;
  link.heard_at = now;
  return Place::kNewest;
}

void TelemetryMirror::take(const DeviceBatch& batch, TimePoint now) {
  const std::uint64_t session_before = device_.session_id;
  const auto place = device_.note(batch.header, now);
  if (place == BatchLog::Place::kRefused) return;
  if (place == BatchLog::Place::kNewest) {
    if (device_.session_id != session_before) answered_.clear();
    device_counters_ = batch.counters;
    device_.link.records_lost = batch.records_lost;
    device_.link.peers_refused = batch.peers_refused;
    keep_answered(now);
  }
  if (!enter_device_session(batch.header.session_id)) return;
  for (const DeviceTick& tick : batch.records) ticks_[tick.sequence].device = tick;
  hand_out_rows(false);
  forget_old_ticks();
}

void TelemetryMirror::take(const MofcBatch& batch, TimePoint now) {
  const auto place = mofc_.note(batch.header, now);
  if (place == BatchLog::Place::kRefused) return;
  if (place == BatchLog::Place::kNewest) {
    mofc_counters_ = batch.counters;
    mofc_.link.records_lost = batch.records_lost;
    mofc_.link.peers_refused = batch.peers_refused;
  }
  for (const MofcTick& tick : batch.records) {
    if (enter_device_session(tick.device_session_id)) ticks_[tick.device_sequence].mofc = tick;
  }
  hand_out_rows(false);
  forget_old_ticks();
}

void TelemetryMirror::take(const PhysicsBatch& batch, TimePoint now) {
  const std::uint64_t session_before = physics_.session_id;
  const auto place = physics_.note(batch.header, now);
  if (place == BatchLog::Place::kRefused) return;
  if (place == BatchLog::Place::kNewest) {
    if (physics_.session_id != session_before) physics_ticks_.clear();
    physics_counters_ = batch.counters;
    physics_.link.records_lost = batch.records_lost;
    physics_.link.peers_refused = batch.peers_refused;
  }
  for (const PhysicsTick& tick : batch.records) physics_ticks_[tick.sequence] = tick;
  while (physics_ticks_.size() > kMaxTicksHeld ||
         (!physics_ticks_.empty() &&
          physics_ticks_.rbegin()->second.stepped_at - physics_ticks_.begin()->second.stepped_at >
              kWindow)) {
    physics_ticks_.erase(physics_ticks_.begin());
  }
}

// Ticks of a new device session replace the window, whoever speaks of it first; those of the
// session before it are refused from then on.
bool TelemetryMirror::enter_device_session(std::uint64_t session_id) {
  if (session_id == device_session_id_) return true;
  if (session_id == superseded_device_session_id_) return false;
  flush_rows();
  ticks_.clear();
  last_row_.reset();
  superseded_device_session_id_ = device_session_id_;
  device_session_id_ = session_id;
  return true;
}

void TelemetryMirror::keep_answered(TimePoint now) {
  answered_.push_back({now, device_counters_.answered_ticks,
                       device_counters_.loop.ticks + device_counters_.loop.skipped_ticks});
  while (now - answered_.front().heard_at > kWindow) answered_.pop_front();
}

void TelemetryMirror::flush_rows() { hand_out_rows(true); }

void TelemetryMirror::hand_out_rows(bool is_last) {
  if (!on_row || ticks_.empty()) return;
  const TimePoint newest = sampled_at(ticks_.rbegin()->second);
  auto it = last_row_ ? ticks_.upper_bound(*last_row_) : ticks_.begin();
  for (; it != ticks_.end(); ++it) {
    const JoinedTick& tick = it->second;
    const bool is_over = is_last || newest - sampled_at(tick) > kJoinWait;
    const bool is_next = last_row_ && it->first == *last_row_ + 1;
    if (!is_over && !(is_next && tick.device && tick.mofc)) return;
    last_row_ = it->first;
    if (tick.device) {
      on_row({.device_session_id = device_session_id_, .device = *tick.device, .mofc = tick.mofc});
    }
  }
}

void TelemetryMirror::forget_old_ticks() {
  while (ticks_.size() > kMaxTicksHeld ||
         (!ticks_.empty() &&
          sampled_at(ticks_.rbegin()->second) - sampled_at(ticks_.begin()->second) > kWindow)) {
    ticks_.erase(ticks_.begin());
  }
}

TelemetryFigures TelemetryMirror::figures() const {
  TelemetryFigures figures;
  std::vector<Duration> lateness;
  std::vector<Duration> reply_time;
  std::vector<Duration> force_age;
  std::uint64_t clamped = 0;
  RequestComparison requests;

  // one pass over the window, oldest first, so that the newest value is what stays
  for (const auto& [sequence, tick] : ticks_) {
    if (tick.device) {
      const DeviceTick& device = *tick.device;
      ++figures.device_ticks;
      lateness.push_back(device.lateness);
      if (device.is_answered) reply_time.push_back(device.reply_time);
      figures.max_applied_newton =
          std::fmax(device.force_on_hand_newton.norm(), figures.max_applied_newton);
      if (std::isnan(figures.requested_newton)) {
        figures.applied_newton = device.force_on_hand_newton.norm();
      }
      figures.true_energy_joule = device.true_energy_joule;
      figures.guard = device.guard;
    }
    if (tick.mofc) {
      const MofcTick& mofc = *tick.mofc;
      ++figures.mofc_ticks;
      clamped += mofc.is_clamped ? 1U : 0U;
      if (mofc.state != MofcState::kNoPhysics && mofc.state != MofcState::kClutched) {
        force_age.push_back(mofc.force_age);
      }
      figures.max_requested_newton =
          std::fmax(mofc.requested_force_on_hand_newton.norm(), figures.max_requested_newton);
      figures.ledger_energy_joule = mofc.ledger_energy_joule;
      figures.mofc_state = mofc.state;
      figures.is_in_contact = mofc.is_in_contact;
    }
    if (tick.device) requests.add(*tick.device, tick.mofc);
    if (tick.device && tick.mofc) {
      const Vector3& requested_newton = tick.mofc->requested_force_on_hand_newton;
      const Vector3& applied_newton = tick.device->force_on_hand_newton;
      figures.requested_newton = requested_newton.norm();
      figures.applied_newton = applied_newton.norm();
    }
  }

  if (ticks_.size() > 1) {
    const auto& [first, oldest] = *ticks_.begin();
    const auto& [last, newest] = *ticks_.rbegin();
    figures.tick_rate_hz = rate_hz(last - first, sampled_at(newest) - sampled_at(oldest));
  }
  figures.lateness_p99 = quantile(lateness, 0.99);
  figures.lateness_max = maximum(lateness);
  figures.reply_time_p50 = quantile(reply_time, 0.5);
  figures.reply_time_p99 = quantile(reply_time, 0.99);
  figures.clamped_ratio = ratio(clamped, figures.mofc_ticks);
  figures.transparency = requests.rendered().transparency();
  figures.force_error_rms_ratio = requests.rendered().rms_error_ratio();
  figures.force_age_p50 = quantile(force_age, 0.5);
  figures.force_age_max = maximum(force_age);

  if (!answered_.empty()) {
    const Answered& from = answered_.front();
    const Answered& to = answered_.back();
    figures.answered_ratio = ratio(to.answered - from.answered, to.scheduled - from.scheduled);
    figures.answered_ratio_since_start = ratio(to.answered, to.scheduled);
  }

  if (physics_ticks_.size() > 1) {
    const auto& [first, oldest] = *physics_ticks_.begin();
    const auto& [last, newest] = *physics_ticks_.rbegin();
    figures.physics_rate_hz = rate_hz(last - first, newest.stepped_at - oldest.stepped_at);
  }
  std::vector<Duration> compute_time;
  for (const auto& [sequence, tick] : physics_ticks_) compute_time.push_back(tick.compute_time);
  figures.compute_time_p99 = quantile(compute_time, 0.99);
  return figures;
}

const TelemetryMirror::JoinedTick* TelemetryMirror::newest_of_device() const {
  const auto found = std::find_if(ticks_.rbegin(), ticks_.rend(),
                                  [](const auto& tick) { return tick.second.device.has_value(); });
  return found != ticks_.rend() ? &found->second : nullptr;
}

const TelemetryMirror::JoinedTick* TelemetryMirror::newest_joined() const {
  const auto found = std::find_if(ticks_.rbegin(), ticks_.rend(), [](const auto& tick) {
    return tick.second.device.has_value() && tick.second.mofc.has_value();
  });
  return found != ticks_.rend() ? &found->second : nullptr;
}

void note_newest_tick(std::span<const TelemetryMirror> mirrors, Marker& marker) {
  if (mirrors.size() != 1) return;
  const TelemetryMirror::JoinedTick* newest = mirrors.front().newest_of_device();
  if (newest == nullptr) return;
  marker.device_session_id = mirrors.front().device_session_id();
  marker.device_sequence = newest->device->sequence;
}

}  // namespace palpate::viewer
