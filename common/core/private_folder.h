// private_folder.h — folders for sockets and recordings that no other user can replace.
#pragma once

#include <filesystem>
#include <string>

namespace palpate {

/// Creates the folder and its parents, if absent, for this user only (mode 0700), and checks that
/// no other user can put anything in its place: it is a folder, not a link, of the effective user,
/// and nobody else may write it; every folder above it, and every link on the way, belongs to that
/// user or to root, and is writable by others only if it is sticky, as /tmp is.
/// @return what is wrong and what to do; empty if the folder is private
[[nodiscard]] std::string make_private_folder(const std::filesystem::path& folder);

}  // namespace palpate
