#include "drivers/dbc/parser.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>

#include "base/text.h"
#include "drivers/dbc/tokens.h"

namespace imuscope::dbc {
namespace {

constexpr std::uint32_t kExtendedBit = 0x8000'0000U;
constexpr std::uint32_t kStandardIdMax = 0x7FF;
constexpr std::uint32_t kExtendedIdMax = 0x1FFF'FFFF;
constexpr std::size_t kFdBytesMax = 64;
constexpr unsigned kRawBitsMax = 64;
/// Far more than any vehicle's file has: what a file claims must not take the memory of the PC, or its time.
constexpr std::size_t kMessagesMax = 16'384;
constexpr std::size_t kSignalsMax = 131'072;
constexpr std::size_t kNamesMax = 1'048'576;
constexpr std::size_t kSwitchesMax = 16;
/// Holds the signals that belong to no message; not a frame.
constexpr std::string_view kNoMessage = "VECTOR__INDEPENDENT_SIG_MSG";

/// Statements that end with a semicolon and say nothing that is needed here.
constexpr auto kSkipped = std::to_array<std::string_view>({"CM_",
                                                           "BA_DEF_",
                                                           "BA_",
                                                           "BA_DEF_DEF_",
                                                           "BA_DEF_REL_",
                                                           "BA_REL_",
                                                           "BA_DEF_DEF_REL_",
                                                           "BA_DEF_SGTYPE_",
                                                           "BA_SGTYPE_",
                                                           "BO_TX_BU_",
                                                           "BU_SG_REL_",
                                                           "BU_EV_REL_",
                                                           "BU_BO_REL_",
                                                           "CAT_DEF_",
                                                           "CAT_",
                                                           "FILTER",
                                                           "EV_",
                                                           "EV_DATA_",
                                                           "ENVVAR_DATA_",
                                                           "SGTYPE_",
                                                           "SGTYPE_VAL_",
                                                           "SIG_TYPE_REF_",
                                                           "SIG_GROUP_",
                                                           "SIGTYPE_VALTYPE_",
                                                           "SG_MUL_VAL_REL_"});

/// Left where the parser gives up; nothing else of it leaves this file.
struct Mistake {
  std::size_t line;
  std::string what;
};

/// Multiplexing as written at a signal: nothing, M, m3, or m3M.
struct MuxMark {
  bool is_switch = false;
  std::optional<std::uint64_t> value;
};

class Parser {
 public:
  Parser(std::string_view text, const std::string& name) : tokens_(text) { database_.file = name; }

  Result<Database> run() {
    try {
      while (now().kind != TokenKind::kEnd) statement();
      if (database_.messages.empty()) fail(now().line, "it describes no message (BO_)");
      link_switches();
      for (const Message& message : database_.messages) check(message);
    } catch (const Mistake& mistake) {
      return usage_error(fmt::format("{}:{}: {}", database_.file, mistake.line, mistake.what),
                         "mend that line, or export the file again from the tool that made it");
    }
    return std::move(database_);
  }

 private:
  [[noreturn]] static void fail(std::size_t line, std::string what) { throw Mistake{line, std::move(what)}; }
  [[nodiscard]] const Token& now() const { return tokens_.current(); }
  [[noreturn]] void fail_expected(std::string_view what) const {
    fail(now().line, fmt::format("{}expected {}, found {}", context_, what, describe(now())));
  }

  [[nodiscard]] bool is_sign(char sign) const {
    return now().kind == TokenKind::kSign && now().text[0] == sign;
  }
  bool take_sign(char sign) {
    if (!is_sign(sign)) return false;
    tokens_.advance();
    return true;
  }
  void expect_sign(char sign) {
    if (!take_sign(sign)) fail_expected(fmt::format("'{}'", sign));
  }
  std::string expect_word(std::string_view what) {
    if (now().kind != TokenKind::kWord) fail_expected(what);
    std::string word(now().text);
    tokens_.advance();
    return word;
  }
  std::string expect_text(std::string_view what) {
    if (now().kind != TokenKind::kText) fail_expected(what);
    std::string text(now().text);
    tokens_.advance();
    return text;
  }
  double expect_number(std::string_view what) {
    if (now().kind != TokenKind::kNumber) fail_expected(what);
    std::string_view text = now().text;
    if (text.front() == '+') text.remove_prefix(1);
    double value = 0.0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || !std::isfinite(value)) fail_expected(what);
    tokens_.advance();
    return value;
  }
  template <typename Integer>
  Integer expect_integer(std::string_view what) {
    if (now().kind != TokenKind::kNumber) fail_expected(what);
    const Integer value = integer_of<Integer>(now().text, what);
    tokens_.advance();
    return value;
  }
  template <typename Integer>
  Integer integer_of(std::string_view text, std::string_view what) const {
    if (!text.empty() && text.front() == '+') text.remove_prefix(1);
    Integer value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc{} && end == text.data() + text.size()) return value;
    // Some tools write whole numbers as 1.0 or 1E+002.
    double real = 0.0;
    const auto [real_end, real_error] = std::from_chars(text.data(), text.data() + text.size(), real);
    constexpr double kExact = 9007199254740992.0;  // 2^53: whole numbers up to here are exact
    const bool whole = real_error == std::errc{} && real_end == text.data() + text.size() &&
                       std::trunc(real) == real && std::abs(real) <= kExact;
    if (!whole || (std::is_unsigned_v<Integer> && real < 0.0) ||
        std::abs(real) > static_cast<double>(std::numeric_limits<Integer>::max())) {
      fail_expected(what);
    }
    return static_cast<Integer>(real);
  }

  void statement() {
    context_.clear();
    if (now().kind != TokenKind::kWord) fail_expected("a keyword such as BO_");
    const Token keyword = now();
    tokens_.advance();
    context_ = fmt::format("{}: ", keyword.text);
    if (keyword.text == "BO_") {
      message(keyword.line);
    } else if (keyword.text == "SG_") {
      if (!in_message_) fail(keyword.line, "SG_ stands before any BO_");
      signal(keyword.line);
    } else if (keyword.text == "VAL_") {
      value_names();
    } else if (keyword.text == "VAL_TABLE_") {
      value_table();
    } else if (keyword.text == "SIG_VALTYPE_") {
      value_type();
    } else if (keyword.text == "SG_MUL_VAL_") {
      extended_multiplexing();
    } else if (keyword.text == "VERSION") {
      expect_text("a text in quotation marks");
    } else if (keyword.text == "NS_" || keyword.text == "BS_" || keyword.text == "BU_") {
      skip_section();
    } else if (std::find(kSkipped.begin(), kSkipped.end(), keyword.text) != kSkipped.end()) {
      skip_statement(keyword);
    } else {
      context_.clear();
      fail(keyword.line, fmt::format("unknown keyword '{}'", keyword.text));
    }
  }

  /// NS_, BS_ and BU_ have no end mark: they end where a line begins with a word that is not indented.
  void skip_section() {
    expect_sign(':');
    while (now().kind != TokenKind::kEnd && !(now().kind == TokenKind::kWord && now().begins_line)) {
      if (now().kind == TokenKind::kOpenText) fail_expected("names");
      tokens_.advance();
    }
  }

  void skip_statement(const Token& keyword) {
    while (!is_sign(';')) {
      if (now().kind == TokenKind::kEnd || now().kind == TokenKind::kOpenText) {
        fail(keyword.line, fmt::format("{} has no ';' at its end", keyword.text));
      }
      tokens_.advance();
    }
    tokens_.advance();
  }

  void message(std::size_t line) {
    Message message;
    message.line = line;
    const auto id = expect_integer<std::uint32_t>("the identifier, a whole number");
    message.name = expect_word("the message's name");
    expect_sign(':');
    message.length = expect_integer<std::size_t>("the length in bytes");
    expect_word("the sender's name");
    in_message_ = true;
    is_frame_ = message.name != kNoMessage;
    if (!is_frame_) return;
    message.is_extended = (id & kExtendedBit) != 0;
    message.id = id & ~kExtendedBit;
    if (message.id > (message.is_extended ? kExtendedIdMax : kStandardIdMax)) {
      fail(line, fmt::format("BO_ {}: identifier {} has more than {} bits", message.name, id,
                             message.is_extended ? 29 : 11));
    }
    if (message.length > kFdBytesMax) {
      fail(line, fmt::format("BO_ {}: {} bytes are more than the {} of a CAN FD frame", message.name,
                             message.length, kFdBytesMax));
    }
    const auto [place, is_new] = by_id_.try_emplace(id, database_.messages.size());
    if (!is_new) {
      const Message& other = database_.messages[place->second];
      fail(line, fmt::format("BO_ {}: identifier {} is {}'s already (line {})", message.name, id, other.name,
                             other.line));
    }
    if (by_id_.size() > kMessagesMax)
      fail(line, fmt::format("it describes more than {} messages", kMessagesMax));
    database_.messages.push_back(std::move(message));
    marks_.emplace_back();
    signal_lines_.emplace_back();
    by_name_.emplace_back();
  }

  MuxMark mux_mark() {
    MuxMark mark;
    if (is_sign(':')) return mark;
    if (now().kind != TokenKind::kWord) fail_expected("':', M or m with a number");
    std::string_view text = now().text;
    mark.is_switch = text.ends_with('M');
    if (mark.is_switch) text.remove_suffix(1);
    if (!text.empty()) {
      if (text[0] != 'm' || text.size() < 2) fail_expected("':', M or m with a number");
      mark.value = integer_of<std::uint64_t>(text.substr(1), "':', M or m with a number");
    }
    tokens_.advance();
    return mark;
  }

  void signal(std::size_t line) {
    Signal signal;
    signal.name = expect_word("the signal's name");
    context_ = fmt::format("SG_ {}: ", signal.name);
    const MuxMark mark = mux_mark();
    expect_sign(':');
    signal.layout.start = expect_integer<std::uint16_t>("the start bit");
    expect_sign('|');
    signal.layout.length = expect_integer<std::uint16_t>("the length in bits");
    expect_sign('@');
    read_order_and_sign(signal.layout);
    expect_sign('(');
    signal.layout.factor = expect_number("the factor");
    expect_sign(',');
    signal.layout.offset = expect_number("the offset");
    expect_sign(')');
    expect_sign('[');
    signal.minimum = expect_number("the minimum");
    expect_sign('|');
    signal.maximum = expect_number("the maximum");
    expect_sign(']');
    signal.unit = expect_text("the unit in quotation marks");
    expect_word("a receiver's name");
    while (take_sign(',') || (now().kind == TokenKind::kWord && now().line == line)) {
      if (now().kind == TokenKind::kWord) tokens_.advance();
    }
    if (!is_frame_) return;
    Message& message = database_.messages.back();
    if (++n_signals_ > kSignalsMax) fail(line, fmt::format("it describes more than {} signals", kSignalsMax));
    if (!by_name_.back().try_emplace(signal.name, message.signals.size()).second)
      fail(line,
           fmt::format("SG_ {}: message {} has a signal of that name already", signal.name, message.name));
    signal.is_switch = mark.is_switch;
    message.signals.push_back(std::move(signal));
    marks_.back().push_back(mark);
    signal_lines_.back().push_back(line);
  }

  /// "1+", "0-": the number takes no sign of its own, so that the two come as a number and a sign.
  void read_order_and_sign(SignalLayout& layout) {
    const auto order = expect_integer<int>("the byte order, 0 or 1");
    if (order != 0 && order != 1)
      fail(now().line, fmt::format("{}byte order {} is neither 0 (Motorola) nor 1 (Intel)", context_, order));
    layout.order = order == 1 ? ByteOrder::kIntel : ByteOrder::kMotorola;
    if (take_sign('-')) {
      layout.coding = Coding::kSigned;
    } else if (!take_sign('+')) {
      fail_expected("'+' or '-' after the byte order");
    }
  }

  /// Message and signal that a later statement speaks of.
  struct Named {
    std::size_t message;
    std::size_t signal;
  };
  std::optional<Named> named_signal() {
    const std::size_t line = now().line;
    const auto id = expect_integer<std::uint32_t>("the identifier of a message");
    const std::string name = expect_word("a signal's name");
    if (const auto message = by_id_.find(id); message != by_id_.end()) {
      const auto signal = signal_of(message->second, name);
      if (!signal)
        fail(line, fmt::format("{}message {} has no signal '{}'", context_,
                               database_.messages[message->second].name, name));
      return Named{message->second, *signal};
    }
    constexpr std::uint32_t kNoMessageId = 0xC000'0000U;
    if (id != kNoMessageId) fail(line, fmt::format("{}no message has the identifier {}", context_, id));
    return std::nullopt;
  }
  [[nodiscard]] std::optional<std::size_t> signal_of(std::size_t message, const std::string& name) const {
    const auto found = by_name_[message].find(name);
    return found == by_name_[message].end() ? std::nullopt : std::optional(found->second);
  }
  [[nodiscard]] Signal& at(const Named& named) {
    return database_.messages[named.message].signals[named.signal];
  }

  std::vector<NamedValue> number_name_pairs() {
    std::vector<NamedValue> names;
    while (!take_sign(';')) {
      const auto number = expect_integer<std::int64_t>("a number or ';'");
      names.push_back({number, expect_text("the name of that number, in quotation marks")});
      count_names(1);
    }
    return names;
  }

  void count_names(std::size_t n) {
    n_names_ += n;
    if (n_names_ > kNamesMax) fail(now().line, fmt::format("it names more than {} values", kNamesMax));
  }

  void value_names() {
    // Of an environment variable: no identifier stands first.
    if (now().kind == TokenKind::kWord) {
      tokens_.advance();
      number_name_pairs();
      return;
    }
    const auto signal = named_signal();
    std::vector<NamedValue> names;
    if (now().kind == TokenKind::kWord) {
      const std::string table = expect_word("a table");
      if (!tables_.contains(table))
        fail(now().line, fmt::format("{}no VAL_TABLE_ is called '{}'", context_, table));
      count_names(tables_[table].size());  // a copy for each signal
      names = tables_[table];
      expect_sign(';');
    } else {
      names = number_name_pairs();
    }
    if (signal) at(*signal).names = std::move(names);
  }

  void value_table() {
    const std::string name = expect_word("the table's name");
    tables_[name] = number_name_pairs();
  }

  void value_type() {
    const std::size_t line = now().line;
    const auto signal = named_signal();
    take_sign(':');
    const auto type = expect_integer<int>("0, 1 (float) or 2 (double)");
    expect_sign(';');
    if (!signal || type == 0) return;
    if (type != 1 && type != 2) fail(line, fmt::format("{}type {} is none of 0, 1, 2", context_, type));
    SignalLayout& layout = at(*signal).layout;
    const unsigned bits = type == 1 ? 32 : kRawBitsMax;
    if (layout.length != bits) {
      fail(line, fmt::format("{}signal {} has {} bits, a {} has {}", context_, at(*signal).name,
                             layout.length, type == 1 ? "float" : "double", bits));
    }
    layout.coding = type == 1 ? Coding::kFloat : Coding::kDouble;
  }

  /// SG_MUL_VAL_ id signal switch 0-3, 5-5;
  void extended_multiplexing() {
    const std::size_t line = now().line;
    const auto signal = named_signal();
    const std::string name = expect_word("the name of the switching signal");
    std::vector<RawRange> ranges;
    do {
      const auto low = expect_integer<std::uint64_t>("the first value of a range");
      // "0-3" comes as 0 and -3.
      std::uint64_t high = 0;
      if (take_sign('-')) {
        high = expect_integer<std::uint64_t>("the last value of a range");
      } else if (now().kind == TokenKind::kNumber && now().text.starts_with('-')) {
        high = integer_of<std::uint64_t>(now().text.substr(1), "the last value of a range");
        tokens_.advance();
      } else {
        fail_expected("'-' and the last value of a range");
      }
      if (high < low) fail(line, fmt::format("{}range {}-{} is empty", context_, low, high));
      ranges.push_back({low, high});
    } while (take_sign(','));
    expect_sign(';');
    if (!signal) return;
    const Message& message = database_.messages[signal->message];
    const auto by = signal_of(signal->message, name);
    if (!by) fail(line, fmt::format("{}message {} has no signal '{}'", context_, message.name, name));
    Signal& target = at(*signal);
    if (*by == signal->signal) fail(line, fmt::format("{}{} cannot switch itself", context_, name));
    target.switched_by = by;
    target.present_for = std::move(ranges);
  }

  /// Signals marked m3 are switched by the message's M, where SG_MUL_VAL_ does not say otherwise.
  void link_switches() {
    for (std::size_t m = 0; m < database_.messages.size(); ++m) {
      Message& message = database_.messages[m];
      std::optional<std::size_t> top;
      for (std::size_t s = 0; s < message.signals.size(); ++s) {
        if (!marks_[m][s].is_switch || marks_[m][s].value) continue;
        if (top) {
          fail(signal_lines_[m][s],
               fmt::format("SG_ {}: message {} has a second multiplexer M beside {}", message.signals[s].name,
                           message.name, message.signals[*top].name));
        }
        top = s;
      }
      for (std::size_t s = 0; s < message.signals.size(); ++s) {
        Signal& signal = message.signals[s];
        if (!marks_[m][s].value || signal.switched_by) continue;
        if (!top) {
          fail(signal_lines_[m][s], fmt::format("SG_ {}: is multiplexed (m{}), and message {} has no M",
                                                signal.name, *marks_[m][s].value, message.name));
        }
        signal.switched_by = *top;
        signal.present_for = {{*marks_[m][s].value, *marks_[m][s].value}};
      }
    }
  }

  void check(const Message& message) {
    const auto m = static_cast<std::size_t>(&message - database_.messages.data());
    for (std::size_t s = 0; s < message.signals.size(); ++s) {
      const Signal& signal = message.signals[s];
      const std::size_t line = signal_lines_[m][s];
      if (signal.layout.length == 0 || signal.layout.length > kRawBitsMax) {
        fail(line, fmt::format("SG_ {}: {} bits; a signal has 1 to {}", signal.name, signal.layout.length,
                               kRawBitsMax));
      }
      if (bytes_needed(signal.layout) > message.length) {
        fail(line, fmt::format("SG_ {}: reaches into byte {}, and message {} has {} bytes", signal.name,
                               bytes_needed(signal.layout), message.name, message.length));
      }
      if (signal.layout.factor == 0.0)
        fail(line, fmt::format("SG_ {}: its factor is 0, so that it says nothing", signal.name));
      check_switches_end(message, s, line);
    }
  }

  static void check_switches_end(const Message& message, std::size_t signal, std::size_t line) {
    std::size_t steps = 0;
    for (std::optional<std::size_t> at = signal; at; at = message.signals[*at].switched_by) {
      ++steps;
      if (steps > message.signals.size())
        fail(line, fmt::format("SG_ {}: its multiplexers switch one another in a circle",
                               message.signals[signal].name));
      if (steps > kSwitchesMax)
        fail(line, fmt::format("SG_ {}: more than {} multiplexers in a row", message.signals[signal].name,
                               kSwitchesMax));
    }
  }

  Tokens tokens_;
  Database database_;
  std::string context_;  ///< what is being read, for messages
  bool in_message_ = false;
  bool is_frame_ = true;
  std::vector<std::vector<MuxMark>> marks_;             ///< per message and signal
  std::vector<std::vector<std::size_t>> signal_lines_;  ///< per message and signal
  std::map<std::string, std::vector<NamedValue>> tables_;
  std::map<std::uint32_t, std::size_t> by_id_;               ///< identifier as written: message
  std::vector<std::map<std::string, std::size_t>> by_name_;  ///< per message: name of a signal, its place
  std::size_t n_signals_ = 0;
  std::size_t n_names_ = 0;
};

/// The degree sign in most DBC files is one byte.
std::string utf8_of_latin1(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80U) {
      out += c;
    } else {
      out += static_cast<char>(0xC0U | byte >> 6U);
      out += static_cast<char>(0x80U | (byte & 0x3FU));
    }
  }
  return out;
}

}  // namespace

Result<Database> parse(std::string_view text, const std::string& name) { return Parser(text, name).run(); }

Result<std::string> read_text(const std::filesystem::path& file) {
  auto text = read_text_file(file, "DBC file",
                             "give the path of the vehicle's DBC file; a relative one "
                             "starts at the configuration's folder");
  if (text && !is_utf8(*text)) return utf8_of_latin1(*text);
  return text;
}

}  // namespace imuscope::dbc
