#include "view/page.h"

#include "results/page/assets.h"
#include "results/page/template.h"
#include "view/assets.h"

namespace imuscope::view {

std::string page_html() {
  return page::filled(
      page_template(),
      {{"kit_style", page::kit_style()}, {"page_style", page_style()}, {"page_script", page_script()}});
}

}  // namespace imuscope::view
