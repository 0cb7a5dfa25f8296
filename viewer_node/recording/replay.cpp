#include "viewer_node/recording/replay.h"

#include <pthread.h>
#include <signal.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <map>

#include "common/core/check.h"
#include "common/core/clock.h"
#include "common/link/scene_sender.h"
#include "common/link/zmq_sender.h"
#include "common/process/process_links.h"
#include "common/process/run_node.h"
#include "common/session/session_file.h"
#include "viewer_node/feed/scene_mirror.h"
#include "viewer_node/recording/recording_file.h"

namespace palpate {
namespace {

constexpr Duration kPollInterval = std::chrono::milliseconds(20);

/// Waits for SIGINT, SIGTERM and SIGHUP. Construct it before any thread, so that all block them.
class StopSignals {
 public:
  StopSignals() {
    sigemptyset(&signals_);
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals_, signal);
    pthread_sigmask(SIG_BLOCK, &signals_, &before_);
  }
  ~StopSignals() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// Waits for at most `wait`; true if a signal arrived.
  [[nodiscard]] bool came_within(Duration wait) const {
    const auto ns = std::max<std::int64_t>(wait.count(), 0);
    const timespec time{.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
    return sigtimedwait(&signals_, nullptr, &time) > 0;
  }

 private:
  sigset_t signals_{};
  sigset_t before_{};
};

Session session_of(const ReplayOptions& options, const RecordingFile& recording) {
  if (!options.session_file.empty()) {
    return load_session(options.session_file, options.overrides);
  }
  const std::string file = recording.about("session_file");
  try {
    return parse_session(recording.about("session"), options.file, options.overrides,
                         std::filesystem::absolute(file).parent_path());
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
    scene_.take(scene);
    physics_.send(scene);
  }
  void show(MeshFrame frame) {
    renew(frame.header);
    if (scene_.take(frame)) physics_.send(frame);
  }

  /// Whether a viewer subscribes to all of them.
  [[nodiscard]] bool has_viewer() {
    return physics_.has_subscriber<PhysicsBatch>() &&
           std::all_of(sides_.begin(), sides_.end(), [](auto& side) {
             return side.second.device.has_subscriber() && side.second.mofc.has_subscriber();
           });
  }

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

}  // namespace

void run_replay(const ReplayOptions& options) {
  RecordingFile recording(options.file);
  if (options.start_s >= recording.length_s()) {
    char length[32];
    std::snprintf(length, sizeof(length), "%.3f", recording.length_s());
    throw SetupError("--start: the recording is " + std::string(length) + " s long; give less");
  }
  Session session = session_of(options, recording);
  if (options.is_insecure) allow_plain_tcp(session);
  const StopSignals stop;
  Stage stage(session);
  const auto scene = first_scene(recording);
  const SteadyClock clock;
  const std::uint64_t begin_ns =
      recording.mcap().begin_ns() + static_cast<std::uint64_t>(options.start_s * 1e9);
  std::printf("%s: %s, %.3f s; starts with the first viewer: viewer_node --session %s\n",
              options.file.c_str(), session.name.c_str(), recording.length_s() - options.start_s,
              options.session_file.empty() ? recording.about("session_file").c_str()
                                           : options.session_file.c_str());
  std::fflush(stdout);
  while (!stage.has_viewer()) {
    if (stop.came_within(kPollInterval)) return;
  }

  bool has_shown = false;
  do {
    stage.begin(scene ? &*scene : nullptr);
    recording.seek(begin_ns);
    const TimePoint began = clock.now();
    while (const RecordingFile::Item* item = recording.next()) {
      const double after_s = static_cast<double>(item->log_time_ns - begin_ns) * 1e-9;
      const TimePoint due = began + from_seconds(after_s / options.speed_ratio);
      do {
        stage.serve_newcomers();
        if (stop.came_within(std::min(due - clock.now(), kPollInterval))) return;
      } while (clock.now() < due);
      std::visit([&](const auto& message) { stage.show(message); }, item->message);
      has_shown = true;
    }
  } while (options.loops && has_shown);
}

}  // namespace palpate
