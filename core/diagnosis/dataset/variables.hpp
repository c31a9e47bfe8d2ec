// Variables: the rows of a signal as the model sees it, and where it goes.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/diagnosis/dataset/case.hpp"

namespace invar::diagnosis {

/// Rows of one signal, as the model sees them (positions measured, velocities differentiated). `node`: whose temperature;
/// empty: of the first.
std::vector<double> variable_values(const Case& data, std::size_t recording, const std::string& name,
                                    const std::string& node = "");

/// Where a variable goes in the fitted model, and how fast.
struct Span {
  double low = 0.0, high = 0.0;
  double rate = 0.0;                // [1/s] times the variable: the largest change a row
  double falls = 0.0, rises = 0.0;  // the same, each way: down below zero, up above it
  double inner = 0.0;               // how far apart the middle four fifths of the rows lie
  std::size_t rests = 0;            // rows at zero after the first
  [[nodiscard]] double size() const { return std::max({std::abs(low), std::abs(high), 1e-12}); }
  [[nodiscard]] double width() const { return high - low; }
  [[nodiscard]] bool turns() const { return std::min(-falls, rises) > 0.03 * rate; }
};

/// Variables from the fitted model: states that nobody measures too.
class Spans {
 public:
  Spans(const Case& data, const physics::Model& fitted);
  const Span& of(const std::string& name) const { return spans_.at(name); }

  double duration = 0.0;
  std::size_t rows = 1;

 private:
  void widen(const std::string& name, const std::vector<double>& time, const std::vector<double>& values);
  std::map<std::string, Span> spans_;
};

/// From where to where a state, input, output or the time goes in a model of equations.
std::pair<double, double> span_of(const Case& data, const physics::Model& model, const std::string& name);
/// How far apart the middle four fifths of its rows lie.
double inner_span_of(const Case& data, const physics::Model& model, const std::string& name);
/// Does it go both ways, up and down?
bool turns(const Case& data, const physics::Model& model, const std::string& name);
/// Does it stand at zero for some rows? A steady rate would move it.
bool rests(const Case& data, const physics::Model& model, const std::string& name);

}  // namespace invar::diagnosis
