/// The page in a real browser, at the width of a desktop and of a phone: nothing sticks out sideways, the
/// script says nothing on the console, every figure has ink. The pictures stay in the test's folder to be
/// looked at.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>

#include "base/output_folder.h"
#include "results/page/printed_page.h"
#include "results/report/paper_figures.h"
#include "results/report/report.h"
#include "tests/results/report/synthetic_run.h"
#include "tests/support/file_content.h"
#include "tests/support/shared_data.h"

namespace imuscope {
namespace {

using test::content_of;

constexpr const char* kBrowser = "/usr/bin/chromium";
constexpr const char* kGnuplot = "/usr/bin/gnuplot";
constexpr const char* kPdfToText = "/usr/bin/pdftotext";

/// What `command` writes to its standard output.
std::string output_of(const std::string& command) {
  std::string output;
  FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return output;
  std::array<char, 65536> block{};
  for (std::size_t n = 0; (n = fread(block.data(), 1, block.size(), pipe)) > 0;)
    output.append(block.data(), n);
  pclose(pipe);
  return output;
}

/// What was measured of the page.
struct Measured {
  int width = 0;  ///< of what can be scrolled to
  int height = 0;
  int places = 0;   ///< for figures
  int blank = 0;    ///< of them without ink
  int figures = 0;  ///< drawn, by the page's own count
  int folded = 0;   ///< height before all folds were opened
  std::string console;
};

/// What the page said on the console; not what the browser says of a machine that is busy with other things.
std::string console_of(const std::filesystem::path& log) {
  std::string said;
  std::istringstream lines(content_of(log));
  for (std::string line; std::getline(lines, line);) {
    if (line.find("CONSOLE") == std::string::npos) continue;
    if (line.find("Slow network is detected") != std::string::npos) continue;
    said += line + "\n";
  }
  return said;
}

class Browser : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kBrowser)) {
      GTEST_SKIP() << "needs " << kBrowser << " (Debian package chromium), which is absent here";
    }
    folder_ = test::scratch_folder();
    test::write_synthetic_run(folder_, {});
    const auto written = write_report(folder_);
    ASSERT_TRUE(written) << written.error().text();
  }

  /// A page that shows the report in a frame of the wanted width: a window cannot be as narrow as a phone.
  std::filesystem::path frame_of(int width, int height) const {
    const auto file = folder_ / ("frame_" + std::to_string(width) + ".html");
    std::ofstream(file)
        << R"(<!DOCTYPE html><meta charset="utf-8"><body style="margin:0"><iframe id="page" src="report.html" )"
        << "style=\"border:0;width:" << width << "px;height:" << height << "px\"></iframe>"
        << R"(<script>
const frame = document.getElementById('page');
frame.onload = () => setTimeout(() => {
  const page = frame.contentDocument;
  const folded = page.documentElement.scrollHeight;
  page.querySelectorAll('details').forEach((fold) => { fold.open = true; });
  setTimeout(() => {
  const hasInk = (canvas) => canvas.width > 0 && canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data
      .some((value, i) => i % 4 === 3 && value > 0);
  const places = [...page.querySelectorAll('.plot')];
  const blank = places.filter((place) => !place.querySelector('svg') &&
                                         ![...place.querySelectorAll('canvas')].some(hasInk)).length;
  document.body.dataset.measured = [page.documentElement.scrollWidth, page.documentElement.scrollHeight,
                                    places.length, blank, page.body.dataset.figuresDrawn, folded].join(' ');
  }, 1000);
}, 500);
</script>)";
    return file;
  }

  std::string command(const std::string& options, const std::filesystem::path& page,
                      const std::filesystem::path& console) const {
    return std::string(kBrowser) +
           " --headless --no-sandbox --disable-gpu --no-first-run --disable-background-networking "
           "--allow-file-access-from-files --hide-scrollbars --enable-logging=stderr --user-data-dir='" +
           (folder_ / "profile").string() + "' " + options + " 'file://" + page.string() + "' 2>'" +
           console.string() + "'";
  }

  Measured measured_at(int width) const {
    const auto console = folder_ / ("console_" + std::to_string(width) + ".txt");
    const std::string page =
        output_of(command("--virtual-time-budget=20000 --dump-dom", frame_of(width, 1000), console));
    Measured out;
    std::smatch found;
    const std::regex pattern("data-measured=\"(\\d+) (\\d+) (\\d+) (\\d+) (\\d+) (\\d+)\"");
    if (std::regex_search(page, found, pattern)) {
      out.width = std::stoi(found[1]);
      out.height = std::stoi(found[2]);
      out.places = std::stoi(found[3]);
      out.blank = std::stoi(found[4]);
      out.figures = std::stoi(found[5]);
      out.folded = std::stoi(found[6]);
    }
    out.console = console_of(console);
    return out;
  }

  std::filesystem::path folder_;
};

TEST_F(Browser, AtDesktopAndPhoneWidthNothingSticksOutEveryFigureHasInkAndTheConsoleIsSilent) {
  for (const int width : {1280, 390}) {
    const Measured page = measured_at(width);
    EXPECT_EQ(page.width, width) << "the page scrolls sideways";
    // Speed, height and per sensor 6 estimates, time offset, 6 errors, 15 scatters, 6 wavelets and one
    // dependence; the map is a drawing of its own.
    EXPECT_EQ(page.figures, 70) << width;
    EXPECT_EQ(page.places, 71) << width;
    EXPECT_EQ(page.blank, 0) << width;
    if (width == 1280) {
      EXPECT_LT(page.folded, 12'000) << "what is normal is folded away";
    }
    EXPECT_EQ(page.console, "") << width;
    // A picture of all of it stays to be looked at.
    const auto picture = folder_ / ("page_" + std::to_string(width) + ".png");
    const int height = std::min(page.height, 16000);
    output_of(command("--virtual-time-budget=20000 --screenshot='" + picture.string() + "' --window-size=" +
                          std::to_string(std::max(width, 500)) + "," + std::to_string(height),
                      frame_of(width, height), folder_ / "screenshot.txt"));
    ASSERT_TRUE(std::filesystem::exists(picture));
    EXPECT_GT(std::filesystem::file_size(picture), 100'000U) << "an empty page compresses to less";
  }
}

TEST_F(Browser, AScriptThatFailsIsSeen) {
  // The watch itself: without it the test above could not fail.
  auto page = content_of(folder_ / "report.html");
  const auto at = page.find("const graphs = [];");
  ASSERT_NE(at, std::string::npos);
  page.insert(at, "throw new Error('made to fail');");
  // A changed script is not run; one from the page's own file is, where the policy says so.
  const std::string policy = "script-src ";
  const auto allowed = page.find(policy);
  ASSERT_NE(allowed, std::string::npos);
  page.replace(allowed + policy.size(), page.find(';', allowed) - allowed - policy.size(), "'unsafe-inline'");
  std::ofstream(folder_ / "report.html") << page;
  const Measured broken = measured_at(1280);
  EXPECT_NE(broken.console.find("made to fail"), std::string::npos);
}

/// Markup and scripts in as many disguises; each would call pwned(i).
std::vector<std::string> payloads() {
  const std::vector<std::string> kBare{"<img src=x onerror=pwned(N)>",
                                       "<svg onload=pwned(N)>",
                                       "<script>pwned(N)</script>",
                                       "<iframe srcdoc='<script>parent.pwned(N)</script>'></iframe>",
                                       "<a href=javascript:pwned(N)>x</a>",
                                       "<body onload=pwned(N)>",
                                       "<details open ontoggle=pwned(N)>",
                                       "<video src=x onerror=pwned(N)></video>",
                                       "<object data=javascript:pwned(N)></object>",
                                       "<math href=javascript:pwned(N)>x</math>",
                                       "<style>@import 'x';</style><img src=x onerror=pwned(N)>",
                                       "<base href=//example.invalid/>",
                                       "<form action=javascript:pwned(N)><button>x</button></form>",
                                       "<input autofocus onfocus=pwned(N)>",
                                       "<template><img src=x onerror=pwned(N)></template>",
                                       "<meta http-equiv=refresh content='0;url=javascript:pwned(N)'>",
                                       "<link rel=stylesheet href=x onerror=pwned(N)>",
                                       "javascript:pwned(N)",
                                       "{{figures}}{{page_script}}<img src=x onerror=pwned(N)>",
                                       "__proto__",
                                       "constructor",
                                       "&lt;img src=x onerror=pwned(N)&gt;",
                                       "&#60;img src=x onerror=pwned(N)&#62;",
                                       "\\u003cimg src=x onerror=pwned(N)\\u003e",
                                       "${pwned(N)}`+pwned(N)+`"};
  const std::vector<std::string> kPrefixes{
      "", "\">", "'>", "</script>", "</td></table>", "-->", "</title></style>", "]]>\u2028"};
  std::vector<std::string> all;
  for (const std::string& prefix : kPrefixes) {
    for (const std::string& bare : kBare) {
      std::string payload = prefix + bare;
      const std::string number = std::to_string(all.size());
      for (std::size_t at = 0; (at = payload.find("(N)", at)) != std::string::npos;)
        payload.replace(at + 1, 1, number);
      all.push_back(payload);
    }
  }
  return all;
}

/// Puts the next payload in place of every text, but where a report would have nothing to show then.
void poison(nlohmann::json& value, const std::vector<std::string>& with, std::size_t& next) {
  if (value.is_string()) {
    value = with[next++ % with.size()];
  } else if (value.is_array()) {
    for (auto& element : value) poison(element, with, next);
  } else if (value.is_object()) {
    static const std::set<std::string> kKept{"schema", "axis", "status", "method", "model", "weights", "by"};
    for (auto& [key, member] : value.items()) {
      const bool is_name =
          key == "name" && member.is_string() && member.get<std::string>().rfind("mtx", 0) == 0;
      const bool is_driver = key == "driver" && member.is_string();
      if (!kKept.contains(key) && !is_name && !is_driver) poison(member, with, next);
    }
  }
}

TEST_F(Browser, TwoHundredTextsThatWouldBeScriptsAreText) {
  const auto all = payloads();
  ASSERT_EQ(all.size(), 200U);
  std::size_t next = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    if (entry.path().extension() != ".json") continue;
    auto document = nlohmann::json::parse(content_of(entry.path()));
    if (entry.path().filename() == "run.json") {
      for (const std::string& payload : all) document["warnings"].push_back(payload);
    }
    poison(document, all, next);
    std::ofstream(entry.path()) << document.dump();
  }
  EXPECT_GT(next, 400U);
  ASSERT_TRUE(write_report(folder_));
  const auto frame = folder_ / "attacked.html";
  std::ofstream(frame) << R"(<!DOCTYPE html><meta charset="utf-8"><body><iframe id="page" src="report.html" )"
                       << R"(style="width:1280px;height:1000px"></iframe><script>
const frame = document.getElementById('page');
let called = 0;
window.pwned = () => { ++called; };
frame.onload = () => {
  frame.contentWindow.pwned = window.pwned;
  // A pointer over every figure, whose legend then names what lies under it.
  for (const plot of frame.contentDocument.querySelectorAll('.plot canvas')) {
    const place = plot.getBoundingClientRect();
    for (const kind of ['mousemove', 'mouseover'])
      plot.dispatchEvent(new frame.contentWindow.MouseEvent(kind, {bubbles: true, clientX: place.x + place.width / 2,
                                                                   clientY: place.y + place.height / 2}));
  }
  // Figures are drawn one after the other, on a busy machine for longer.
  const measure = (drawnBefore) => {
    const page = frame.contentDocument;
    const drawn = page.body.dataset.figuresDrawn;
    if (drawn !== drawnBefore) { setTimeout(() => measure(drawn), 1000); return; }
    const foreign = [...page.querySelectorAll('*')].filter((element) =>
        /^(img|iframe|object|embed|base|link|form|input|video|audio|math|template|a)$/i.test(element.tagName) && !(element.tagName === 'INPUT' && element.closest('.plot')) &&
            !element.matches('nav.contents > a[href^="#"]') ||
        [...element.attributes].some((attribute) => /^on|^srcdoc$/i.test(attribute.name)));
    const words = page.body.textContent;
    const shown = Array.from({length: 200}, (_, i) => i).filter((i) => words.includes('pwned(' + i + ')')).length;
    document.body.dataset.measured = [called, foreign.length, page.querySelectorAll('script').length, shown,
                                      drawn].join(' ');
  };
  setTimeout(() => measure(undefined), 500);
};
</script>)";
  const auto console = folder_ / "console_attacked.txt";
  const std::string page = output_of(command("--virtual-time-budget=20000 --dump-dom", frame, console));
  std::smatch found;
  ASSERT_TRUE(
      std::regex_search(page, found, std::regex("data-measured=\"(\\d+) (\\d+) (\\d+) (\\d+) (\\d+)\"")));
  EXPECT_EQ(found[1], "0") << "scripts that ran";
  EXPECT_EQ(found[2], "0") << "elements that no page of ours has";
  EXPECT_EQ(found[3], "3") << "scripts in the page: the figures, the library and our own";
  EXPECT_GT(std::stoi(found[4]), 150) << "payloads that are read as text";
  EXPECT_GT(std::stoi(found[5]), 20) << "figures drawn all the same";
  EXPECT_EQ(content_of(console).find("Content Security Policy"), std::string::npos) << content_of(console);
  EXPECT_EQ(console_of(console), "");
}

TEST_F(Browser, AScriptThatGotIntoThePageIsNotRun) {
  auto page = content_of(folder_ / "report.html");
  const auto at = page.find("<main>");
  ASSERT_NE(at, std::string::npos);
  page.insert(at,
              "<script>document.documentElement.lang = 'pwned'</script>"
              "<img src=x onerror=\"document.documentElement.lang = 'pwned'\">");
  std::ofstream(folder_ / "forged.html") << page;
  const auto console = folder_ / "console_forged.txt";
  const std::string dom =
      output_of(command("--virtual-time-budget=20000 --dump-dom", folder_ / "forged.html", console));
  EXPECT_NE(dom.find("<html lang=\"en\""), std::string::npos);
  EXPECT_NE(content_of(console).find("Content Security Policy"), std::string::npos)
      << "the browser says that it refused";
}

TEST_F(Browser, PrintsAsPdf) {
  const auto pdf = folder_ / "page.pdf";
  output_of(
      command("--virtual-time-budget=20000 --no-pdf-header-footer --print-to-pdf='" + pdf.string() + "'",
              folder_ / "report.html", folder_ / "print.txt"));
  ASSERT_TRUE(std::filesystem::exists(pdf));
  const std::string content = content_of(pdf);
  EXPECT_EQ(content.rfind("%PDF", 0), 0U);
  EXPECT_GT(content.size(), 100'000U);
  // What is open on the screen is on eight pages at most, and behind them what is folded.
  if (!std::filesystem::exists(kPdfToText))
    GTEST_SKIP() << "needs " << kPdfToText << " (Debian package poppler-utils)";
  int before_appendix = 0;
  int pages = 0;
  bool found = false;
  std::istringstream text(output_of(std::string(kPdfToText) + " '" + pdf.string() + "' -"));
  for (std::string page; std::getline(text, page, '\f'); ++pages) {
    found = found || page.find("Appendix\n") != std::string::npos;
    if (!found) ++before_appendix;
  }
  EXPECT_TRUE(found);
  EXPECT_LE(before_appendix, 8);
  EXPECT_GT(pages, before_appendix + 2) << "the appendix has all that is folded";
}

TEST_F(Browser, TheCommandPrintsAPageAndSaysWhereThereIsNoBrowser) {
  const auto folder = OutputFolder::open(folder_);
  ASSERT_TRUE(folder);
  const auto printed = page::print_page(*folder, "report.html");
  ASSERT_TRUE(printed) << printed.error().text();
  EXPECT_EQ(content_of(*printed).rfind("%PDF", 0), 0U);
  const std::string path = std::getenv("PATH");
  setenv("PATH", folder_.c_str(), 1);
  const auto none = page::print_page(*folder, "report.html");
  setenv("PATH", path.c_str(), 1);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().text().find("apt-get install chromium"), std::string::npos);
}

TEST(PaperFigures, AreDrawnAsSvgAndPdfAndWhatIsMissingIsLeftOut) {
  if (!std::filesystem::exists(kGnuplot)) {
    GTEST_SKIP() << "needs " << kGnuplot << " (Debian package gnuplot-nox), which is absent here";
  }
  const auto folder = test::scratch_folder();
  test::SyntheticRun options;
  options.names = {"mtx1"};
  options.with_regression = false;
  test::write_synthetic_run(folder, options);
  const auto files = write_figures(folder);
  ASSERT_TRUE(files) << files.error().text();
  std::vector<std::string> names;
  for (const auto& file : *files) names.push_back(file.filename().string());
  EXPECT_EQ(names, (std::vector<std::string>{"drive.svg", "drive.pdf", "figure1_mtx1.svg", "figure1_mtx1.pdf",
                                             "figure2_mtx1.svg", "figure2_mtx1.pdf", "figure4_mtx1.svg",
                                             "figure4_mtx1.pdf"}));
  for (const auto& file : *files) {
    const std::string content = content_of(file);
    if (file.extension() == ".pdf") {
      EXPECT_EQ(content.rfind("%PDF", 0), 0U) << file;
    } else {
      EXPECT_NE(content.find("</svg>"), std::string::npos) << file;
      EXPECT_NE(content.find("<path"), std::string::npos) << file;
    }
  }
  // Total and components of both regimes: dashed lines are the components.
  EXPECT_NE(content_of(folder / "figures" / "figure4_mtx1.svg").find("stroke-dasharray"), std::string::npos);
}

}  // namespace
}  // namespace imuscope
