// SPDX-License-Identifier: Apache-2.0
/// @file
/// palpate_tissue.hpp — palpate_tissue.h for C++17: owners instead of handles, exceptions instead
/// of statuses. Nothing of it is compiled into the library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "palpate_tissue.h"

namespace palpate::tissue {

/// Its text is that of palpate_tissue_error(): value, rule and remedy.
class Error : public std::runtime_error {
 public:
  /// Of the last call on this thread that failed.
  Error() : std::runtime_error(palpate_tissue_error()) {}
};

/// @cond
namespace detail {
template <class T>
T* made(T* handle) {
  if (handle == nullptr) throw Error();
  return handle;
}
inline void check(palpate_tissue_status status) {
  if (status != PALPATE_TISSUE_OK) throw Error();
}
}  // namespace detail
/// @endcond

/// A scene, read once; copies share it.   @see palpate_scene
class Scene {
 public:
  /// The scene of a session file.   @throws Error   @see palpate_scene_load
  static Scene load(const std::string& file, const std::vector<std::string>& sets = {}) {
    const std::vector<const char*> all = pointers_to(sets);
    return Scene(detail::made(palpate_scene_load(file.c_str(), all.data(), all.size())));
  }
  /// The same from memory.
  /// An empty folder: the text may name no file.   @throws Error   @see palpate_scene_parse
  static Scene parse(const std::string& text, const std::string& folder = {},
                     const std::vector<std::string>& sets = {}) {
    const std::vector<const char*> all = pointers_to(sets);
    return Scene(detail::made(palpate_scene_parse(
        text.c_str(), folder.empty() ? nullptr : folder.c_str(), all.data(), all.size())));
  }
  /// How many tissues there are.
  std::size_t tissue_count() const { return palpate_scene_tissue_count(get()); }
  /// Radius of the tip of the tools [m].
  double tip_radius_m() const { return palpate_scene_tip_radius_m(get()); }
  /// For the C interface.
  const palpate_scene* get() const { return handle_.get(); }

 private:
  explicit Scene(palpate_scene* handle) : handle_(handle, &palpate_scene_destroy) {}
  static std::vector<const char*> pointers_to(const std::vector<std::string>& texts) {
    std::vector<const char*> all;
    all.reserve(texts.size());
    for (const std::string& text : texts) all.push_back(text.c_str());
    return all;
  }
  std::shared_ptr<palpate_scene> handle_;
};

/// The state of one copy; copies of this share it.   @see palpate_snapshot
class Snapshot {
 public:
  /// Owns the handle.
  explicit Snapshot(palpate_snapshot* handle) : handle_(handle, &palpate_snapshot_destroy) {}
  /// For the C interface.
  const palpate_snapshot* get() const { return handle_.get(); }

 private:
  std::shared_ptr<palpate_snapshot> handle_;
};

/// Copies of a scene under tools.   @see palpate_batch
class Batch {
 public:
  /// Makes `scenes` copies.   @throws Error   @see palpate_batch_create
  explicit Batch(const Scene& scene, std::size_t scenes = 1, std::size_t tools = 1,
                 std::size_t threads = 0)
      : handle_(detail::made(palpate_batch_create(scene.get(), scenes, tools, threads)),
                &palpate_batch_destroy),
        tools_(tools) {}

  /// Where it is to go in the next step.   @pre  both exist
  palpate_tool& tool(std::size_t copy = 0, std::size_t tool = 0) {
    return palpate_batch_tools(handle_.get())[copy * tools_ + tool];
  }
  /// What the last step has come to.   @pre  both exist
  const palpate_tool_force& force(std::size_t copy = 0, std::size_t tool = 0) const {
    return palpate_batch_forces(handle_.get())[copy * tools_ + tool];
  }
  /// All tools go where they are to be.   @throws Error   @see palpate_batch_step
  void step(double dt_s, std::uint32_t parts = 1) {
    detail::check(palpate_batch_step(handle_.get(), dt_s, parts));
  }
  /// Seconds that a copy has moved; NaN: there is none.
  double time_s(std::size_t copy = 0) const { return palpate_batch_time_s(handle_.get(), copy); }
  /// As before the first step.   @throws Error   @see palpate_batch_reset
  void reset(std::size_t copy = PALPATE_EVERY, double time_s = 0.0) {
    detail::check(palpate_batch_reset(handle_.get(), copy, time_s));
  }
  /// Keeps the state of a copy.   @throws Error
  Snapshot snapshot(std::size_t copy = 0) const {
    return Snapshot(detail::made(palpate_batch_snapshot(handle_.get(), copy)));
  }
  /// Continues from that state, to the bit.   @throws Error   @see palpate_batch_restore
  void restore(const Snapshot& snapshot, std::size_t copy = PALPATE_EVERY) {
    detail::check(palpate_batch_restore(handle_.get(), copy, snapshot.get()));
  }
  /// The surface of a tissue as it is now.   @throws Error   @see palpate_batch_surface
  palpate_surface surface(std::size_t tissue = 0, std::size_t copy = 0) {
    palpate_surface surface{};
    detail::check(palpate_batch_surface(handle_.get(), copy, tissue, &surface));
    return surface;
  }

 private:
  std::unique_ptr<palpate_batch, void (*)(palpate_batch*)> handle_;
  std::size_t tools_;
};

}  // namespace palpate::tissue
