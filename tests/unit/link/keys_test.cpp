// SPDX-License-Identifier: Apache-2.0
// Valid and invalid key files; access control.
#include "common/link/security/keys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <functional>

#include "common/core/check.h"
#include "common/link/security/zap_handler.h"
#include "tests/support/temp_folder.h"

namespace palpate {
namespace {

namespace fs = std::filesystem;
using test::text_of;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::string setup_error(const std::function<void()>& action) {
  try {
    action();
  } catch (const SetupError& error) {
    return error.what();
  }
  return "";
}

mode_t mode_of(const fs::path& file) {
  struct stat status {};
  EXPECT_EQ(stat(file.c_str(), &status), 0);
  return status.st_mode & 0777;
}

class Keys : public testing::Test {
 protected:
  [[nodiscard]] std::string list() const {
    return "device " + device_.public_key + "\nphysics " + physics_.public_key + "\n";
  }
  [[nodiscard]] static std::string complaint(const std::string& list) {
    return setup_error([&] { static_cast<void>(parse_allowed_keys(list, "a.keys")); });
  }
  [[nodiscard]] static std::string pair_complaint(const std::string& text) {
    return setup_error([&] { static_cast<void>(parse_key_pair(text, "x.key_secret")); });
  }

  KeyPair device_ = new_key_pair();
  KeyPair physics_ = new_key_pair();
  KeyPair viewer_ = new_key_pair();
};

// --- the list -------------------------------------------------------------------------------

TEST_F(Keys, TheListGivesTheRoleOfEachKeyAndTheServerKeys) {
  const AllowedKeys allowed = parse_allowed_keys(
      "# a remark\r\n\n" + list() + "\t viewer \t" + viewer_.public_key + "\r\n", "a.keys");

  EXPECT_EQ(allowed.role_of(device_.public_key), KeyRole::kDevice);
  EXPECT_EQ(allowed.role_of(viewer_.public_key), KeyRole::kViewer);
  EXPECT_EQ(allowed.role_of(new_key_pair().public_key), std::nullopt);
  EXPECT_EQ(allowed.role_of(""), std::nullopt);
  EXPECT_EQ(allowed.server_key(KeyRole::kPhysics), physics_.public_key);
}

TEST_F(Keys, EveryProblemOfTheListIsReportedWithItsLineAndWithoutKeys) {
  std::string not_z85 = viewer_.public_key;
  not_z85[7] = '~';
  std::string with_zero = viewer_.public_key;
  with_zero[3] = '\0';
  const std::string text =
      complaint(list() + "admin " + viewer_.public_key + "\nviewer\nviewer short\nviewer " +
                not_z85 + "\nviewer " + with_zero + "\nviewer " + std::string(40, '#') +
                "\nviewer " + viewer_.public_key + " Anna\npointer " + device_.public_key +
                "\nphysics " + viewer_.public_key + "\n");

  EXPECT_THAT(text, AllOf(HasSubstr("a.keys: 9 problems\n"), HasSubstr("a.keys:3: must begin with"),
                          HasSubstr("a.keys:4: must be a role and a key"),
                          HasSubstr("a.keys:5: the key must be 40 characters"),
                          HasSubstr("a.keys:6: the key"), HasSubstr("a.keys:7: the key"),
                          HasSubstr("a.keys:8: the key"), HasSubstr("a.keys:9: must be a role"),
                          HasSubstr("a.keys:10: this key is listed above"),
                          HasSubstr("a.keys: must list exactly one good key of physics")));
  EXPECT_THAT(text, AllOf(Not(HasSubstr(viewer_.public_key)), Not(HasSubstr(device_.public_key))));
}

TEST_F(Keys, AListWithoutServersOrWithInvalidTextIsRefused) {
  EXPECT_THAT(complaint(""), HasSubstr("exactly one good key of device"));
  EXPECT_THAT(complaint(std::string(60'000, '\xff')), HasSubstr("a.keys:1: must begin"));
  EXPECT_THAT(complaint(std::string(60'000, '\n')), HasSubstr("exactly one"));
  std::string many;
  for (int i = 0; i < 5000; ++i) many += "x y\n";
  EXPECT_LT(complaint(many).size(), 3000u);
}

// --- a pair ---------------------------------------------------------------------------------

TEST_F(Keys, APairIsReadBackAsItWasWritten) {
  const KeyPair pair = parse_key_pair(key_pair_text(KeyRole::kViewer, viewer_), "x.key_secret");

  EXPECT_EQ(pair.public_key, viewer_.public_key);
  EXPECT_EQ(pair.secret_key, viewer_.secret_key);
}

TEST_F(Keys, InvalidPairsAreRefusedWithoutShowingThem) {
  const std::string good = key_pair_text(KeyRole::kViewer, viewer_);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    return pair_complaint(text);
  };
  EXPECT_THAT(with(viewer_.public_key, device_.public_key), HasSubstr("not that of secret-key"));
  EXPECT_THAT(with("\"" + viewer_.secret_key, viewer_.secret_key),
              HasSubstr("x.key_secret:6: the key must be 40 characters of Z85 in quotes"));
  EXPECT_THAT(with(viewer_.secret_key, viewer_.secret_key + "0"), HasSubstr("x.key_secret:6: "));
  EXPECT_THAT(with("secret-key", "public-key"), HasSubstr("x.key_secret:6: is given twice"));
  EXPECT_THAT(with("secret-key", "private-key"), HasSubstr("x.key_secret:6: must be public-key"));
  EXPECT_THAT(with("curve\n", ""), HasSubstr("below `curve`"));
  EXPECT_THAT(pair_complaint(""), HasSubstr("must give public-key and secret-key"));
  EXPECT_THAT(with(viewer_.secret_key, viewer_.secret_key + "0"),
              Not(HasSubstr(viewer_.secret_key)));
}

// --- the folder -----------------------------------------------------------------------------

TEST(KeyFolder, KeygenCreatesAPairForEachRoleAndOverwritesNothing) {
  const test::TempFolder folder;
  const fs::path keys = folder.path() / "keys";
  const auto files = make_key_folder(keys);

  EXPECT_EQ(files.size(), 8u);
  EXPECT_EQ(mode_of(keys), 0700u);
  for (const char* role :
       {"device", "physics", "standby", "viewer", "pointer", "relay", "audience"}) {
    EXPECT_EQ(mode_of(keys / (std::string(role) + ".key_secret")), 0600u);
  }
  const std::string before = text_of(keys / "viewer.key_secret");
  fs::remove(keys / "allowed.keys");
  EXPECT_THAT(setup_error([&] { make_key_folder(keys); }), HasSubstr("exists already"));
  EXPECT_EQ(text_of(keys / "viewer.key_secret"), before);
  EXPECT_FALSE(fs::exists(keys / "allowed.keys"));
}

class LoadKeys : public testing::Test {
 protected:
  LoadKeys() { make_key_folder(keys_); }
  [[nodiscard]] std::string error(KeyRole role = KeyRole::kPhysics) const {
    return setup_error([&] { static_cast<void>(load_link_keys(keys_, std::array{role})); });
  }

  test::TempFolder folder_;
  fs::path keys_ = folder_.path() / "keys";
};

TEST_F(LoadKeys, AProgramNeedsOnlyItsOwnSecret) {
  for (const char* other : {"device", "viewer", "pointer"}) {
    fs::remove(keys_ / (std::string(other) + ".key_secret"));
  }
  const LinkKeys keys =
      load_link_keys(keys_, std::array{KeyRole::kPhysics}, std::array{KeyRole::kPointer});

  EXPECT_TRUE(keys.of(KeyRole::kPhysics));
  EXPECT_FALSE(keys.of(KeyRole::kPointer));
  EXPECT_EQ(keys.allowed.server_key(KeyRole::kPhysics), keys.of(KeyRole::kPhysics)->public_key);
  EXPECT_THAT(error(KeyRole::kViewer), HasSubstr("viewer.key_secret: No such file"));
}

TEST_F(LoadKeys, FilesThatOthersMayReadOrChangeAreRefused) {
  const fs::path secret = keys_ / "physics.key_secret";
  for (const mode_t mode : {0644u, 0640u, 0604u, 0602u}) {
    chmod(secret.c_str(), mode);
    EXPECT_THAT(error(), HasSubstr("others may read this secret")) << std::oct << mode;
  }
  chmod(secret.c_str(), 0600);
  EXPECT_EQ(error(), "");

  chmod((keys_ / "allowed.keys").c_str(), 0664);
  EXPECT_THAT(error(), HasSubstr("allowed.keys: others may change it"));
  chmod((keys_ / "allowed.keys").c_str(), 0644);
  chmod(keys_.c_str(), 0777);
  EXPECT_THAT(error(), HasSubstr("keys: others may change it"));
}

TEST_F(LoadKeys, AFolderWithoutListAndKeysOfAnotherKeygenAreRefused) {
  make_key_folder(folder_.path() / "other");
  fs::copy_file(folder_.path() / "other" / "physics.key_secret", keys_ / "physics.key_secret",
                fs::copy_options::overwrite_existing);
  EXPECT_THAT(error(), HasSubstr("not listed for physics"));

  fs::copy_file(keys_ / "device.key_secret", keys_ / "physics.key_secret",
                fs::copy_options::overwrite_existing);
  EXPECT_THAT(error(), HasSubstr("not listed for physics"));

  fs::remove(keys_ / "allowed.keys");
  EXPECT_THAT(error(), HasSubstr("allowed.keys: No such file"));
  fs::create_directory(keys_ / "allowed.keys");
  EXPECT_THAT(error(), HasSubstr("is a folder"));
  fs::remove_all(keys_);
  EXPECT_THAT(error(), HasSubstr("palpate keygen"));
}

// --- requests of libzmq ---------------------------------------------------------------------

class Zap : public Keys {
 protected:
  /// A valid request to physics with the device key.
  [[nodiscard]] std::vector<std::string> request(const KeyPair& pair) const {
    std::string key(32, '\0');
    zmq_z85_decode(reinterpret_cast<std::uint8_t*>(key.data()), pair.public_key.c_str());
    return {"1.0", "7", "links.tool_motion", "10.0.0.1", "", "CURVE", key};
  }
  [[nodiscard]] ZapVerdict verdict(const std::vector<std::string>& frames) const {
    return judge(frames, parse_allowed_keys(list() + "viewer " + viewer_.public_key, "a.keys"));
  }
};

TEST_F(Zap, OnlyTheRoleOfTheLinkIsAdmitted) {
  EXPECT_EQ(verdict(request(device_)).status, "200");
  EXPECT_EQ(verdict(request(viewer_)).status, "400");
  EXPECT_EQ(verdict(request(viewer_)).refusal, Refusal::kWrongRole);
  EXPECT_EQ(verdict(request(physics_)).refusal, Refusal::kWrongRole);
  EXPECT_EQ(verdict(request(new_key_pair())).refusal, Refusal::kUnknownKey);
}

TEST_F(Zap, MalformedRequestsAreRefused) {
  const std::vector<std::string> good = request(device_);
  for (std::size_t length = 0; length < good.size(); ++length) {
    EXPECT_NE(verdict({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(length)}).status,
              "200")
        << length;
  }
  const auto with = [&](std::size_t frame, const std::string& text) {
    std::vector<std::string> frames = good;
    frames[frame] = text;
    return verdict(frames).status;
  };
  EXPECT_EQ(with(0, "2.0"), "500");
  EXPECT_EQ(with(0, ""), "500");
  for (const char* domain : {"", "links", "links.tool_motion ", "links.unknown", "device"}) {
    EXPECT_EQ(with(2, domain), "400") << domain;
  }
  for (const char* mechanism : {"", "NULL", "PLAIN", "curve", "CURVE2"}) {
    EXPECT_EQ(with(5, mechanism), "400") << mechanism;
  }
  EXPECT_EQ(with(6, ""), "400");
  EXPECT_EQ(with(6, good[6] + "x"), "400");
  EXPECT_EQ(with(6, good[6].substr(1)), "400");
  EXPECT_EQ(with(6, device_.public_key), "400");
  std::vector<std::string> longer = good;
  longer.emplace_back("more");
  EXPECT_EQ(verdict(longer).status, "400");
}

}  // namespace
}  // namespace palpate
