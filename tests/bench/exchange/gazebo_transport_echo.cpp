// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <ignition/msgs/bytes.pb.h>
#include <condition_variable>
#include <ignition/transport/Node.hh>
#include <mutex>

#include "common/core/check.h"
#include "tests/bench/exchange/echo_links.h"

namespace palpate::bench {
namespace {

using ignition::msgs::Bytes;
using ignition::transport::Node;
using namespace std::chrono_literals;

Node::Publisher advertise(Node& node, const std::string& topic) {
  Node::Publisher publisher = node.Advertise<Bytes>(topic);
  if (!publisher) throw SetupError("Gazebo Transport: cannot advertise " + topic);
  return publisher;
}

class GazeboTransportEcho final : public EchoLink {
 public:
  explicit GazeboTransportEcho(const EchoBytes& bytes)
      : bytes_(bytes), prefix_("/palpate_bench_" + std::to_string(getpid())) {}

  std::function<void()> open_near(const RealtimeConfig&) override {
    struct Near {
      Near(const EchoBytes& bytes, const std::string& prefix)
          : publisher(advertise(node, prefix + "/there")) {
        message.set_data(std::string(bytes.there, ' '));
        std::function<void(const Bytes&)> on_echo = [this](const Bytes&) {
          const std::lock_guard lock(mutex);
          has_echo = true;
          arrived.notify_one();
        };
        if (!node.Subscribe(prefix + "/back", on_echo)) {
          throw SetupError("Gazebo Transport: cannot subscribe");
        }
      }
      bool round_trip(std::chrono::milliseconds timeout) {
        {
          const std::lock_guard lock(mutex);
          has_echo = false;
        }
        publisher.Publish(message);
        std::unique_lock lock(mutex);
        return arrived.wait_for(lock, timeout, [this] { return has_echo; });
      }
      std::mutex mutex;
      std::condition_variable arrived;
      bool has_echo = false;
      Bytes message;
      Node node;
      Node::Publisher publisher;
    };
    const auto near = std::make_shared<Near>(bytes_, prefix_);
    while (!near->round_trip(100ms)) {
    }  // until both have found each other
    return [near] { near->round_trip(1s); };
  }

  void serve_far(const RealtimeConfig&) override {
    Node node;
    Node::Publisher publisher = advertise(node, prefix_ + "/back");
    Bytes reply;
    reply.set_data(std::string(bytes_.back, ' '));
    std::function<void(const Bytes&)> echo = [&](const Bytes&) { publisher.Publish(reply); };
    node.Subscribe(prefix_ + "/there", echo);
    for (;;) pause();
  }

 private:
  EchoBytes bytes_;
  std::string prefix_;
};

}  // namespace

std::unique_ptr<EchoLink> gazebo_transport_echo(const EchoBytes& bytes) {
  return std::make_unique<GazeboTransportEcho>(bytes);
}

}  // namespace palpate::bench
