#include "core/physics/expression.hpp"

#include <muParser.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "core/base/fault.hpp"
#include "core/base/limits.hpp"
#include "core/base/shown.hpp"

namespace invar::physics {

namespace {

double root_of(double x) { return x > 0.0 ? std::sqrt(x) : 0.0; }
double logarithm_of(double x) { return std::log(std::max(x, std::numeric_limits<double>::min())); }
double sign_of(double x) { return x > 0.0 ? 1.0 : (x < 0.0 ? -1.0 : 0.0); }

}  // namespace

/// What muParser calls while it works a formula out: every operation is written down, and its value is the slot of its
/// result. So a formula is read once, by muParser, and run many times, on many columns.
class FormulaRecorder {
 public:
  using Operation = Expressions::Operation;

  FormulaRecorder(Expressions& into, Expressions::Section section) : into_{into}, section_{section} {
    parser_.ClearFun();
    parser_.ClearInfixOprt();
    parser_.EnableBuiltInOprt(false);
    parser_.EnableOptimizer(false);  // it works with values, and here are none
    parser_.AddValIdent(number);
    constexpr bool as_it_stands = false;
    const auto name = [](std::string_view word) { return std::string{word}; };
    for (const auto& [word, call] : functions_of_one) parser_.DefineFun(name(word), call, as_it_stands);
    for (const auto& [word, call] : functions_of_more) parser_.DefineFun(name(word), call, as_it_stands);
    parser_.DefineFun(name(choice), choose, as_it_stands);
    for (const auto& [word, call, precedence, associativity] : operators)
      parser_.DefineOprt(name(word), call, precedence, associativity, as_it_stands);
    parser_.DefineInfixOprt("-", one<Operation::negate>, mu::prINFIX, as_it_stands);
    parser_.DefineInfixOprt(
        "+", [](double a) { return a; }, mu::prINFIX, as_it_stands);
    slots_.resize(into.names_.size());
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      slots_[i] = static_cast<double>(i);
      parser_.DefineVar(into.names_[i], &slots_[i]);
    }
    const auto& names = into.names_;
    if (std::find(names.begin(), names.end(), "pi") == names.end())
      parser_.DefineConst("pi", static_cast<double>(into.number(std::numbers::pi)));
  }

  /// The slot of the formula's value. Throws mu::ParserError.
  std::size_t record(const std::string& formula) {
    if (formula.find('?') != std::string::npos)
      throw mu::ParserError{"`?` has no place in it; write if(condition, yes, no)"};
    now_ = this;
    parser_.SetExpr(formula);
    int results = 0;
    const double* slot = parser_.Eval(results);
    if (results != 1) throw mu::ParserError{"it is more than one formula"};
    return static_cast<std::size_t>(*slot);
  }

  static constexpr std::string_view choice = "if";
  static std::vector<std::string_view> words() {
    std::vector<std::string_view> all{"pi", choice};
    for (const auto& [word, call] : functions_of_one) all.push_back(word);
    for (const auto& [word, call] : functions_of_more) all.push_back(word);
    return all;
  }

 private:
  double make(Operation operation, double a, double b = 0.0, double c = 0.0) {
    return static_cast<double>(into_.result(section_, operation, static_cast<std::size_t>(a),
                                            static_cast<std::size_t>(b), static_cast<std::size_t>(c)));
  }
  template <Operation operation>
  static double one(double a) {
    return now_->make(operation, a);
  }
  template <Operation operation>
  static double two(double a, double b) {
    return now_->make(operation, a, b);
  }
  template <Operation operation>
  static double many(const double* values, int count) {
    double value = values[0];
    for (int i = 1; i < count; ++i) value = now_->make(operation, value, values[i]);
    return value;
  }
  static double choose(double when, double yes, double no) {
    return now_->make(Operation::choose, when, yes, no);
  }
  static int number(const char* text, int* position, double* slot) {
    double value = 0.0;
    const auto [end, error] = std::from_chars(text, text + std::strlen(text), value);
    if (error != std::errc{} || !(*text == '.' || std::isdigit(static_cast<unsigned char>(*text)))) return 0;
    *position += static_cast<int>(end - text);
    *slot = static_cast<double>(now_->into_.number(value));
    return 1;
  }

  struct OfOne {
    std::string_view word;
    double (*call)(double);
  };
  struct OfMore {
    std::string_view word;
    double (*call)(const double*, int);
  };
  struct Between {
    std::string_view word;
    double (*call)(double, double);
    unsigned precedence;
    mu::EOprtAssociativity associativity;
  };
  static constexpr OfOne functions_of_one[]{
      {"sin", one<Operation::sine>},         {"cos", one<Operation::cosine>},
      {"tan", one<Operation::tangent>},      {"asin", one<Operation::arc_sine>},
      {"acos", one<Operation::arc_cosine>},  {"atan", one<Operation::arc_tangent>},
      {"sinh", one<Operation::sinh>},        {"cosh", one<Operation::cosh>},
      {"tanh", one<Operation::tanh>},        {"exp", one<Operation::exponential>},
      {"log", one<Operation::logarithm>},    {"ln", one<Operation::logarithm>},
      {"log2", one<Operation::logarithm_2>}, {"log10", one<Operation::logarithm_10>},
      {"sqrt", one<Operation::root>},        {"abs", one<Operation::absolute>},
      {"sign", one<Operation::sign>}};
  static constexpr OfMore functions_of_more[]{{"min", many<Operation::least>},
                                              {"max", many<Operation::most>}};
  static constexpr Between operators[]{{"+", two<Operation::add>, mu::prADD_SUB, mu::oaLEFT},
                                       {"-", two<Operation::subtract>, mu::prADD_SUB, mu::oaLEFT},
                                       {"*", two<Operation::multiply>, mu::prMUL_DIV, mu::oaLEFT},
                                       {"/", two<Operation::divide>, mu::prMUL_DIV, mu::oaLEFT},
                                       {"^", two<Operation::power>, mu::prPOW, mu::oaRIGHT},
                                       {"<", two<Operation::less>, mu::prCMP, mu::oaLEFT},
                                       {">", two<Operation::greater>, mu::prCMP, mu::oaLEFT},
                                       {"<=", two<Operation::at_most>, mu::prCMP, mu::oaLEFT},
                                       {">=", two<Operation::at_least>, mu::prCMP, mu::oaLEFT},
                                       {"==", two<Operation::equal>, mu::prCMP, mu::oaLEFT},
                                       {"!=", two<Operation::differs>, mu::prCMP, mu::oaLEFT},
                                       {"&&", two<Operation::both>, mu::prLAND, mu::oaLEFT},
                                       {"||", two<Operation::either>, mu::prLOR, mu::oaLEFT}};

  static thread_local FormulaRecorder* now_;  // muParser's callbacks take numbers alone
  Expressions& into_;
  Expressions::Section section_;
  std::vector<double> slots_;  // of the names; the parser points to them
  mu::Parser parser_;
};

thread_local FormulaRecorder* FormulaRecorder::now_ = nullptr;

const std::vector<std::string_view>& expression_words() {
  static const auto words = FormulaRecorder::words();
  return words;
}

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

std::size_t Expressions::add(Section section, const std::string& formula, const std::string& where) {
  if (formula.size() > limits::formula)
    throw InputError{where,
                     "`" + clipped(formula) + "` has " + std::to_string(formula.size()) + " characters",
                     "write formulas of at most " + std::to_string(limits::formula)};
  try {
    return FormulaRecorder{*this, section}.record(formula);
  } catch (const mu::ParserError& error) {
    std::string what = error.GetMsg();
    if (what.ends_with('.')) what.pop_back();
    std::string functions;
    for (const auto word : expression_words())
      if (word != "pi") functions += (functions.empty() ? "" : " ") + std::string{word};
    throw InputError{where, "`" + formula + "`: " + what,
                     "use states, inputs, parameters, t, pi, + - * / ^ and the functions " + functions};
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
