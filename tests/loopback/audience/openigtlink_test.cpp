// SPDX-License-Identifier: Apache-2.0
// viewer_node --openigtlink: its messages by Debian's own library, and clients that do harm.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "common/core/random.h"
#include "common/session/session_file.h"
#include "tests/support/machine/machine.h"
#include "tests/support/program.h"
#include "tests/support/run_folder.h"
#include "tests/support/temp_folder.h"
#include "tests/support/watcher.h"
#include "viewer_node/openigtlink/server.h"

#ifdef PALPATE_HAS_OPENIGTLINK
#include <igtlClientSocket.h>
#include <igtlMessageHeader.h>
#include <igtlPolyDataMessage.h>
#include <igtlSensorMessage.h>
#include <igtlStatusMessage.h>
#include <igtlTransformMessage.h>
#include <igtlUnit.h>
#include <igtl_util.h>
#endif

namespace palpate {
namespace {

using namespace std::chrono_literals;
using viewer::igtl::Client;
using viewer::igtl::Header;
using viewer::igtl::Pose;
using viewer::igtl::Server;

/// A client of bytes that never waits.
class RawClient {
 public:
  explicit RawClient(std::uint16_t port) : socket_(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(connect(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  }
  ~RawClient() { close(socket_); }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  /// @return how many the kernel took
  std::size_t send(const std::string& bytes) const {
    const ssize_t count = ::send(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    return count > 0 ? static_cast<std::size_t>(count) : 0;
  }
  std::string receive() const {
    std::string bytes(1 << 20U, '\0');
    const ssize_t count = recv(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT);
    bytes.resize(count > 0 ? static_cast<std::size_t>(count) : 0);
    return bytes;
  }
  /// The server has closed it.
  [[nodiscard]] bool has_ended() const {
    char byte = 0;
    const ssize_t count = recv(socket_, &byte, 1, MSG_DONTWAIT | MSG_PEEK);
    return count == 0 || (count < 0 && errno == ECONNRESET);
  }

 private:
  int socket_;
};

class OpenIgtLinkServer : public testing::Test {
 protected:
  OpenIgtLinkServer() {
    server_.wants = [](const Header& header) { return header.type == "TRANSFORM"; };
    server_.on_message = [this](Client&, const Header& header, const std::string& body) {
      received_.push_back(header.device + " " + std::to_string(body.size()));
    };
  }
  /// Until it has so many clients.
  void await_clients(std::size_t count) {
    ASSERT_TRUE(test::await([&] {
      server_.pump(now_);
      return server_.clients().size() == count;
    }));
  }
  Server server_{0};
  std::vector<std::string> received_;
  TimePoint now_ = time_at(100.0);
};

// What it does not read waits up to a bound and is then left out, while another one gets all of it;
// after 10 s it is disconnected.
TEST_F(OpenIgtLinkServer, AClientThatStallsCostsBoundedMemoryAndNobodyElseAnything) {
  const RawClient stalled(server_.port());
  const RawClient reader(server_.port());
  await_clients(2);
  const std::string message(10'000, 'x');
  std::size_t read = 0;
  constexpr std::size_t kMessages = 2000;
  for (std::size_t i = 0; i < kMessages; ++i) {
    Client& first = server_.clients().front();
    server_.send(first, message, now_);
    ASSERT_LE(first.waiting.size(), viewer::igtl::kMostWaitingBytes);
    ASSERT_TRUE(server_.send(server_.clients().back(), message, now_)) << i;
    ASSERT_TRUE(test::await([&] {
      read += reader.receive().size();
      server_.pump(now_);
      return read == (i + 1) * message.size();
    }));
  }
  EXPECT_GT(server_.counters().left_out, kMessages / 2);
  now_ += viewer::igtl::kStalledAfter;
  server_.pump(now_);
  EXPECT_EQ(server_.clients().size(), 2U);
  now_ += 1ms;
  server_.pump(now_);
  EXPECT_EQ(server_.clients().size(), 1U);
  EXPECT_EQ(server_.counters().stalled, 1U);
}

// A large surface goes at once to a client for which nothing waits.
TEST_F(OpenIgtLinkServer, AMessageBeyondWhatMayWaitIsSentToAClientThatReads) {
  const RawClient reader(server_.port());
  await_clients(1);
  const std::string surface(5'000'000, 's');
  ASSERT_TRUE(server_.send(server_.clients().front(), surface, now_));
  EXPECT_FALSE(server_.send(server_.clients().front(), "pose", now_));
  std::size_t read = 0;
  EXPECT_TRUE(test::await([&] {
    read += reader.receive().size();
    server_.pump(now_);
    return read == surface.size();
  }));
  EXPECT_TRUE(server_.send(server_.clients().front(), "pose", now_));
}

TEST_F(OpenIgtLinkServer, AClientThatFloodsIsReadInPartsAndNothingOfItIsKept) {
  const RawClient flood(server_.port());
  await_clients(1);
  // a message of an unwanted type without an end
  std::string endless = viewer::igtl::force_message("Force", 0, {1, 2, 3});
  endless.replace(42, 8, std::string(8, '\xFF'));
  std::size_t sent = flood.send(endless);
  for (int i = 0; i < 200; ++i) {
    sent += flood.send(std::string(1 << 20U, 'x'));
    const std::uint64_t left_before = server_.clients().front().reader.left_bytes();
    server_.pump(now_);
    ASSERT_EQ(server_.clients().size(), 1U);
    const Client& client = server_.clients().front();
    if (i > 0) {
      // one read more may have begun below the limit
      EXPECT_LE(left_before - client.reader.left_bytes(), viewer::igtl::kMostReadBytes + 4096);
    }
    EXPECT_EQ(client.reader.kept_bytes(), 0U);
    EXPECT_TRUE(client.waiting.empty());
  }
  EXPECT_GT(sent, 1'000'000U);
  EXPECT_TRUE(received_.empty());
}

TEST_F(OpenIgtLinkServer, MessagesMayComeInAnyPartsAndWhatIsNoneEndsTheConnection) {
  const RawClient client(server_.port());
  await_clients(1);
  const std::string transform =
      viewer::igtl::transform_message("ImageToPatient", 0, Pose::Identity());
  const std::string bytes = viewer::igtl::force_message("Force", 0, {1, 2, 3}) + transform +
                            viewer::igtl::status_message("x", 0, viewer::igtl::Status::kOk, "") +
                            transform;
  for (const char byte : bytes) {
    client.send(std::string(1, byte));
    server_.pump(now_);
  }
  ASSERT_TRUE(test::await([&] {
    server_.pump(now_);
    return received_.size() == 2;
  }));
  EXPECT_EQ(received_[1], "ImageToPatient 48");
  client.send("GET / HTTP/1.1\r\nHost: localhost\r\nOrigin: http://example.org\r\n\r\n");
  await_clients(0);
  EXPECT_EQ(server_.counters().invalid, 1U);
  EXPECT_TRUE(client.has_ended());
}

TEST_F(OpenIgtLinkServer, TakesEightClientsAndNoMore) {
  std::vector<std::unique_ptr<RawClient>> clients;
  for (std::size_t i = 0; i <= viewer::igtl::kMostClients; ++i) {
    clients.push_back(std::make_unique<RawClient>(server_.port()));
    await_clients(std::min(i + 1, viewer::igtl::kMostClients));
  }
  EXPECT_TRUE(test::await([&] {
    server_.pump(now_);
    return clients.back()->has_ended();
  }));
  clients.front().reset();
  await_clients(viewer::igtl::kMostClients - 1);
}

/// A hand that rests 20 mm above soft tissue.
constexpr const char* kSession = R"(
name: "slicer"
realtime { priority: 0 cpu: -1 }
device { monitor: off rate_hz: 200 lease_us: 12500 }
hand { hold { position_m { x: 0.01 z: 0.02 } } }
mofc { controller: none stale_after_ms: 200 }
scene {
  tool { tip_radius_m: 0.003 }
  tissue { name: "fat" half_space {} kelvin_voigt { stiffness_newton_per_m: 200 } }
  tissue { name: "lump" sphere { center_m { x: 0.1 } radius_m: 0.01 }
           kelvin_voigt { stiffness_newton_per_m: 200 }
           motion { amplitude_m { z: 0.005 } frequency_hz: 1 } }
}
viewer { web { port: 0 } }
)";

class OpenIgtLink : public testing::Test {
 protected:
  void start() {
    launch_.emplace("palpate", std::vector<std::string>{"launch", file_, "--no-realtime"});
    ASSERT_FALSE(launch_->await_err("event=web url=http://127.0.0.1:").empty());
    viewer_.emplace("viewer_node", std::vector<std::string>{"--session", file_, "--openigtlink",
                                                            "0", "--no-web", "--quiet"});
    const std::string rest = viewer_->await_err("event=openigtlink address=127.0.0.1 port=");
    ASSERT_FALSE(rest.empty());
    port_ = static_cast<std::uint16_t>(std::stoi(rest));
  }
  void stop() {
    viewer_->send_signal(SIGTERM);
    EXPECT_EQ(viewer_->wait(), 0) << viewer_->err();
    launch_->send_signal(SIGTERM);
    EXPECT_EQ(launch_->wait(), 0) << launch_->err();
  }
  test::RunFolder run_folder_;
  test::TempFolder files_;
  std::string file_ = files_.write("slicer.txtpb", kSession);
  std::optional<test::Program> launch_;
  std::optional<test::Program> viewer_;
  std::uint16_t port_ = 0;
};

TEST_F(OpenIgtLink, APortInUseIsRefused) {
  const Server other(0);
  const test::Outcome outcome = test::run_program(
      "viewer_node",
      {"--session", file_, "--no-web", "--openigtlink", std::to_string(other.port())});
  EXPECT_EQ(outcome.status, 2);
  EXPECT_THAT(outcome.err, testing::HasSubstr("the port is in use; give another one"));
}

// One client stalls, one floods, one sends what is nothing: the ticks go on, and the hand stays.
TEST_F(OpenIgtLink, HostileClientsChangeNothingOnTheHand) {
  start();
  ProcessLinks links({.priority = 0, .cpu = -1});
  test::Watcher watcher(load_session(file_), links);
  ASSERT_TRUE(watcher.until([&] { return watcher.sees_all_nodes(); }));
  ASSERT_TRUE(watcher.until_rows(50));
  const std::size_t first = watcher.rows().size();
  const test::QuietMachine machine;
  const RawClient stalled(port_);
  const RawClient flood(port_);
  const RawClient reader(port_);
  std::string read;
  Random random(1);
  for (int i = 0; i < 100; ++i) {
    std::string bytes = viewer::igtl::transform_message("ImageToPatient", 0, Pose::Identity());
    for (int k = 0; k < 100; ++k) {
      bytes += viewer::igtl::force_message("Force", 0, {1e9, 1e9, 1e9});
      bytes += viewer::igtl::transform_message("ImageToPatient", 0, Pose::Identity());
      bytes += viewer::igtl::transform_message("Device", 0, Pose::Identity());
    }
    flood.send(bytes);
    const RawClient noise(port_);
    std::string nothing(1000, '\0');
    for (char& c : nothing) c = static_cast<char>(random.below(256));
    noise.send(nothing);
    read += reader.receive();
    ASSERT_TRUE(watcher.until_rows(2));
  }
  // the client that reads still gets poses
  ASSERT_TRUE(watcher.until([&] {
    read += reader.receive();
    return read.find("ForceOnHand") != std::string::npos;
  }));
  EXPECT_EQ(watcher.mirror().device_link().sessions, 1U);
  EXPECT_EQ(watcher.mirror().mofc_link().sessions, 1U);
  const auto begin = watcher.rows().begin() + static_cast<std::ptrdiff_t>(first);
  for (auto row = begin; row != watcher.rows().end(); ++row) {
    EXPECT_NEAR(row->device.measured_hand_position_m.z(), 0.02, 1e-4);
    EXPECT_EQ(row->device.force_on_hand_newton.norm(), 0.0);
  }
  const auto answered = std::count_if(begin, watcher.rows().end(),
                                      [](const auto& row) { return row.device.is_answered; });
  if (machine.may_check("90 % of the ticks answered beside hostile clients")) {
    EXPECT_GT(static_cast<double>(answered),
              0.9 * static_cast<double>(watcher.rows().end() - begin));
  }
  stop();
}

#ifdef PALPATE_HAS_OPENIGTLINK

/// What a client of Debian's library has received, newest of each name; every checksum is judged.
class LibraryClient {
 public:
  explicit LibraryClient(std::uint16_t port) : socket_(igtl::ClientSocket::New()) {
    EXPECT_EQ(socket_->ConnectToServer("127.0.0.1", port), 0);
  }
  ~LibraryClient() { socket_->CloseSocket(); }
  LibraryClient(const LibraryClient&) = delete;
  LibraryClient& operator=(const LibraryClient&) = delete;

  /// One message. False: the connection has ended, or its checksum is wrong.
  bool receive() {
    igtl::MessageHeader::Pointer header = igtl::MessageHeader::New();
    header->InitPack();
    if (socket_->Receive(header->GetPackPointer(), header->GetPackSize()) !=
        header->GetPackSize()) {
      return false;
    }
    header->Unpack();
    const std::string type = header->GetDeviceType();
    const std::string name = header->GetDeviceName();
    if (type == "TRANSFORM") {
      auto message = body_of<igtl::TransformMessage>(header);
      if (message.IsNull()) return false;
      igtl::Matrix4x4 matrix;
      message->GetMatrix(matrix);
      Eigen::Matrix4d& to = transforms[name];
      for (int i = 0; i < 16; ++i) to(i / 4, i % 4) = matrix[i / 4][i % 4];
    } else if (type == "SENSOR") {
      auto message = body_of<igtl::SensorMessage>(header);
      if (message.IsNull() || message->GetLength() != 3) return false;
      const igtl::Unit::Pointer newton = igtl::Unit::New();
      newton->Append(igtl::Unit::SI_DERIVED_NEWTON, 1);
      is_in_newton = message->GetUnit() == newton->Pack();
      ++forces[name];
    } else if (type == "POLYDATA") {
      auto message = body_of<igtl::PolyDataMessage>(header);
      if (message.IsNull()) return false;
      points[name] = message->GetPoints()->GetNumberOfPoints();
      polygons[name] = message->GetPolygons()->GetNumberOfCells();
      igtlFloat32 point[3] = {};  // NOLINT: of the library
      message->GetPoints()->GetPoint(0, point);
      first_point_mm[name] = Vector3(point[0], point[1], point[2]);
      ++surfaces[name];
    } else if (type == "STATUS") {
      auto message = body_of<igtl::StatusMessage>(header);
      if (message.IsNull()) return false;
      codes.push_back(message->GetCode());
      text = message->GetStatusString();
    } else {
      return false;
    }
    return true;
  }
  template <class Condition>
  bool receive_until(Condition is_so) {
    for (int i = 0; i < 100'000; ++i) {
      if (is_so()) return true;
      if (!receive()) return false;
    }
    return false;
  }
  void send(const std::string& bytes) {
    EXPECT_EQ(socket_->Send(bytes.data(), static_cast<int>(bytes.size())), 1);
  }
  /// A TRANSFORM as the library packs it.
  static std::string packed(const char* name, const Eigen::Matrix4d& pose) {
    auto message = igtl::TransformMessage::New();
    message->SetDeviceName(name);
    igtl::Matrix4x4 matrix;
    for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = static_cast<float>(pose(i / 4, i % 4));
    message->SetMatrix(matrix);
    message->Pack();
    return {static_cast<const char*>(message->GetPackPointer()),
            static_cast<std::size_t>(message->GetPackSize())};
  }

  std::map<std::string, Eigen::Matrix4d> transforms;
  std::map<std::string, int> forces;
  std::map<std::string, int> points;
  std::map<std::string, std::uint32_t> polygons;
  std::map<std::string, int> surfaces;
  std::map<std::string, Vector3> first_point_mm;
  std::vector<int> codes;
  std::string text;
  bool is_in_newton = false;

 private:
  template <class Message>
  typename Message::Pointer body_of(igtl::MessageHeader::Pointer& header) {
    typename Message::Pointer message = Message::New();
    message->SetMessageHeader(header);
    message->AllocatePack();
    const int size = message->GetPackBodySize();
    if (socket_->Receive(message->GetPackBodyPointer(), size) != size) return nullptr;
    const bool is_good = (message->Unpack(1) & igtl::MessageHeader::UNPACK_BODY) != 0;
    EXPECT_TRUE(is_good) << header->GetDeviceType();
    return is_good ? message : nullptr;
  }
  igtl::ClientSocket::Pointer socket_;
};

TEST_F(OpenIgtLink, DebiansLibraryReadsPosesForcesSurfacesAndStatus) {
  start();
  LibraryClient client(port_);
  ASSERT_TRUE(client.receive_until([&] {
    return client.transforms.contains("Tool") && client.transforms.contains("Device") &&
           client.forces["ForceOnHand"] > 1 && client.points.contains("fat") &&
           client.surfaces["lump"] > 2 && !client.codes.empty() && client.codes.back() == 1;
  }));
  const Vector3 hand_mm(10, 0, 20);
  EXPECT_LT((client.transforms["Tool"].topRightCorner<3, 1>() - hand_mm).norm(), 0.2);
  EXPECT_LT((client.transforms["Device"].topRightCorner<3, 1>() - hand_mm).norm(), 0.2);
  EXPECT_TRUE((client.transforms["Tool"].topLeftCorner<3, 3>().isIdentity(1e-6)));
  EXPECT_TRUE(client.is_in_newton);
  EXPECT_GT(client.points["fat"], 1000);
  EXPECT_GT(client.polygons["fat"], 1000U);
  // what rests is not sent again
  EXPECT_EQ(client.surfaces["fat"], 1);

  // the image: turned by a quarter and moved
  Eigen::Matrix4d image_to_patient = Eigen::Matrix4d::Identity();
  image_to_patient.topLeftCorner<3, 3>() =
      Eigen::AngleAxisd(std::acos(0.0), Vector3::UnitZ()).toRotationMatrix();
  image_to_patient.topRightCorner<3, 1>() = Vector3(5, 6, 7);
  const std::string registration = LibraryClient::packed("ImageToPatient", image_to_patient);
  const Eigen::Vector4d in_image = image_to_patient.inverse() * hand_mm.homogeneous();
  const auto is_registered = [&] {
    return (client.transforms["Tool"].topRightCorner<3, 1>() - in_image.head<3>()).norm() < 0.2;
  };
  EXPECT_FALSE(is_registered());
  const Vector3 before_mm = client.first_point_mm["fat"];
  client.send(registration);
  EXPECT_TRUE(client.receive_until(is_registered));
  EXPECT_TRUE(client.receive_until([&] { return client.surfaces["fat"] == 2; }));
  EXPECT_LT((client.first_point_mm["fat"] -
             (image_to_patient.inverse() * before_mm.homogeneous()).head<3>())
                .norm(),
            0.01);
  // another client has an image of its own
  LibraryClient other(port_);
  ASSERT_TRUE(other.receive_until([&] { return other.transforms.contains("Tool"); }));
  EXPECT_LT((other.transforms["Tool"].topRightCorner<3, 1>() - hand_mm).norm(), 0.2);
  stop();
}

TEST_F(OpenIgtLink, RegistrationsOfBothHeadersAreTakenAndWrongOnesAreTold) {
  start();
  LibraryClient client(port_);
  Eigen::Matrix4d shifted = Eigen::Matrix4d::Identity();
  shifted(0, 3) = 100.0;
  const auto status_after = [&](const std::string& bytes) {
    client.send(bytes);
    EXPECT_TRUE(client.receive_until([&] {
      return client.text.find("ImageToPatient") != std::string::npos ||
             client.text.find("checksum") != std::string::npos;
    }));
    return std::exchange(client.text, "");
  };
  std::string bytes = LibraryClient::packed("ImageToPatient", shifted);
  EXPECT_THAT(status_after(bytes), testing::HasSubstr("is used"));

  // the header of version 3 of the protocol: 12 bytes more before the content
  std::string body =
      std::string("\0\x0C\0\0\0\0\0\0\0\0\0\1", 12) + bytes.substr(viewer::igtl::kHeaderBytes);
  std::string head = bytes.substr(0, viewer::igtl::kHeaderBytes);
  head[1] = 2;
  head[49] = static_cast<char>(body.size());
  const igtl_uint64 crc =
      crc64(reinterpret_cast<unsigned char*>(body.data()), body.size(), crc64(nullptr, 0, 0));
  for (std::size_t i = 0; i < 8; ++i) head[50 + i] = static_cast<char>(crc >> (56 - 8 * i));
  EXPECT_THAT(status_after(head + body), testing::HasSubstr("is used"));

  std::string damaged = bytes;
  damaged.back() = static_cast<char>(damaged.back() ^ 1);
  EXPECT_THAT(status_after(damaged), testing::HasSubstr("checksum"));
  EXPECT_EQ(client.codes.back(), 9);
  EXPECT_THAT(status_after(LibraryClient::packed("ImageToPatient", 2.0 * shifted)),
              testing::HasSubstr("is not rigid"));
  EXPECT_EQ(client.codes.back(), 10);
  stop();
}

#else

TEST_F(OpenIgtLink, DebiansLibraryReadsPosesForcesSurfacesAndStatus) {
  GTEST_SKIP() << "libopenigtlink-dev is not installed";
}

#endif

}  // namespace
}  // namespace palpate
