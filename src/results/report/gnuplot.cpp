#include "results/report/gnuplot.h"

#include <cmath>

#include "base/text.h"

namespace imuscope::report {

GnuplotText::GnuplotText(std::string_view any) : quoted_("'") {
  // A doubled quote stands for one, but not at a string's beginning (gnuplot 5.4).
  constexpr std::string_view kApostrophe = "\u2019";
  for (const char c : one_line(any)) {
    if (c == '\'') {
      quoted_ += kApostrophe;
    } else {
      quoted_ += c;
    }
  }
  quoted_ += '\'';
}

}  // namespace imuscope::report

auto fmt::formatter<imuscope::report::GnuplotNumber>::format(const imuscope::report::GnuplotNumber& number,
                                                             format_context& context)
    -> format_context::iterator {
  if (!std::isfinite(number.value)) return fmt::format_to(context.out(), "NaN");
  return fmt::format_to(context.out(), "{:.9g}", number.value);
}
