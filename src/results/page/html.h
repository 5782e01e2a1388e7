#pragma once

/// Markup that cannot be confused with text: whatever comes from a file becomes markup only through text(),
/// which escapes it.

#include <string>
#include <string_view>
#include <vector>

namespace imuscope::page {

class Html {
 public:
  Html() = default;
  /// For markup written in this program, never for what was read from a file.
  static Html markup(std::string_view trusted) { return Html(std::string(trusted)); }

  Html& operator+=(const Html& other) {
    markup_ += other.markup_;
    return *this;
  }
  friend Html operator+(Html left, const Html& right) { return left += right; }
  [[nodiscard]] const std::string& str() const { return markup_; }
  [[nodiscard]] bool empty() const { return markup_.empty(); }

 private:
  explicit Html(std::string markup) : markup_(std::move(markup)) {}
  std::string markup_;
};

/// Text of any origin, safe inside elements and quoted attributes.
Html text(std::string_view any);

/// `<tag class="css_class">content</tag>`; `tag` and `css_class` are written in this program.
Html element(std::string_view tag, const Html& content, std::string_view css_class = {});

/// A paragraph of plain text.
Html paragraph(std::string_view any, std::string_view css_class = {});

/// Items of a list; nothing where there are none.
Html list_of(const std::vector<std::string>& sentences, std::string_view css_class = {});

/// The heading of a section; the page's contents lead to `id`, which is written in this program.
Html heading(std::string_view id, std::string_view words);

/// A link to the heading `id` of the same page.
Html link_to_heading(std::string_view id, std::string_view words);

/// A drawing of this program in the page itself, in the page's colours.
/// @param words  what it shows, for those who do not see it
/// @param inner  its elements, written in this program; what was read from a file is in them by text() alone
Html inline_svg(std::string_view css_class, double width, double height, std::string_view words,
                const std::string& inner);

/// What a reader who wants all of it opens; `summary` says what is inside. On paper it stands in the
/// appendix. Nothing where `content` is empty.
/// @param open  from the beginning, where it differs from what is normal; it then stays in its place on paper
Html fold(std::string_view summary, const Html& content, bool open = false);

/// A JSON document as the content of a `<script>` element: no text in it can end the element.
std::string json_for_script(const std::string& json);

/// A table with a heading row. The first cell of a row is its heading. Where the page is too narrow for it,
/// every row becomes a list of its cells, each after its heading.
class Table {
 public:
  explicit Table(std::vector<Html> headings) : headings_(std::move(headings)) {}
  void add_row(std::vector<Html> cells) { rows_.push_back(std::move(cells)); }
  /// A row that names the group of rows below it.
  void add_group(Html name) { rows_.push_back({std::move(name)}); }
  [[nodiscard]] bool empty() const { return rows_.empty(); }
  [[nodiscard]] Html html() const;

 private:
  std::vector<Html> headings_;
  std::vector<std::vector<Html>> rows_;
};

/// A picture as part of the page: nothing in an SVG file becomes markup of it.
/// @param words  what it shows, for those who do not see it
Html svg_image(const std::string& svg, std::string_view words);

/// A whole page that runs no script and loads nothing, in the style of all pages.
std::string page_without_script(std::string_view title, const Html& body);

/// A whole page that runs the script given and no other, and loads nothing.
/// @param style  after the kit's
/// @param data   JSON that the script finds in the element `data`
std::string page_with_script(std::string_view title, const Html& body, std::string_view style,
                             const std::string& data, std::string_view script);

/// A place where page.js draws the figure `id`, with what it shows in words below it.
Html figure_place(std::string_view id, const Html& caption, std::string_view css_class = {});

}  // namespace imuscope::page
