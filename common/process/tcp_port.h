// SPDX-License-Identifier: Apache-2.0
// tcp_port.h — whether a port of this machine is in use.
#pragma once

#include <cstdint>
#include <optional>

namespace palpate {

/// Binds 127.0.0.1:`port` for an instant. @param port  0: any that is free
/// @return the port; nullopt if a program uses it
[[nodiscard]] std::optional<std::uint16_t> free_port(std::uint16_t port);

}  // namespace palpate
