// SPDX-License-Identifier: Apache-2.0
// The controllers published by others, as a library that make_controller() loads where a session
// names one: so they are in no process that does not use them.
#include "common/core/version.h"
#include "mofc_node/controllers/named/catalogue.h"

using palpate::controllers::ControllerSettings;
using palpate::controllers::ForceController;

/// palpate::version(): library and program are of one build, or the layout of the settings differs.
extern "C" __attribute__((visibility("default"))) const char* palpate_rivals_version() {
  return palpate::version();
}

/// controllers::make_named(). The caller owns what it returns.
extern "C" __attribute__((visibility("default"))) ForceController* palpate_make_rival(
    const char* name, const ControllerSettings& settings) {
  return palpate::controllers::make_named(name, settings).release();
}
