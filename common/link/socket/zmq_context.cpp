// SPDX-License-Identifier: Apache-2.0
#include "common/link/socket/zmq_context.h"

#include <pthread.h>
#include <sched.h>

#include <thread>

namespace palpate {

ZmqContext::ZmqContext(const RealtimeConfig& realtime, TcpRules tcp)
    : tcp_(std::move(tcp)), wait_(realtime.wait) {
  // test the permissions on a short-lived thread
  std::thread([&] {
    const sched_param parameters{.sched_priority = realtime.priority};
    is_realtime_ = realtime.priority > 0 &&
                   pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0;
    if (realtime.cpu >= 0 && realtime.cpu < CPU_SETSIZE) {
      cpu_set_t cpus;
      CPU_ZERO(&cpus);
      CPU_SET(static_cast<std::size_t>(realtime.cpu), &cpus);
      is_pinned_ = pthread_setaffinity_np(pthread_self(), sizeof(cpus), &cpus) == 0;
    }
  }).join();

  if (is_realtime_) {
    context_.set(zmq::ctxopt::thread_sched_policy, SCHED_FIFO);
    context_.set(zmq::ctxopt::thread_priority, realtime.priority);
  }
  if (is_pinned_) context_.set(zmq::ctxopt::thread_affinity_cpu_add, realtime.cpu);
  if (tcp_.keys) zap_.emplace(context_, tcp_.keys->allowed, *tcp_.refused);
}

ConnectionMonitor& ZmqContext::monitor() {
  std::call_once(monitor_started_,
                 [this] { monitor_.emplace(context_, *tcp_.refused, zap_, is_realtime_); });
  return *monitor_;
}

}  // namespace palpate
