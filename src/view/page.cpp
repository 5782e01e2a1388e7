#include "view/page.h"

#include <string_view>

#include "view/assets.h"

namespace imuscope::view {

namespace {

void replace(std::string& text, std::string_view placeholder, std::string_view with) {
  const std::size_t at = text.find(placeholder);
  if (at != std::string::npos) text.replace(at, placeholder.size(), with);
}

}  // namespace

std::string page_html() {
  std::string page(page_template());
  replace(page, "{{page_kit}}", page_kit());
  replace(page, "{{page_style}}", page_style());
  replace(page, "{{page_script}}", page_script());
  return page;
}

}  // namespace imuscope::view
