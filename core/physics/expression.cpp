#include "core/physics/expression.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "core/base/fault.hpp"

namespace invar::physics {

namespace {

double root_of(double x) { return x > 0.0 ? std::sqrt(x) : 0.0; }
double logarithm_of(double x) { return std::log(std::max(x, std::numeric_limits<double>::min())); }
double sign_of(double x) { return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : 0.0); }

}  // namespace

/// Recursive descent over one formula.
class FormulaReader {
 public:
  using Operation = Expressions::Operation;

  FormulaReader(Expressions& into, Expressions::Section section, std::string_view formula)
      : into_{into}, section_{section}, text_{formula} {}

  /// Throws std::string: what is wrong.
  std::size_t whole() {
    const std::size_t slot = choice();
    skip();
    if (at_ < text_.size()) throw "`" + std::string{text_.substr(at_)} + "` is not understood";
    return slot;
  }

 private:
  void skip() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_]))) ++at_;
  }
  bool take(std::string_view word) {
    skip();
    if (text_.substr(at_, word.size()) != word) return false;
    at_ += word.size();
    return true;
  }
  void need(char c) {
    if (!take(std::string_view{&c, 1}))
      throw std::string{"`"} + c + "` is missing" +
          (at_ < text_.size() ? " before `" + std::string{text_.substr(at_)} + "`" : " at its end");
  }
  std::size_t make(Operation operation, std::size_t a, std::size_t b = 0, std::size_t c = 0) {
    return into_.result(section_, operation, a, b, c);
  }

  std::size_t choice() {
    const std::size_t when = either();
    if (!take("?")) return when;
    const std::size_t yes = choice();
    need(':');
    return make(Operation::choose, when, yes, choice());
  }
  std::size_t either() {
    std::size_t a = both();
    while (take("||")) a = make(Operation::either, a, both());
    return a;
  }
  std::size_t both() {
    std::size_t a = comparison();
    while (take("&&")) a = make(Operation::both, a, comparison());
    return a;
  }
  std::size_t comparison() {
    std::size_t a = sum();
    for (;;) {
      if (take("<="))
        a = make(Operation::at_most, a, sum());
      else if (take(">="))
        a = make(Operation::at_least, a, sum());
      else if (take("=="))
        a = make(Operation::equal, a, sum());
      else if (take("!="))
        a = make(Operation::differs, a, sum());
      else if (take("<"))
        a = make(Operation::less, a, sum());
      else if (take(">"))
        a = make(Operation::greater, a, sum());
      else
        return a;
    }
  }
  std::size_t sum() {
    std::size_t a = product();
    for (;;) {
      if (take("+"))
        a = make(Operation::add, a, product());
      else if (take("-"))
        a = make(Operation::subtract, a, product());
      else
        return a;
    }
  }
  std::size_t product() {
    std::size_t a = signed_one();
    for (;;) {
      if (take("*"))
        a = make(Operation::multiply, a, signed_one());
      else if (take("/"))
        a = make(Operation::divide, a, signed_one());
      else
        return a;
    }
  }
  std::size_t signed_one() {
    if (take("-")) return make(Operation::negate, signed_one());
    if (take("+")) return signed_one();
    const std::size_t base = single();
    return take("^") ? make(Operation::power, base, signed_one()) : base;
  }

  std::size_t single() {
    if (++depth_ > 200) throw std::string{"is nested too deeply"};
    struct Out {
      int& depth;
      ~Out() { --depth; }
    } out{depth_};
    skip();
    if (at_ == text_.size()) throw std::string{"something is missing at its end"};
    const char c = text_[at_];
    if (c == '(') {
      ++at_;
      const std::size_t inner = choice();
      need(')');
      return inner;
    }
    if (std::isdigit(static_cast<unsigned char>(c)) || c == '.') {
      double value = 0.0;
      const auto [end, error] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
      if (error != std::errc{}) throw "`" + std::string{text_.substr(at_)} + "` is no number";
      at_ = static_cast<std::size_t>(end - text_.data());
      return into_.number(value);
    }
    const std::size_t begin = at_;
    while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) || text_[at_] == '_'))
      ++at_;
    const std::string name{text_.substr(begin, at_ - begin)};
    if (name.empty()) throw "`" + std::string{text_.substr(begin)} + "` is not understood";
    skip();
    if (at_ < text_.size() && text_[at_] == '(') return call(name);
    const auto& names = into_.names_;
    if (const auto found = std::find(names.begin(), names.end(), name); found != names.end())
      return static_cast<std::size_t>(found - names.begin());
    if (name == "pi" || name == "_pi") return into_.number(std::numbers::pi);
    if (name == "_e") return into_.number(std::numbers::e);
    throw "`" + name + "` is no state, input or parameter";
  }

  std::size_t call(const std::string& name) {
    static const std::map<std::string, Operation> functions{
        {"sin", Operation::sine},         {"cos", Operation::cosine},
        {"tan", Operation::tangent},      {"asin", Operation::arc_sine},
        {"acos", Operation::arc_cosine},  {"atan", Operation::arc_tangent},
        {"sinh", Operation::sinh},        {"cosh", Operation::cosh},
        {"tanh", Operation::tanh},        {"exp", Operation::exponential},
        {"log", Operation::logarithm},    {"ln", Operation::logarithm},
        {"log2", Operation::logarithm_2}, {"log10", Operation::logarithm_10},
        {"sqrt", Operation::root},        {"abs", Operation::absolute},
        {"sign", Operation::sign},        {"min", Operation::least},
        {"max", Operation::most}};
    const auto found = functions.find(name);
    if (found == functions.end()) throw "`" + name + "` is no function";
    need('(');
    std::size_t value = choice();
    const bool many = found->second == Operation::least || found->second == Operation::most;
    if (!many)
      value = make(found->second, value);
    else
      while (take(",")) value = make(found->second, value, choice());
    need(')');
    return value;
  }

  Expressions& into_;
  Expressions::Section section_;
  std::string_view text_;
  std::size_t at_ = 0;
  int depth_ = 0;
};

Expressions::Expressions(const std::vector<std::string>& variables, const std::vector<std::string>& constants)
    : names_{variables}, start_(variables.size() + constants.size(), 0.0), changes_(variables.size(), true) {
  names_.insert(names_.end(), constants.begin(), constants.end());
  changes_.resize(names_.size(), false);
}

std::size_t Expressions::number(double value) {
  for (const std::size_t slot : numbers_)
    if (start_[slot] == value) return slot;
  numbers_.push_back(start_.size());
  start_.push_back(value);
  changes_.push_back(false);
  return start_.size() - 1;
}

std::size_t Expressions::result(Section section, Operation operation, std::size_t a, std::size_t b,
                                std::size_t c) {
  const bool three = operation == Operation::choose;
  const bool two = three || operation < Operation::negate ||
                   (operation > Operation::negate && operation < Operation::choose) ||
                   operation >= Operation::least;
  if (!two) b = a;
  if (!three) c = a;
  const bool changes = changes_[a] || changes_[b] || changes_[c];
  auto& code = code_[changes ? section : fixed];
  for (const auto& done : code)
    if (done.operation == operation && done.a == a && done.b == b && done.c == c) return done.to;
  start_.push_back(0.0);
  changes_.push_back(changes);
  code.push_back({operation, start_.size() - 1, a, b, c});
  return start_.size() - 1;
}

std::size_t Expressions::add(Section section, std::string_view formula, const std::string& where) {
  try {
    return FormulaReader{*this, section, formula}.whole();
  } catch (const std::string& what) {
    throw InputError{where, "`" + std::string{formula} + "`: " + what,
                     "use states, inputs, parameters, t, pi and the functions of the contract"};
  }
}

template <std::size_t lanes>
void Expressions::run(Section section, double* slots) const {
  for (const auto& [operation, to, from_a, from_b, from_c] : code_[section]) {
    double* const out = slots + to * lanes;
    const double *const a = slots + from_a * lanes, *const b = slots + from_b * lanes,
                        *const c = slots + from_c * lanes;
    const auto each = [&](auto rule) {
      double held[lanes];  // nothing that is read is written: the compiler may go through all lanes at once
      for (std::size_t l = 0; l < lanes; ++l) held[l] = rule(a[l], b[l]);
      for (std::size_t l = 0; l < lanes; ++l) out[l] = held[l];
    };
    switch (operation) {
      case Operation::add:
        each([](double x, double y) { return x + y; });
        break;
      case Operation::subtract:
        each([](double x, double y) { return x - y; });
        break;
      case Operation::multiply:
        each([](double x, double y) { return x * y; });
        break;
      case Operation::divide:
        each([](double x, double y) { return x / y; });
        break;
      case Operation::power:
        each([](double x, double y) { return y == 2.0 ? x * x : (y == 3.0 ? x * x * x : std::pow(x, y)); });
        break;
      case Operation::negate:
        each([](double x, double) { return -x; });
        break;
      case Operation::less:
        each([](double x, double y) { return x < y ? 1.0 : 0.0; });
        break;
      case Operation::greater:
        each([](double x, double y) { return x > y ? 1.0 : 0.0; });
        break;
      case Operation::at_most:
        each([](double x, double y) { return x <= y ? 1.0 : 0.0; });
        break;
      case Operation::at_least:
        each([](double x, double y) { return x >= y ? 1.0 : 0.0; });
        break;
      case Operation::equal:
        each([](double x, double y) { return x == y ? 1.0 : 0.0; });
        break;
      case Operation::differs:
        each([](double x, double y) { return x != y ? 1.0 : 0.0; });
        break;
      case Operation::both:
        each([](double x, double y) { return x != 0.0 && y != 0.0 ? 1.0 : 0.0; });
        break;
      case Operation::either:
        each([](double x, double y) { return x != 0.0 || y != 0.0 ? 1.0 : 0.0; });
        break;
      case Operation::choose:
        for (std::size_t l = 0; l < lanes; ++l) out[l] = a[l] != 0.0 ? b[l] : c[l];
        break;
      case Operation::sine:
        each([](double x, double) { return std::sin(x); });
        break;
      case Operation::cosine:
        each([](double x, double) { return std::cos(x); });
        break;
      case Operation::tangent:
        each([](double x, double) { return std::tan(x); });
        break;
      case Operation::arc_sine:
        each([](double x, double) { return std::asin(x); });
        break;
      case Operation::arc_cosine:
        each([](double x, double) { return std::acos(x); });
        break;
      case Operation::arc_tangent:
        each([](double x, double) { return std::atan(x); });
        break;
      case Operation::sinh:
        each([](double x, double) { return std::sinh(x); });
        break;
      case Operation::cosh:
        each([](double x, double) { return std::cosh(x); });
        break;
      case Operation::tanh:
        each([](double x, double) { return std::tanh(x); });
        break;
      case Operation::exponential:
        each([](double x, double) { return std::exp(x); });
        break;
      case Operation::logarithm:
        each([](double x, double) { return logarithm_of(x); });
        break;
      case Operation::logarithm_2:
        each([](double x, double) { return std::log2(x); });
        break;
      case Operation::logarithm_10:
        each([](double x, double) { return std::log10(x); });
        break;
      case Operation::root:
        each([](double x, double) { return root_of(x); });
        break;
      case Operation::absolute:
        each([](double x, double) { return std::abs(x); });
        break;
      case Operation::sign:
        each([](double x, double) { return sign_of(x); });
        break;
      case Operation::least:
        each([](double x, double y) { return std::min(x, y); });
        break;
      case Operation::most:
        each([](double x, double y) { return std::max(x, y); });
        break;
    }
  }
}

template void Expressions::run<1>(Section, double*) const;
template void Expressions::run<4>(Section, double*) const;
template void Expressions::run<8>(Section, double*) const;

}  // namespace invar::physics
