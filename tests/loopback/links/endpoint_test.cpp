// SPDX-License-Identifier: Apache-2.0
// Endpoints: exclusive use, cleaning up, error messages; the context.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <vector>

#include "common/link/exchange_client.h"
#include "common/link/exchange_server.h"
#include "tests/loopback/links/link_fixture.h"

namespace palpate::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

using EndpointTest = LinksTest;

class EndpointTransport : public EveryTransport {};
INSTANTIATE_TEST_SUITE_P(Links, EndpointTransport, kEveryTransport, transport_name);

TEST_F(EndpointTest, AnIpcPathHasOneOwnerUntilItsProcessEnds) {
  const std::string endpoint = ipc("exchange");
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {  // only the claim: libzmq's threads exist in the parent only
    const IpcClaim claim(bind_to(endpoint, "links.exchange"));
    std::ofstream(endpoint.substr(6) + ".other");
    char byte = 1;
    if (write(ready[1], &byte, 1) == 1) pause();
    _exit(0);
  }
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);

  EXPECT_EQ(setup_error([&] {
              ExchangeServer second(context_, clock_, bind_to(endpoint, "links.exchange"));
            }),
            "links.exchange = " + endpoint + ": in use by process " + std::to_string(child) +
                "; stop it or give links.exchange another endpoint");

  // killed, so that it cannot remove its files
  kill(child, SIGKILL);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(std::filesystem::exists(folder_.path().string() + "/exchange.lock"));
  EXPECT_EQ(setup_error([&] {
              ExchangeServer next(context_, clock_, bind_to(endpoint, "links.exchange"));
            }),
            "no error");
  close(ready[0]);
  close(ready[1]);
}

TEST_F(EndpointTest, AStaleSocketFileIsReplaced) {
  const std::string endpoint = ipc("exchange");
  {
    zmq::socket_t dead(context_.get(), zmq::socket_type::router);
    dead.bind(endpoint);  // libzmq does not remove its file
  }
  ASSERT_TRUE(std::filesystem::is_socket(folder_.path().string() + "/exchange"));

  ExchangeServer mofc(context_, clock_, bind_to(endpoint, "links.exchange"));
  ExchangeClient device(context_, clock_, connect_to(endpoint, "links.exchange"));
  EXPECT_TRUE(device.wait_for_peer(kPatience));
}

TEST_F(EndpointTest, IpcLeavesNoFilesAndCreatesItsFolderForThisUserOnly) {
  const std::string run = folder_.path().string() + "/run/session";
  {
    ExchangeServer mofc(context_, clock_, bind_to("ipc://" + run + "/exchange", "links.exchange"));
    EXPECT_TRUE(std::filesystem::is_socket(run + "/exchange"));
    struct stat status {};
    ASSERT_EQ(stat(run.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777u, 0700u);
  }
  EXPECT_TRUE(std::filesystem::is_empty(run));
}

TEST_F(EndpointTest, AFolderThatOthersMayWriteIsRefusedAtBothEnds) {
  const std::string folder = folder_.path().string() + "/open";
  std::filesystem::create_directory(folder);
  std::filesystem::permissions(folder, std::filesystem::perms::all);
  EXPECT_THAT(setup_error([&] {
                ExchangeServer mofc(context_, clock_, bind_to("ipc://" + folder + "/x", "links.x"));
              }),
              HasSubstr("links.x = ipc://" + folder + "/x: other users may write folder"));
  EXPECT_THAT(setup_error([&] {
                ExchangeClient device(context_, clock_,
                                      connect_to("ipc://" + folder + "/x", "links.x"));
              }),
              HasSubstr("links.x = ipc://" + folder + "/x: other users may write folder"));
}

// Otherwise another user could create it and listen first.
TEST_F(EndpointTest, TheConnectingEndMakesTheFolderForThisUserOnlyToo) {
  const std::string run = folder_.path().string() + "/run/session";
  ExchangeClient device(context_, clock_, connect_to("ipc://" + run + "/x", "links.x"));
  struct stat status {};
  ASSERT_EQ(stat(run.c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777u, 0700u);
}

TEST_F(EndpointTest, AFileOtherThanASocketIsNotRemoved) {
  std::ofstream(folder_.path().string() + "/notes") << "precious";
  EXPECT_THAT(
      setup_error([&] { ExchangeServer mofc(context_, clock_, bind_to(ipc("notes"), "links.x")); }),
      HasSubstr("not a socket"));
  EXPECT_EQ(std::filesystem::file_size(folder_.path().string() + "/notes"), 8u);
  EXPECT_FALSE(std::filesystem::exists(folder_.path().string() + "/notes.lock"));
}

TEST_P(EndpointTransport, AnEndpointInUseIsRefusedWithARemedy) {
  ExchangeServer first(context_, clock_, bind_to(fresh_endpoint(GetParam()), "links.exchange"));
  const std::string message = setup_error([&] {
    ExchangeServer second(context_, clock_, bind_to(first.endpoint(), "links.exchange"));
  });
  EXPECT_THAT(message, HasSubstr(first.endpoint() + ": in use by"));
  EXPECT_THAT(message, HasSubstr("give links.exchange another endpoint"));
}

TEST_F(EndpointTest, TcpChoosesAndReportsAFreePort) {
  ExchangeServer a(context_, clock_, bind_to("tcp://127.0.0.1:*", "links.exchange"));
  ExchangeServer b(context_, clock_, bind_to("tcp://127.0.0.1:*", "links.exchange"));
  EXPECT_THAT(a.endpoint(), testing::MatchesRegex("tcp://127.0.0.1:[0-9]+"));
  EXPECT_NE(a.endpoint(), b.endpoint());
}

TEST_F(EndpointTest, InvalidEndpointsAreRefused) {
  const std::vector<std::string> bad = {"",
                                        "exchange",
                                        "/run/exchange",
                                        "udp://127.0.0.1:5",
                                        "ws://127.0.0.1:80",
                                        "ipc://",
                                        "ipc://@hidden",
                                        "ipc://*",
                                        "ipc:///tmp/",
                                        "tcp://",
                                        "inproc://",
                                        "tcp://nowhere",
                                        "tcp://*:notaport",
                                        "ipc:///tmp/" + std::string(200, 'x')};
  for (const std::string& endpoint : bad) {
    SCOPED_TRACE(endpoint);
    EXPECT_THAT(setup_error([&] {
                  ExchangeServer mofc(context_, clock_, bind_to(endpoint, "links.exchange"));
                }),
                HasSubstr("links.exchange = " + endpoint + ": "));
  }
  ZmqContext insecure(RealtimeConfig{.priority = 0, .cpu = -1}, {.may_be_plain = true});
  EXPECT_THAT(setup_error([&] {
                ExchangeServer mofc(insecure, clock_, bind_to("tcp://192.0.2.1:5555", "links.x"));
              }),
              HasSubstr("this machine does not have that address"));
  EXPECT_THAT(
      setup_error([&] { ExchangeClient device(insecure, clock_, connect_to("tcp://a", "b")); }),
      HasSubstr("give ipc://PATH, tcp://HOST:PORT or inproc://NAME"));
}

TEST_F(EndpointTest, ARealTimeContextWorksWithAndWithoutPermission) {
  ZmqContext realtime(RealtimeConfig{.priority = 80, .cpu = 0});
  ZmqContext impossible(RealtimeConfig{.priority = 80, .cpu = 1000});
  EXPECT_FALSE(impossible.is_pinned());
  for (ZmqContext* context : {&realtime, &impossible}) {
    ExchangeServer mofc(*context, clock_, bind_to("tcp://127.0.0.1:*", "links.exchange"));
    ExchangeClient device(*context, clock_, connect_to(mofc.endpoint(), "links.exchange"));
    EXPECT_TRUE(device.wait_for_peer(kPatience));
  }
}

}  // namespace
}  // namespace palpate::test
