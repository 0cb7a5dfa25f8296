// SPDX-License-Identifier: Apache-2.0
// loopback.h — DDS that is to stay on this machine. Cyclone DDS 0.10 binds its sockets for
// reception to every address, whatever interface it is told.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace palpate::ros {

/// The UDP sockets of this process at the ports of a domain, bound to any address.
[[nodiscard]] std::vector<int> open_sockets(std::uint32_t domain);

/// From now on these receive nothing but what this machine sends.
/// @return why not; empty: done
[[nodiscard]] std::string confine_to_loopback(std::uint32_t domain);

}  // namespace palpate::ros
