// SPDX-License-Identifier: Apache-2.0
#include "common/process/log.h"

#include <spdlog/async.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <unistd.h>

#include "common/process/terminal.h"

namespace palpate {
namespace {

constexpr std::size_t kQueuedLines = 1024;

}  // namespace

Log::Log(const std::string& name, spdlog::sink_ptr sink)
    : writer_(std::make_shared<spdlog::details::thread_pool>(kQueuedLines, 1)) {
  const std::string begin = sink ? "" : line_start(STDERR_FILENO);
  if (!sink) sink = std::make_shared<spdlog::sinks::stderr_sink_mt>();
  logger_ = std::make_shared<spdlog::async_logger>(name, std::move(sink), writer_,
                                                   spdlog::async_overflow_policy::overrun_oldest);
  logger_->set_pattern(begin + "%Y-%m-%dT%H:%M:%S.%e %l %n %v");
}

// The destructor of the writer writes the queued lines.
Log::~Log() = default;

}  // namespace palpate
