/// Who may have the page, by what a request says.

#include "service/web/request_rules.h"

#include <gtest/gtest.h>

namespace imuscope::web {
namespace {

TEST(RequestRules, OnLoopbackThisPcsOwnNamesAloneMayBeAskedFor) {
  const HostNames known{{"car", "car.local"}, true};
  for (const char* host : {"localhost", "LOCALHOST:8088", "127.0.0.1", "127.0.0.1:8088", "127.1.2.3:1",
                           "[::1]", "[::1]:8088", "car:8088", "Car.local"})
    EXPECT_TRUE(is_host_allowed(host, known)) << host;
  for (const char* host : {"", "attacker.example", "attacker.example:8088", "127.0.0.1.attacker.example",
                           "localhost.attacker.example", "192.168.1.5", "0.0.0.0", "[::2]:8088", "[::1",
                           "::1", "127.0.0.1:", "127.0.0.1:x", "127.0.0.1:123456",
                           "127.0.0.1@attacker.example", "localhost:80:80", "car.example"})
    EXPECT_FALSE(is_host_allowed(host, known)) << host;
  EXPECT_FALSE(is_host_allowed(std::string(100'000, 'a'), known));
}

TEST(RequestRules, BeyondLoopbackAnyNumericAddressMayBeAskedForAndNoForeignName) {
  const HostNames known{{"car"}, false};
  for (const char* host : {"192.168.1.5:8088", "10.0.0.1", "[fe80::1]:8088", "localhost", "car"})
    EXPECT_TRUE(is_host_allowed(host, known)) << host;
  for (const char* host :
       {"attacker.example:8088", "192.168.1.5.attacker.example", "192.168.1", "[fe80::1%x]"})
    EXPECT_FALSE(is_host_allowed(host, known)) << host;
}

TEST(RequestRules, AHostIsTakenUpToTheLengthOfANameWithAPort) {
  const HostNames known{{std::string(261, 'a'), std::string(255, 'b'), "a-z@[`{"}, true};
  EXPECT_TRUE(is_host_allowed(std::string(261, 'A'), known));
  EXPECT_TRUE(is_host_allowed(std::string(255, 'b') + ":8088", known));
  EXPECT_FALSE(is_host_allowed(std::string(256, 'b') + ":8088", known));
  EXPECT_TRUE(is_host_allowed("A-Z@[`{", known)) << "letters alone have a lower case";
  for (const char* host : {"localhost:0", "localhost:1", "localhost:9", "localhost:09", "localhost:12345"})
    EXPECT_TRUE(is_host_allowed(host, known)) << host;
  for (const char* host :
       {"localhost:", "localhost:/", "localhost::", "localhost:1x", "localhost:123456", "localhostx1",
        "[::1]x", "[::1]x1", "[::1]:", "[", "[]", "[:", "126.255.255.255", "128.0.0.1"})
    EXPECT_FALSE(is_host_allowed(host, known)) << host;
  EXPECT_FALSE(is_host_allowed(std::string(262, 'a'), {{std::string(262, 'a')}, true}));
}

TEST(RequestRules, AScriptComesFromThePageItselfOrFromNowhere) {
  EXPECT_TRUE(is_own_origin("http://127.0.0.1:8088", "127.0.0.1:8088"));
  EXPECT_TRUE(is_own_origin("http://LOCALHOST:8088", "localhost:8088"));
  for (const char* origin : {"", "null", "http://", "https://127.0.0.1:8088", "http://127.0.0.1:8089",
                             "http://127.0.0.1", "http://attacker.example", "file://127.0.0.1:8088",
                             "http://127.0.0.1:8088/", "http://127.0.0.1:8088.attacker.example"})
    EXPECT_FALSE(is_own_origin(origin, "127.0.0.1:8088")) << origin;
  EXPECT_FALSE(is_own_origin("http://", ""));
}

TEST(RequestRules, TheTokenIsAWholeOne) {
  EXPECT_EQ(token_of("/?token=abcdefgh"), "abcdefgh");
  EXPECT_EQ(token_of("/live?x=1&token=abcdefgh&y=2"), "abcdefgh");
  EXPECT_EQ(token_of("/live?xtoken=abcdefgh"), "");
  EXPECT_EQ(token_of("/live"), "");
  EXPECT_EQ(token_of("/live?"), "");
  EXPECT_EQ(token_of("/live?&&&"), "");
  EXPECT_EQ(path_of("/live?token=x"), "/live");
  EXPECT_TRUE(is_same_token("abcdefgh", "abcdefgh"));
  EXPECT_FALSE(is_same_token("abcdefgi", "abcdefgh"));
  EXPECT_FALSE(is_same_token("abcdefg", "abcdefgh"));
  EXPECT_FALSE(is_same_token("", "abcdefgh"));
  EXPECT_EQ(token_of("?token=abcdefgh"), "abcdefgh") << "at the very beginning";
  EXPECT_EQ(token_of("/live?x&token=abcdefgh"), "abcdefgh");
  EXPECT_EQ(token_of("/live?token="), "");
  EXPECT_EQ(token_of("/live?a=1&token=one&token=two"), "one");
  EXPECT_EQ(path_of("?token=x"), "");
  EXPECT_TRUE(is_same_token("", ""));
  EXPECT_FALSE(is_same_token("bbcdefgh", "abcdefgh")) << "the first letter";
  EXPECT_FALSE(is_same_token("badcfehg", "abcdefgh")) << "the same letters";
  EXPECT_TRUE(is_token("abcd-EF_0.~"));
  EXPECT_TRUE(is_token("azAZ09-_"));
  EXPECT_TRUE(is_token("abcdefgh"));
  EXPECT_TRUE(is_token(std::string(128, 'a')));
  EXPECT_FALSE(is_token("abcdefg"));
  for (const char c : {'/', ':', '@', '[', '`', '{', ',', '}', '^'})
    EXPECT_FALSE(is_token(std::string("abcdefgh") + c)) << c;
  EXPECT_FALSE(is_token("short"));
  EXPECT_FALSE(is_token("has a space"));
  EXPECT_FALSE(is_token("has&another=1"));
  EXPECT_FALSE(is_token(std::string(129, 'a')));
}

}  // namespace
}  // namespace imuscope::web
