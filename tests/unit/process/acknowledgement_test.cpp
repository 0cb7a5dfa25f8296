// SPDX-License-Identifier: Apache-2.0
#include "common/process/acknowledgement.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <string_view>

namespace palpate {
namespace {

/// Standard input is another file while it exists.
class StandardInput {
 public:
  explicit StandardInput(int file) : before_(::dup(STDIN_FILENO)) {
    ::dup2(file, STDIN_FILENO);
    ::close(file);
  }
  ~StandardInput() {
    ::dup2(before_, STDIN_FILENO);
    ::close(before_);
  }
  StandardInput(const StandardInput&) = delete;
  StandardInput& operator=(const StandardInput&) = delete;

 private:
  int before_;
};

class Keyboard : public testing::Test {
 protected:
  void SetUp() override { ASSERT_EQ(::pipe(ends_.data()), 0); }
  void TearDown() override { ::close(ends_[1]); }
  void type(std::string_view text) const {
    ASSERT_EQ(::write(ends_[1], text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  std::array<int, 2> ends_{};
};

TEST_F(Keyboard, EnterAcknowledgesOnce) {
  const StandardInput input(ends_[0]);
  TerminalAcknowledgement person;
  EXPECT_FALSE(person.take());
  type("yes");
  EXPECT_FALSE(person.take());
  type("\n\n\n");  // what was typed before a prompt is gone with the call before it
  EXPECT_TRUE(person.take());
  EXPECT_FALSE(person.take());
}

TEST_F(Keyboard, ASignalAcknowledgesOnceAndTheEndOfTheInputDoesNot) {
  const StandardInput input(ends_[0]);
  TerminalAcknowledgement person;
  ::close(ends_[1]);
  EXPECT_FALSE(person.take());
  ::raise(SIGUSR2);
  EXPECT_TRUE(person.take());
  EXPECT_FALSE(person.take());
  ends_[1] = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
}

TEST(Acknowledgement, AnInputWithoutEndDoesNotHoldItUp) {
  const StandardInput input(::open("/dev/zero", O_RDONLY | O_CLOEXEC));
  TerminalAcknowledgement person;
  EXPECT_FALSE(person.take());
  ::raise(SIGUSR2);
  EXPECT_TRUE(person.take());
}

}  // namespace
}  // namespace palpate
