#include "results/page/html.h"

#include <fmt/format.h>
#include <openssl/evp.h>

#include "results/page/assets.h"
#include "results/page/template.h"

namespace imuscope::page {

Html text(std::string_view any) {
  std::string escaped;
  escaped.reserve(any.size());
  for (const char c : any) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return Html::markup(escaped);
}

Html element(std::string_view tag, const Html& content, std::string_view css_class) {
  const std::string attribute = css_class.empty() ? "" : fmt::format(" class=\"{}\"", css_class);
  return Html::markup(fmt::format("<{0}{1}>{2}</{0}>", tag, attribute, content.str()));
}

Html paragraph(std::string_view any, std::string_view css_class) {
  return element("p", text(any), css_class);
}

Html list_of(const std::vector<std::string>& sentences, std::string_view css_class) {
  if (sentences.empty()) return {};
  Html items;
  for (const std::string& sentence : sentences) items += element("li", text(sentence));
  return element("ul", items, css_class);
}

Html heading(std::string_view id, std::string_view words) {
  return Html::markup(fmt::format("<h2 id=\"{}\">{}</h2>", id, text(words).str()));
}

Html link_to_heading(std::string_view id, std::string_view words) {
  return Html::markup(fmt::format("<a href=\"#{}\">{}</a>", id, text(words).str()));
}

Html inline_svg(std::string_view css_class, double width, double height, std::string_view words,
                const std::string& inner) {
  return Html::markup(
      fmt::format("<svg class=\"{}\" viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">{}</svg>",
                  css_class, width, height, text(words).str(), inner));
}

Html fold(std::string_view summary, const Html& content, bool open) {
  if (content.empty()) return {};
  return Html::markup(fmt::format("<details class=\"fold\"{}><summary>{}</summary>{}</details>",
                                  open ? " open" : "", text(summary).str(), content.str()));
}

std::string json_for_script(const std::string& json) {
  std::string safe;
  safe.reserve(json.size());
  for (const char c : json) {
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe += c;
    }
  }
  return safe;
}

namespace {

/// The words of a heading, for the narrow page: without its markup.
std::string plain_words(const Html& html) {
  std::string words;
  bool inside = false;
  for (const char c : html.str()) {
    if (c == '<') inside = true;
    if (!inside) words += c;
    if (c == '>') inside = false;
  }
  return words;
}

/// Tables of so many columns fit the screen of a phone, and that of a tablet.
constexpr std::size_t kColumnsOfAPhone = 4;
constexpr std::size_t kColumnsOfATablet = 6;

}  // namespace

Html Table::html() const {
  Html head;
  std::vector<std::string> labels;
  for (const Html& heading : headings_) {
    head += element("th", heading);
    labels.push_back(plain_words(heading));
  }
  const bool wide = headings_.size() > kColumnsOfAPhone;
  Html body;
  for (const auto& row : rows_) {
    if (row.size() == 1) {
      body += Html::markup(fmt::format("<tr class=\"group\"><th colspan=\"{}\">{}</th></tr>",
                                       headings_.size(), row.front().str()));
      continue;
    }
    Html cells = element("th", row.front());
    for (std::size_t i = 1; i < row.size(); ++i) {
      cells += wide && i < labels.size() && !labels[i].empty()
                   ? Html::markup(fmt::format("<td data-label=\"{}\">{}</td>", labels[i], row[i].str()))
                   : element("td", row[i]);
    }
    body += element("tr", cells);
  }
  const Html table = element("table", element("thead", element("tr", head)) + element("tbody", body),
                             headings_.size() > kColumnsOfATablet ? "wide"
                             : wide                               ? "middle"
                                                                  : std::string_view{});
  return element("div", table, "scroll");
}

Html svg_image(const std::string& svg, std::string_view words) {
  // Four characters for three bytes, and the zero that the encoder writes after them.
  std::string base64(4 * ((svg.size() + 2) / 3) + 1, '\0');
  const int length =
      EVP_EncodeBlock(reinterpret_cast<unsigned char*>(base64.data()),
                      reinterpret_cast<const unsigned char*>(svg.data()), static_cast<int>(svg.size()));
  base64.resize(static_cast<std::size_t>(length));
  return Html::markup(fmt::format("<img class=\"drawn\" alt=\"{}\" src=\"data:image/svg+xml;base64,{}\">",
                                  text(words).str(), base64));
}

std::string page_without_script(std::string_view title, const Html& body) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; base-uri 'none'; "
      "form-action 'none'; style-src 'unsafe-inline'; img-src data:\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n"
      "<title>{}</title>\n<style>\n{}{}</style>\n</head>\n"
      "<body>\n<main>\n{}\n</main>\n</body>\n</html>\n",
      text(title).str(), kit_style(), document_style(), body.str());
}

std::string page_with_script(std::string_view title, const Html& body, std::string_view style,
                             const std::string& data, std::string_view script) {
  return fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
      "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; base-uri 'none'; "
      "form-action 'none'; style-src 'unsafe-inline'; script-src {}\">\n"
      "<meta name=\"color-scheme\" content=\"light dark\">\n"
      "<title>{}</title>\n<style>\n{}{}</style>\n</head>\n<body>\n<main>\n{}\n</main>\n"
      "<script type=\"application/json\" id=\"data\">{}</script>\n<script>{}</script>\n</body>\n</html>\n",
      hash_source(script), text(title).str(), kit_style(), style, body.str(), json_for_script(data), script);
}

Html figure_place(std::string_view id, const Html& caption, std::string_view css_class) {
  return Html::markup(
      fmt::format("<figure class=\"{}\"><figcaption>{}</figcaption><div class=\"legend\"></div>"
                  "<div class=\"plot\" data-figure=\"{}\"></div></figure>",
                  css_class, caption.str(), text(id).str()));
}

}  // namespace imuscope::page
