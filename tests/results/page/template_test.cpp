#include "results/page/template.h"

#include <gtest/gtest.h>

namespace imuscope::page {
namespace {

TEST(Template, EveryPlaceIsFilledAndWhatIsFilledInIsNotSearched) {
  EXPECT_EQ(filled("<a>{{one}}</a>{{two}}{{one}}", {{"one", "{{two}}"}, {"two", "2"}}),
            "<a>{{two}}</a>2{{two}}");
}

TEST(Template, APlaceWithoutAValueIsEmptyAndOneThatDoesNotEndStays) {
  EXPECT_EQ(filled("a{{nothing}}b", {}), "ab");
  EXPECT_EQ(filled("a{{one", {{"one", "1"}}), "a{{one");
  EXPECT_EQ(filled("", {{"one", "1"}}), "");
}

// The first is the digest of nothing, the second that of the example of CSP level 3, section 1 of its hash
// sources.
TEST(Template, AScriptIsNamedByItsDigest) {
  EXPECT_EQ(hash_source(""), "'sha256-47DEQpj8HBSa+/TImW+5JCeuQeRkm5NMpJWZG3hSuFU='");
  EXPECT_EQ(hash_source("alert('Hello, world.');"), "'sha256-qznLcsROx4GACP2dm0UCKCzCG+HiZ1guq6ZZDob/Tng='");
}

}  // namespace
}  // namespace imuscope::page
