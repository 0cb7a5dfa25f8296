// SPDX-License-Identifier: Apache-2.0
#include "viewer_node/recording/replay.h"

#include <signal.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <map>
#include <vector>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/link/scene_sender.h"
#include "common/link/zmq_sender.h"
#include "common/process/blocked_signals.h"
#include "common/process/process_links.h"
#include "common/process/run_host.h"
#include "common/process/run_node.h"
#include "common/session/session_file.h"
#include "viewer_node/feed/scene_mirror.h"
#include "viewer_node/recording/recording_copy.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {
namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(20);
/// Time in which a viewer that runs already subscribes.
constexpr Duration kNoticeAfter = std::chrono::milliseconds(300);

/// Waits for SIGINT, SIGTERM and SIGHUP. Construct it before any thread, so that all block them.
class StopSignals {
 public:
  /// Waits for at most `wait`; true if a signal arrived.
  [[nodiscard]] bool came_within(Duration wait) const {
    const auto ns = std::max<std::int64_t>(wait.count(), 0);
    const timespec time{.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
    return sigtimedwait(&blocked_.set(), nullptr, &time) > 0;
  }

 private:
  BlockedSignals blocked_{SIGINT, SIGTERM, SIGHUP};
};

Session session_of(const ReplayOptions& options, const RecordingFile& recording) {
  if (!options.session_file.empty()) {
    return load_session(options.session_file, options.overrides);
  }
  try {
    return recorded_session(recording, options.overrides);
  } catch (const SetupError& error) {
    throw SetupError(std::string(error.what()) +
                     "\nthe recorded session cannot be loaded here; give one with --session");
  }
}

/// The nodes' publishing ends of hop 5.
class Stage {
 public:
  explicit Stage(const Session& session)
      : links_({.priority = 0, .cpu = -1},
               tcp_rules(session.security, {KeyRole::kDevice, KeyRole::kPhysics})),
        physics_(links_.side, bind_to(session.physics_telemetry, "links.physics_telemetry")) {
    for (const palpate::Side& side : session.sides) {
      sides_.try_emplace(side.name, side.links, links_);
    }
  }

  /// Starts a pass, like a restart of all nodes. @param scene  the first of the recording, or null
  void begin(const SceneState* scene) {
    ids_.clear();
    scene_ = {};
    if (scene != nullptr) show(*scene);
  }

  void show(DeviceBatch batch) {
    renew(batch.header);
    of(batch.side).device.send(batch);
  }
  void show(MofcBatch batch) {
    renew(batch.header);
    for (MofcTick& tick : batch.records) tick.device_session_id = new_id(tick.device_session_id);
    of(batch.side).mofc.send(batch);
  }
  void show(PhysicsBatch batch) {
    renew(batch.header);
    physics_.send(batch);
  }
  void show(SceneState scene) {
    renew(scene.header);
    scene.pointer.reset();  // no hand to lead
    scene_.take(scene);
    physics_.send(scene);
  }
  void show(MeshFrame frame) {
    renew(frame.header);
    if (scene_.take(frame)) physics_.send(frame);
  }

  [[nodiscard]] ZmqContext& context() { return links_.side; }

  /// Whether a viewer subscribes to all of them.
  [[nodiscard]] bool has_viewer() {
    return physics_.has_subscriber<PhysicsBatch>() &&
           std::all_of(sides_.begin(), sides_.end(), [](auto& side) {
             return side.second.device.has_subscriber() && side.second.mofc.has_subscriber();
           });
  }

  /// Whether a page shows the scene: viewers take the meshes only while one does.
  [[nodiscard]] bool has_page() { return physics_.has_subscriber<MeshFrame>(); }

  /// Sends scene and meshes to viewers that subscribed since the last call.
  void serve_newcomers() {
    const std::uint64_t scenes = physics_.subscriptions<SceneState>();
    if (scenes > scenes_served_ && scene_.scene()) physics_.send(*scene_.scene());
    scenes_served_ = scenes;
    const std::uint64_t meshes = physics_.subscriptions<MeshFrame>();
    if (meshes > meshes_served_) {
      for (const MeshFrame& frame : scene_.whole_frames()) physics_.send(frame);
    }
    meshes_served_ = meshes;
  }

 private:
  struct Side {
    Side(const LinksConfig& endpoints, ProcessLinks& links)
        : device(links.side, bind_to(endpoints.device_telemetry, "links.device_telemetry")),
          mofc(links.side, bind_to(endpoints.mofc_telemetry, "links.mofc_telemetry")) {}
    ZmqSender<DeviceBatch> device;
    ZmqSender<MofcBatch> mofc;
  };

  Side& of(const std::string& name) {
    const auto side = sides_.find(name);
    if (side != sides_.end()) return side->second;
    throw SetupError("the session has no side \"" + name +
                     "\" of the recording; give the recorded session");
  }
  std::uint64_t new_id(std::uint64_t recorded) {
    const auto [it, is_new] = ids_.try_emplace(recorded, 0);
    if (is_new) it->second = random_session_id();
    return it->second;
  }
  void renew(Header& header) { header.session_id = new_id(header.session_id); }

  ProcessLinks links_;
  std::map<std::string, Side> sides_;
  SceneSender physics_;
  std::map<std::uint64_t, std::uint64_t> ids_;  // recorded → of this pass
  viewer::SceneMirror scene_;
  std::uint64_t scenes_served_ = 0;
  std::uint64_t meshes_served_ = 0;
};

std::optional<SceneState> first_scene(RecordingFile& recording) {
  recording.seek(0);
  while (const RecordingFile::Item* item = recording.next()) {
    if (const auto* scene = std::get_if<SceneState>(&item->message)) return *scene;
  }
  return std::nullopt;
}

/// The position of a replay on the recording's own time, which viewers move, stop and speed up.
class Playhead {
 public:
  Playhead(ReplayState& state, const Clock& clock) : state_(state), clock_(clock) { restart(); }

  /// Now, seconds since the beginning of the recording.
  [[nodiscard]] double position_s() const {
    if (state_.is_paused) return anchor_s_;
    const double moved_s = to_seconds(clock_.now() - anchored_at_) * state_.speed_ratio;
    return std::min(anchor_s_ + moved_s, state_.length_s);
  }
  /// Real time until the playhead is there; for a replay that is not paused.
  [[nodiscard]] Duration until(double position_s) const {
    return from_seconds((position_s - this->position_s()) / state_.speed_ratio);
  }

  void move_to(double position_s) {
    state_.position_s = std::clamp(position_s, 0.0, state_.length_s);
    restart();
  }
  void set_paused(bool is_paused) {
    state_.position_s = position_s();
    state_.is_paused = is_paused;
    restart();
  }
  void set_speed(double ratio) {
    state_.position_s = position_s();
    state_.speed_ratio = ratio;
    restart();
  }

 private:
  void restart() {
    anchor_s_ = state_.position_s;
    anchored_at_ = clock_.now();
  }

  ReplayState& state_;
  const Clock& clock_;
  double anchor_s_ = 0.0;
  TimePoint anchored_at_;
};

/// One replay: the recording, what is published of it, and the viewers' requests.
class Replay {
 public:
  Replay(const ReplayOptions& options, RecordingFile& recording, Session session)
      : options_(options),
        recording_(recording),
        session_(std::move(session)),
        stage_(session_),
        scene_(first_scene(recording)),
        seams_ns_(viewer::seams_of(recording.mcap())),
        host_(stage_.context(), clock_, session_),
        run_{.header = {},
             .markers = recording.markers(),
             .replay = ReplayState{.file = recording.mcap().path(),
                                   .position_s = options.start_s,
                                   .length_s = recording.length_s(),
                                   .speed_ratio = options.speed_ratio,
                                   .begin_ns = recording.mcap().begin_ns()}},
        playhead_(*run_.replay, clock_) {}

  void run() {
    has_own_page_ = options_.start_page && options_.start_page(session_);
    if (!wait_for_viewer()) return;
    seek(options_.start_s);
    run_.replay->runs = 1;
    for (;;) {
      const RecordingFile::Item* item = recording_.next();
      if (item == nullptr) {
        if (!come_to_end()) return;
        continue;
      }
      switch (wait_for(seconds_of(*item))) {
        case Wait::kDue:
          note_run(item->log_time_ns);
          std::visit([&](const auto& message) { show(message); }, item->message);
          has_shown_ = true;
          break;
        case Wait::kMoved:
          break;  // next() continues elsewhere
        case Wait::kStopped:
          return;
      }
    }
  }

 private:
  enum class Wait { kDue, kMoved, kStopped };

  void show(const RunState&) {}  // of the recorded run: its markers are in run_
  template <class T>
  void show(const T& message) {
    stage_.show(message);
  }

  [[nodiscard]] double seconds_of(const RecordingFile::Item& item) const {
    return static_cast<double>(item.log_time_ns - recording_.mcap().begin_ns()) * 1e-9;
  }

  /// False: stopped.
  bool wait_for_viewer() {
    const std::string viewer =
        "viewer_node --session " +
        (options_.session_file.empty() ? recording_.about("session_file") : options_.session_file);
    if (!options_.is_quiet) {
      std::printf("%s: %s, %.3f s\n", recording_.mcap().path().c_str(), session_.name.c_str(),
                  recording_.length_s() - options_.start_s);
    }
    const TimePoint deadline =
        options_.wait_s ? clock_.now() + from_seconds(*options_.wait_s) : TimePoint::max();
    bool has_said = false;
    const auto is_seen = [&] { return has_own_page_ ? stage_.has_page() : stage_.has_viewer(); };
    while (!is_seen() && clock_.now() < deadline) {
      // a viewer that runs already needs two intervals to subscribe
      if (!has_said && clock_.now() - began_ > kNoticeAfter) {
        const std::string what = has_own_page_ ? "the page to be opened" : "a viewer: " + viewer;
        std::printf("waiting for %s\n(--wait 0 does not wait)\n", what.c_str());
        std::fflush(stdout);
        has_said = true;
      }
      host_.publish(run_, false);
      if (stop_.came_within(kPollInterval)) return false;
    }
    if (!options_.is_quiet) std::printf("playing\n");
    std::fflush(stdout);
    return true;
  }

  /// A new pass from there: like a restart of all nodes, with the scene of the beginning.
  void seek(double position_s) {
    ++run_.replay->runs;
    playhead_.move_to(position_s);
    stage_.begin(scene_ ? &*scene_ : nullptr);
    recording_.seek(recording_.mcap().begin_ns() +
                    static_cast<std::uint64_t>(std::llround(run_.replay->position_s * 1e9)));
    shown_ns_ = 0;
  }

  /// Another run may begin with it in the recording.
  void note_run(std::uint64_t log_time_ns) {
    if (shown_ns_ > 0) {
      run_.replay->runs += static_cast<std::uint64_t>(std::count_if(
          seams_ns_.begin(), seams_ns_.end(),
          [&](std::uint64_t at_ns) { return at_ns > shown_ns_ && at_ns <= log_time_ns; }));
    }
    shown_ns_ = std::max(shown_ns_, log_time_ns);
  }

  /// At the end: true if it goes on, by itself or because a viewer moved the playhead.
  bool come_to_end() {
    if (options_.loops && has_shown_) {
      seek(options_.start_s);
      has_shown_ = false;
      return true;
    }
    if (!is_controlled_ && !(has_own_page_ && stage_.has_page())) return false;
    playhead_.set_paused(true);
    for (;;) {
      const Wait wait = poll(kPollInterval);
      if (wait == Wait::kStopped) return false;
      if (wait == Wait::kMoved) return true;
      if (!run_.replay->is_paused) {  // "play" at the end begins again
        seek(0.0);
        return true;
      }
    }
  }

  Wait wait_for(double position_s) {
    for (;;) {
      const bool is_paused = run_.replay->is_paused;
      const Duration left = is_paused ? kPollInterval : playhead_.until(position_s);
      const Wait wait = poll(std::min(left, kPollInterval));
      if (wait != Wait::kDue) return wait;
      if (!run_.replay->is_paused && playhead_.until(position_s) <= Duration::zero()) return wait;
    }
  }

  /// Serves viewers for this time. kDue: nothing but time has changed.
  Wait poll(Duration time) {
    stage_.serve_newcomers();
    bool is_new = false;
    bool has_moved = false;
    while (const auto request = host_.take()) {
      is_controlled_ = is_new = true;
      if (request->speed_ratio) playhead_.set_speed(*request->speed_ratio);
      if (request->is_paused) playhead_.set_paused(*request->is_paused);
      if (request->seek_s) {
        seek(*request->seek_s);
        has_moved = true;
      }
    }
    run_.replay->position_s = playhead_.position_s();
    host_.publish(run_, is_new);
    if (has_moved) return Wait::kMoved;
    return stop_.came_within(time) ? Wait::kStopped : Wait::kDue;
  }

  const ReplayOptions& options_;
  RecordingFile& recording_;
  Session session_;
  SteadyClock clock_;
  const TimePoint began_ = clock_.now();
  StopSignals stop_;  // before the threads of stage_
  Stage stage_;
  std::optional<SceneState> scene_;
  std::vector<std::uint64_t> seams_ns_;  // of the recording
  std::uint64_t shown_ns_ = 0;           // newest message of this pass
  RunHost host_;
  RunState run_;
  Playhead playhead_;
  bool has_own_page_ = false;
  bool is_controlled_ = false;  // by a viewer
  bool has_shown_ = false;      // anything in this pass
};

}  // namespace

void run_replay(const ReplayOptions& options, RecordingFile& recording) {
  if (recording.length_s() <= 0.0) {
    const std::string damage = recording.damage();
    throw SetupError("recording " + recording.mcap().path() + ": has nothing to replay" +
                     (damage.empty() ? "" : "; missing: " + damage));
  }
  if (options.start_s >= recording.length_s()) {
    char length[32];
    std::snprintf(length, sizeof(length), "%.3f", recording.length_s());
    throw SetupError("--start: the recording is " + std::string(length) + " s long; give less");
  }
  Session session = session_of(options, recording);
  if (options.is_insecure) allow_plain_tcp(session);
  Replay(options, recording, std::move(session)).run();
}

}  // namespace palpate
