// SPDX-License-Identifier: Apache-2.0
// The Foxglove protocol v1 as a client sees it: greeting, subscriptions, complaints, hand targets.
#include "viewer_node/server/foxglove_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace palpate::viewer {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

ServerDescription description(bool accepts_hand_targets) {
  ServerDescription server{.name = "viewer_node 1", .session_id = "abc", .session_name = "default"};
  server.channels = {{"/a", "p.A", "ab"}, {"/b", "p.B", std::string("\0\xff", 2)}};
  if (accepts_hand_targets) server.hand_topics = {"/hand_target"};
  return server;
}

class FoxgloveClientTest : public testing::Test {
 protected:
  /// The one complaint that a text causes.
  std::string complaint(const std::string& text) {
    const auto outcome = client_.take_text(text);
    EXPECT_THAT(outcome.replies, SizeIs(1)) << text;
    EXPECT_THAT(outcome.subscribed, IsEmpty()) << text;
    if (outcome.replies.empty()) return {};
    const json reply = json::parse(outcome.replies[0]);
    EXPECT_EQ(reply["op"], "status");
    EXPECT_EQ(reply["level"], 2);
    return reply["message"];
  }
  void subscribe(int id, int channel) {
    const json text = {{"op", "subscribe"},
                       {"subscriptions", {{{"id", id}, {"channelId", channel}}}}};
    EXPECT_THAT(client_.take_text(text.dump()).replies, IsEmpty());
  }

  ServerDescription server_ = description(true);
  FoxgloveClient client_{server_, 7};
};

TEST_F(FoxgloveClientTest, IsGreetedWithServerInfoAndAllChannels) {
  const json info = json::parse(client_.server_info());
  EXPECT_EQ(info["op"], "serverInfo");
  EXPECT_EQ(info["name"], "viewer_node 1");
  EXPECT_EQ(info["sessionId"], "abc");
  EXPECT_EQ(info["capabilities"], json::array({"clientPublish"}));
  EXPECT_EQ(info["supportedEncodings"], json::array({"protobuf"}));
  EXPECT_EQ(info["metadata"]["client_id"], "7");
  EXPECT_EQ(info["metadata"]["session"], "default");
  const json advertise = json::parse(advertisement(server_));
  EXPECT_EQ(advertise["op"], "advertise");
  ASSERT_EQ(advertise["channels"].size(), 2u);
  const json& channel = advertise["channels"][1];
  EXPECT_EQ(channel["id"], 2);
  EXPECT_EQ(channel["topic"], "/b");
  EXPECT_EQ(channel["encoding"], "protobuf");
  EXPECT_EQ(channel["schemaName"], "p.B");
  EXPECT_EQ(channel["schemaEncoding"], "protobuf");
  // RFC 4648: "ab" = 61 62 → YWI=, 00 ff → AP8=
  EXPECT_EQ(advertise["channels"][0]["schema"], "YWI=");
  EXPECT_EQ(channel["schema"], "AP8=");
}

TEST_F(FoxgloveClientTest, IsToldOfNoCapabilityWhereItMayOnlyLook) {
  const ServerDescription server = description(false);
  const json info = json::parse(FoxgloveClient(server, 1).server_info());
  EXPECT_EQ(info["capabilities"], json::array());
  EXPECT_FALSE(info.contains("supportedEncodings"));
}

TEST_F(FoxgloveClientTest, ChoosesTheNumberOfItsSubscription) {
  const auto outcome = client_.take_text(
      R"({"op":"subscribe","subscriptions":[{"id":0,"channelId":2},{"id":4294967295,"channelId":1}]})");

  EXPECT_THAT(outcome.replies, IsEmpty());
  EXPECT_THAT(outcome.subscribed, ElementsAre(1u, 0u));
  EXPECT_EQ(client_.subscription(1), 0u);
  EXPECT_EQ(client_.subscription(0), 4294967295u);
}

TEST_F(FoxgloveClientTest, UnsubscribesAndMaySubscribeAgain) {
  subscribe(5, 1);
  const auto outcome = client_.take_text(R"({"op":"unsubscribe","subscriptionIds":[5]})");
  EXPECT_THAT(outcome.unsubscribed, ElementsAre(0u));
  EXPECT_FALSE(client_.subscription(0).has_value());
  subscribe(5, 1);
  EXPECT_EQ(client_.subscription(0), 5u);
}

TEST_F(FoxgloveClientTest, GetsAStatusForEachThingItDoesWrong) {
  subscribe(1, 1);
  EXPECT_THAT(complaint("{"), HasSubstr("JSON"));
  EXPECT_THAT(complaint("[]"), HasSubstr("JSON"));
  EXPECT_THAT(complaint(R"({"op":"fly"})"), HasSubstr("\"fly\" is not supported"));
  EXPECT_THAT(complaint(R"({"op":7})"), HasSubstr("not supported"));
  EXPECT_THAT(complaint("{}"), HasSubstr("not supported"));
  const auto subscribing = [](const std::string& what) {
    return R"({"op":"subscribe","subscriptions":[)" + what + "]}";
  };
  for (const char* wrong : {R"({"id":2,"channelId":0})", R"({"id":2,"channelId":3})",
                            R"({"id":-1,"channelId":2})", R"({"id":4294967296,"channelId":2})",
                            R"({"id":"2","channelId":2})", R"({"channelId":2})", "7", "null"}) {
    EXPECT_THAT(complaint(subscribing(wrong)), HasSubstr("needs an id")) << wrong;
  }
  EXPECT_THAT(complaint(subscribing(R"({"id":1,"channelId":2})")), HasSubstr("in use"));
  EXPECT_THAT(complaint(subscribing(R"({"id":2,"channelId":1})")), HasSubstr("already"));
  EXPECT_THAT(complaint(R"({"op":"unsubscribe","subscriptionIds":[9]})"), HasSubstr("no such"));
  EXPECT_THAT(complaint(R"({"op":"unsubscribe","subscriptionIds":["1"]})"), HasSubstr("no such"));
  EXPECT_EQ(client_.subscription(0), 1u);  // all the while
}

TEST_F(FoxgloveClientTest, CausesFewComplaintsByOneMessageWhateverIsInIt) {
  json text = {{"op", "unsubscribe"}, {"subscriptionIds", json::array()}};
  for (int i = 0; i < 1000; ++i) text["subscriptionIds"].push_back(i);
  EXPECT_THAT(client_.take_text(text.dump()).replies, SizeIs(8));
}

TEST_F(FoxgloveClientTest, IsToldOfAnOpThatIsNotUtf8) {
  // JSON that is not UTF-8 is no JSON
  EXPECT_THAT(complaint("{\"op\":\"\xff\"}"), HasSubstr("JSON"));
}

TEST_F(FoxgloveClientTest, SendsHandTargetsOnTheChannelItAdvertised) {
  EXPECT_THAT(client_
                  .take_text(R"({"op":"advertise","channels":[{"id":258,"topic":"/hand_target",)"
                             R"("encoding":"protobuf","schemaName":"palpate.v1.HandTarget"}]})")
                  .replies,
              IsEmpty());
  // 258 = 02 01 00 00, little-endian
  const std::string data("\x01\x02\x01\x00\x00xyz", 8);

  const auto outcome = client_.take_binary(data);
  EXPECT_EQ(outcome.published, ClientTopic::kHandTarget);
  EXPECT_EQ(outcome.payload, "xyz");

  EXPECT_THAT(client_.take_text(R"({"op":"unadvertise","channelIds":[258]})").replies, IsEmpty());
  EXPECT_FALSE(client_.take_binary(data).published.has_value());
}

TEST_F(FoxgloveClientTest, SendsHandTargetsOfEachSideOnItsTopic) {
  ServerDescription server = description(false);
  server.hand_topics = {"/left/hand_target", "", "/right/hand_target"};  // one follows no page
  FoxgloveClient client(server, 7);
  EXPECT_EQ(json::parse(client.server_info())["metadata"]["client_topics"],
            "/left/hand_target /right/hand_target");
  const auto advertise = [&](int id, const std::string& topic) {
    const json text = {{"op", "advertise"},
                       {"channels",
                        {{{"id", id},
                          {"topic", topic},
                          {"encoding", "protobuf"},
                          {"schemaName", "palpate.v1.HandTarget"}}}}};
    return client.take_text(text.dump()).replies;
  };
  EXPECT_THAT(advertise(1, "/right/hand_target"), IsEmpty());
  EXPECT_THAT(advertise(2, "/left/hand_target"), IsEmpty());
  EXPECT_THAT(advertise(3, ""), SizeIs(1));
  EXPECT_THAT(advertise(3, "/hand_target"), SizeIs(1));
  EXPECT_EQ(client.take_binary(std::string("\x01\x01\0\0\0z", 6)).side, 2u);
  EXPECT_EQ(client.take_binary(std::string("\x01\x02\0\0\0z", 6)).side, 0u);
}

TEST_F(FoxgloveClientTest, SendsRequestsBesideHandTargets) {
  ServerDescription server = description(true);
  server.accepts_requests = true;
  FoxgloveClient client(server, 7);
  EXPECT_EQ(json::parse(client.server_info())["metadata"]["client_topics"],
            "/hand_target /run_request");
  const auto advertise = [&](const char* id, const char* topic, const char* schema) {
    return client
        .take_text(std::string(R"({"op":"advertise","channels":[{"id":)") + id + R"(,"topic":")" +
                   topic + R"(","encoding":"protobuf","schemaName":")" + schema + R"("}]})")
        .replies;
  };
  EXPECT_THAT(advertise("1", "/hand_target", "palpate.v1.HandTarget"), IsEmpty());
  EXPECT_THAT(advertise("2", "/run_request", "palpate.v1.RunRequest"), IsEmpty());
  const auto outcome = client.take_binary(std::string("\x01\x02\0\0\0z", 6));
  EXPECT_EQ(outcome.published, ClientTopic::kRunRequest);
  EXPECT_EQ(outcome.payload, "z");
  EXPECT_EQ(client.take_binary(std::string("\x01\x01\0\0\0z", 6)).published,
            ClientTopic::kHandTarget);
  // a client cannot take memory with channels
  for (int id = 10; id < 17; ++id) {
    EXPECT_THAT(advertise(std::to_string(id).c_str(), "/run_request", "palpate.v1.RunRequest"),
                IsEmpty());
  }
  EXPECT_THAT(advertise("99", "/run_request", "palpate.v1.RunRequest"), SizeIs(1));
}

TEST_F(FoxgloveClientTest, MayAdvertiseNothingElse) {
  for (const char* wrong :
       {R"("topic":"/cmd","encoding":"protobuf","schemaName":"palpate.v1.HandTarget")",
        R"("topic":"/hand_target","encoding":"json","schemaName":"palpate.v1.HandTarget")",
        R"("topic":"/hand_target","encoding":"protobuf","schemaName":"x")"}) {
    EXPECT_THAT(complaint(R"({"op":"advertise","channels":[{"id":1,)" + std::string(wrong) + "}]}"),
                HasSubstr("only /hand_target"));
  }
}

TEST_F(FoxgloveClientTest, MaySendNothingUnlessTheSessionSaysSo) {
  const ServerDescription server = description(false);
  FoxgloveClient client(server, 1);
  const auto outcome =
      client.take_text(R"({"op":"advertise","channels":[{"id":1,"topic":"/hand_target",)"
                       R"("encoding":"protobuf","schemaName":"palpate.v1.HandTarget"}]})");
  ASSERT_THAT(outcome.replies, SizeIs(1));
  EXPECT_THAT(outcome.replies[0], HasSubstr("not supported"));
  EXPECT_FALSE(client.take_binary(std::string("\x01\x01\0\0\0x", 6)).published.has_value());
}

TEST_F(FoxgloveClientTest, GetsAStatusForBytesThatAreNoData) {
  for (const std::string& bytes :
       {std::string(), std::string("\x01"), std::string("\x01\0\0\0", 4),
        std::string("\x02\0\0\0\0", 5), std::string("\x01\x09\0\0\0", 5)}) {
    const auto outcome = client_.take_binary(bytes);
    EXPECT_THAT(outcome.replies, SizeIs(1));
    EXPECT_FALSE(outcome.published.has_value());
  }
}

TEST(FoxgloveFrames, BeginWithOpcodeSubscriptionAndTimeLittleEndian) {
  const DataHeader header = data_header(0x04030201, 0x0c0b0a0908070605);
  for (std::size_t i = 0; i < header.size(); ++i) {
    EXPECT_EQ(header[i], i == 0 ? 1 : static_cast<char>(i));
  }
}

TEST(FoxgloveStatus, CanBeTakenBack) {
  const json status = json::parse(status_text(StatusLevel::kWarning, "slow", "send_buffer"));
  EXPECT_EQ(status,
            (json{{"op", "status"}, {"level", 1}, {"message", "slow"}, {"id", "send_buffer"}}));
  EXPECT_EQ(json::parse(remove_status_text("send_buffer")),
            (json{{"op", "removeStatus"}, {"statusIds", {"send_buffer"}}}));
  EXPECT_FALSE(json::parse(status_text(StatusLevel::kInfo, "x")).contains("id"));
}

}  // namespace
}  // namespace palpate::viewer
