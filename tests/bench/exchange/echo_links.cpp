// SPDX-License-Identifier: Apache-2.0
#include "tests/bench/exchange/echo_links.h"

#include <linux/futex.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <new>
#include <system_error>
#include <thread>
#include <vector>

#include "common/link/socket/zmq_context.h"

namespace palpate::bench {
namespace {

[[noreturn]] void fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

// --- ZeroMQ -----------------------------------------------------------------------------------

class ZmqIpcEcho final : public EchoLink {
 public:
  ZmqIpcEcho(const EchoBytes& bytes, const std::string& folder)
      : bytes_(bytes), endpoint_("ipc://" + folder + "/raw.ipc") {}

  std::function<void()> open_near(const RealtimeConfig& realtime) override {
    struct Near {
      Near(const RealtimeConfig& realtime, const std::string& endpoint, std::size_t size)
          : context(realtime), socket(context.get(), zmq::socket_type::dealer), message(size) {
        socket.connect(endpoint);
      }
      void round_trip() {
        if (zmq_send(socket.handle(), message.data(), message.size(), 0) < 0) fail("zmq_send");
        if (zmq_msg_recv(reply.handle(), socket.handle(), 0) < 0) fail("zmq_msg_recv");
      }
      ZmqContext context;
      zmq::socket_t socket;
      std::vector<char> message;
      zmq::message_t reply;
    };
    const auto near = std::make_shared<Near>(realtime, endpoint_, bytes_.there);
    near->round_trip();
    return [near] { near->round_trip(); };
  }

  void serve_far(const RealtimeConfig& realtime) override {
    ZmqContext context(realtime);
    zmq::socket_t socket(context.get(), zmq::socket_type::router);
    socket.bind(endpoint_);
    const std::vector<char> reply(bytes_.back);
    zmq::message_t peer;
    zmq::message_t message;
    for (;;) {
      if (zmq_msg_recv(peer.handle(), socket.handle(), 0) < 0) fail("zmq_msg_recv");
      if (zmq_msg_recv(message.handle(), socket.handle(), 0) < 0) fail("zmq_msg_recv");
      if (zmq_msg_send(peer.handle(), socket.handle(), ZMQ_SNDMORE) < 0) fail("zmq_msg_send");
      if (zmq_send(socket.handle(), reply.data(), reply.size(), 0) < 0) fail("zmq_send");
    }
  }

 private:
  EchoBytes bytes_;
  std::string endpoint_;
};

class ZmqInprocEcho final : public EchoLink {
 public:
  explicit ZmqInprocEcho(const EchoBytes& bytes) : bytes_(bytes) {}

  std::function<void()> open_near(const RealtimeConfig& realtime) override {
    struct Near {
      Near(const RealtimeConfig& realtime, const EchoBytes& bytes)
          : context(realtime), socket(context.get(), zmq::socket_type::pair), message(bytes.there) {
        socket.bind("inproc://raw");
        std::thread([far = zmq::socket_t(context.get(), zmq::socket_type::pair),
                     reply = std::vector<char>(bytes.back)]() mutable {
          far.connect("inproc://raw");
          zmq::message_t taken;
          while (zmq_msg_recv(taken.handle(), far.handle(), 0) >= 0) {
            zmq_send(far.handle(), reply.data(), reply.size(), 0);
          }
        }).detach();  // ends with the process
      }
      ZmqContext context;
      zmq::socket_t socket;
      std::vector<char> message;
      zmq::message_t reply;
    };
    const auto near = std::make_shared<Near>(realtime, bytes_);
    return [near] {
      if (zmq_send(near->socket.handle(), near->message.data(), near->message.size(), 0) < 0) {
        fail("zmq_send");
      }
      if (zmq_msg_recv(near->reply.handle(), near->socket.handle(), 0) < 0) fail("zmq_msg_recv");
    };
  }

  void serve_far(const RealtimeConfig&) override {
    for (;;) pause();
  }

 private:
  EchoBytes bytes_;
};

// --- Unix sockets -----------------------------------------------------------------------------

class UnixEcho final : public EchoLink {
 public:
  UnixEcho(const EchoBytes& bytes, int type) : there_(bytes.there), back_(bytes.back) {
    if (socketpair(AF_UNIX, type | SOCK_CLOEXEC, 0, ends_.data()) != 0) fail("socketpair");
  }
  ~UnixEcho() override {
    for (const int end : ends_) close(end);
  }

  std::function<void()> open_near(const RealtimeConfig&) override {
    return [this] {
      put(ends_[0], there_);
      take(ends_[0], back_);
    };
  }
  void serve_far(const RealtimeConfig&) override {
    for (;;) {
      take(ends_[1], there_);
      put(ends_[1], back_);
    }
  }

 private:
  static void put(int socket, const std::vector<char>& bytes) {
    if (send(socket, bytes.data(), bytes.size(), 0) < 0) fail("send");
  }
  static void take(int socket, std::vector<char>& bytes) {
    if (recv(socket, bytes.data(), bytes.size(), MSG_WAITALL) < 0) fail("recv");
  }

  std::vector<char> there_;
  std::vector<char> back_;
  std::array<int, 2> ends_{};
};

// --- shared memory ----------------------------------------------------------------------------

class SharedMemoryEcho final : public EchoLink {
 public:
  explicit SharedMemoryEcho(const EchoBytes& bytes) : there_(bytes.there), back_(bytes.back) {
    void* const memory =
        mmap(nullptr, sizeof(Pages), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) fail("mmap");
    pages_ = new (memory) Pages;
  }
  ~SharedMemoryEcho() override { munmap(pages_, sizeof(Pages)); }

  std::function<void()> open_near(const RealtimeConfig&) override {
    return [this, n = std::uint32_t{0}]() mutable {
      ++n;
      pages_->there.put(there_, n);
      pages_->back.take(back_, n);
    };
  }
  void serve_far(const RealtimeConfig&) override {
    for (std::uint32_t n = 1;; ++n) {
      pages_->there.take(there_, n);
      pages_->back.put(back_, n);
    }
  }

 private:
  struct Mailbox {
    alignas(64) std::atomic<std::uint32_t> count{0};  // messages put so far
    std::array<char, 1024> bytes{};

    void put(const std::vector<char>& message, std::uint32_t n) {
      std::memcpy(bytes.data(), message.data(), message.size());
      count.store(n, std::memory_order_release);
      syscall(SYS_futex, &count, FUTEX_WAKE, 1, nullptr, nullptr, 0);
    }
    void take(std::vector<char>& message, std::uint32_t n) {
      while (count.load(std::memory_order_acquire) != n) {
        syscall(SYS_futex, &count, FUTEX_WAIT, n - 1, nullptr, nullptr, 0);
      }
      std::memcpy(message.data(), bytes.data(), message.size());
    }
  };
  struct Pages {
    Mailbox there;
    Mailbox back;
  };

  std::vector<char> there_;
  std::vector<char> back_;
  Pages* pages_ = nullptr;
};

}  // namespace

std::unique_ptr<EchoLink> zmq_ipc_echo(const EchoBytes& bytes, const std::string& folder) {
  return std::make_unique<ZmqIpcEcho>(bytes, folder);
}
std::unique_ptr<EchoLink> zmq_inproc_echo(const EchoBytes& bytes) {
  return std::make_unique<ZmqInprocEcho>(bytes);
}
std::unique_ptr<EchoLink> unix_echo(const EchoBytes& bytes, int type) {
  return std::make_unique<UnixEcho>(bytes, type);
}
std::unique_ptr<EchoLink> shared_memory_echo(const EchoBytes& bytes) {
  return std::make_unique<SharedMemoryEcho>(bytes);
}

}  // namespace palpate::bench
