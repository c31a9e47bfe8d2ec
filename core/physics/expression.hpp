// Expression: what a user writes as a formula, as a short list of instructions that runs on several columns of numbers at once.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace invar::physics {

/// Formulas over named numbers, read by muParser: + - * / ^, comparisons, && ||, if(condition, yes, no). Functions: sin cos tan asin acos atan sinh cosh tanh exp log ln log2
/// log10 sqrt abs sign min max, pi. `-x^2` is -(x^2), `x^y^z` is x^(y^z). The root of what is negative is 0, the logarithm of
/// what is not positive that of the smallest positive number, the sign of zero 0: an empty tank does not run.
/// Equal parts of the formulas of one section are worked out once.
class Expressions {
 public:
  /// When a formula is run. `fixed` goes by itself before any other: what holds no variable.
  enum Section : std::size_t { fixed, rates, outputs, law, sections };

  /// The names of what changes from step to step, and of what stays for a run. Their slots are in this order.
  Expressions(const std::vector<std::string>& variables, const std::vector<std::string>& constants);

  /// The slot of the value of a formula. Throws InputError naming `where` for what is none.
  std::size_t add(Section section, const std::string& formula, const std::string& where);

  [[nodiscard]] std::size_t slots() const { return start_.size(); }
  /// The slots of one column before any run: the numbers that stand in the formulas.
  [[nodiscard]] const std::vector<double>& start() const { return start_; }

  /// Runs a section; slot s of column l stands at s * lanes + l.
  template <std::size_t lanes>
  void run(Section section, double* slots) const;

  enum class Operation {
    add,
    subtract,
    multiply,
    divide,
    power,
    negate,
    less,
    greater,
    at_most,
    at_least,
    equal,
    differs,
    both,
    either,
    choose,
    sine,
    cosine,
    tangent,
    arc_sine,
    arc_cosine,
    arc_tangent,
    sinh,
    cosh,
    tanh,
    exponential,
    logarithm,
    logarithm_2,
    logarithm_10,
    root,
    absolute,
    sign,
    least,
    most
  };
  /// Writes to slot `to`; an unused operand repeats `a`.
  struct Instruction {
    Operation operation;
    std::size_t to, a, b, c;
  };
  [[nodiscard]] const std::vector<Instruction>& code(Section section) const { return code_[section]; }

 private:
  friend class FormulaRecorder;
  std::size_t number(double value);
  std::size_t result(Section section, Operation operation, std::size_t a, std::size_t b, std::size_t c);

  std::vector<std::string> names_;
  std::vector<double> start_;
  std::vector<bool> changes_;         // by slot: does it hold a variable?
  std::vector<std::size_t> numbers_;  // slots of what stands in the formulas
  std::vector<Instruction> code_[sections];
};

/// Words with a meaning of their own in a formula; they name no state, input or parameter.
const std::vector<std::string_view>& expression_words();

}  // namespace invar::physics
