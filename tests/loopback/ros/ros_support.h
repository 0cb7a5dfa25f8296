// SPDX-License-Identifier: Apache-2.0
// ros_support.h — palpate_ros and a peer of another vendor, in a domain of their own.
#pragma once

#include <unistd.h>

#include <string>
#include <vector>

namespace palpate::test {

/// Tests that run at the same time do not meet: 100 … 199.
inline std::string ros_domain() { return std::to_string(100 + getpid() % 100); }

}  // namespace palpate::test
