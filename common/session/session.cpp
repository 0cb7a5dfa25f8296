#include "common/session/session.h"

#include "common/core/check.h"
#include "common/core/fnv.h"

namespace palpate {

std::uint64_t stream_seed(std::uint64_t session_seed, const char* stream) {
  // the hash of the name, mixed with the seed by splitmix64's finaliser
  std::uint64_t z = fnv1a(stream) + session_seed * 0x9e3779b97f4a7c15ULL;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

std::span<const Session> sides_of(const Session& session) {
  if (session.sides.empty()) return {&session, 1};
  return session.sides;
}

const Session& side_of(const Session& session, const std::string& name) {
  std::string names;
  for (const Session& side : sides_of(session)) {
    if (side.side == name) return side;
    names += (names.empty() ? "" : ", ") + side.side;
  }
  if (session.sides.empty()) {
    throw SetupError("--side " + name + ": session \"" + session.name +
                     "\" has one device; leave --side out");
  }
  throw SetupError((name.empty() ? "" : "--side " + name + ": ") + "session \"" + session.name +
                   "\" has several devices; give --side with one of " + names);
}

std::string with_side(const std::string& side, const std::string& name) {
  return side.empty() ? name : side + "." + name;
}

std::string controller_text(const MofcConfig& config) {
  if (config.controller == ControllerKind::kNone) return "none";
  switch (config.mode) {
    case MofcMode::kPaper:
      return "mofc paper";
    case MofcMode::kVector:
      return "mofc vector";
    case MofcMode::kGuard:
      return "mofc guard";
  }
  return "?";
}

}  // namespace palpate
