// SPDX-License-Identifier: Apache-2.0
// apart.h — checks in a process of their own: the code under test may end it.
#pragma once

#include <functional>

#include "deploy/conform/finding.h"

namespace palpate {

/// @param on_finding  of each finding
/// @param end         ends the child at once, from any thread: there will be no more
using ChecksApart =
    std::function<void(const OnFinding& on_finding, const std::function<void()>& end)>;

/// Runs `checks` in a child process; each finding that it passes on arrives at `on_finding` here.
/// SIGUSR2 and kDeviceStopSignals go on to the child, which `checks` must end then (DeviceStop),
/// and which is asked to end by SIGTERM if this process is killed. One thread when it is called.
/// @return false: the child ended before its checks did, which is a finding too
/// @throws SetupError   what `checks` has thrown
/// @throws Interrupted  a signal ended the checks
bool find_apart(const ChecksApart& checks, const OnFinding& on_finding);

}  // namespace palpate
