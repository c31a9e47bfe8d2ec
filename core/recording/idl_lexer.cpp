#include "core/recording/idl_lexer.hpp"

#include <algorithm>
#include <cctype>

#include "core/base/fault.hpp"

namespace invar::recording {

namespace {

bool is_letter(char c) { return std::isalpha(static_cast<unsigned char>(c)) != 0 || c == '_'; }
bool is_digit(char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; }

class Lexer {
 public:
  Lexer(std::string_view text, const std::string& name) : text_{text}, name_{name} {}

  std::vector<IdlToken> all() {
    std::vector<IdlToken> tokens;
    do {
      skip_blanks();
      tokens.push_back(next());
    } while (tokens.back().kind != IdlToken::Kind::end);
    return tokens;
  }

 private:
  [[noreturn]] void fail(const std::string& what, const std::string& mend) const {
    throw InputError{name_ + ":" + std::to_string(line_), what, mend};
  }

  [[nodiscard]] bool sees(std::string_view what) const { return text_.substr(at_).starts_with(what); }

  void advance_to(std::size_t end) {
    end = std::min(end, text_.size());
    line_ += static_cast<std::size_t>(std::count(text_.begin() + static_cast<std::ptrdiff_t>(at_),
                                                 text_.begin() + static_cast<std::ptrdiff_t>(end), '\n'));
    at_ = end;
  }

  void skip_blanks() {
    for (;;) {
      if (at_ == text_.size()) return;
      if (std::isspace(static_cast<unsigned char>(text_[at_])) != 0) {
        advance_to(at_ + 1);
      } else if (sees("//") || text_[at_] == '#') {
        advance_to(text_.find('\n', at_));
      } else if (sees("/*")) {
        const auto end = text_.find("*/", at_ + 2);
        if (end == std::string_view::npos) fail("a comment is not closed", "end it with */");
        advance_to(end + 2);
      } else {
        return;
      }
    }
  }

  IdlToken next() {
    using Kind = IdlToken::Kind;
    if (at_ == text_.size()) return {Kind::end, {}, line_};
    const std::size_t begin = at_;
    const char first = text_[begin];
    std::size_t end = begin + 1;
    const auto run = [&](auto belongs) {
      while (end < text_.size() && belongs(text_[end])) ++end;
    };
    const auto word = [](char c) { return is_letter(c) || is_digit(c); };
    Kind kind = Kind::sign;
    if (is_letter(first)) {
      kind = Kind::name;
      run(word);
    } else if (is_digit(first)) {
      kind = Kind::number;
      run([&](char c) { return word(c) || c == '.'; });
    } else if (first == '"' || first == '\'') {
      end = text_.find(first, begin + 1);
      if (end == std::string_view::npos) fail("a quoted text is not closed", "end it with its quote");
      const IdlToken token{Kind::text, text_.substr(begin + 1, end - begin - 1), line_};
      advance_to(end + 1);
      return token;
    } else if (sees("::") || sees("<<") || sees(">>")) {
      // ">>" stays two signs: it closes two sequences.
      if (first != '>') ++end;
    } else if (std::string_view{"{}()[]<>;:,=@+-*/|&^~%."}.find(first) == std::string_view::npos) {
      fail(std::string{"`"} + first + "` has no meaning here", "write OMG IDL 4.2");
    }
    at_ = end;
    return {kind, text_.substr(begin, end - begin), line_};
  }

  std::string_view text_;
  const std::string& name_;
  std::size_t at_ = 0;
  std::size_t line_ = 1;
};

}  // namespace

std::vector<IdlToken> idl_tokens(std::string_view text, const std::string& name) {
  return Lexer{text, name}.all();
}

}  // namespace invar::recording
