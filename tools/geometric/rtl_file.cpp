#include "tools/geometric/rtl_file.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <sstream>

#include "core/base/angle.hpp"
#include "core/base/fault.hpp"
#include "core/recording/table_form.hpp"
#include "core/recording/text_lines.hpp"

namespace invar::tools {

namespace {

constexpr std::size_t most_targets_of_file = 100'000;

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

/// "axis: X" of `Axis: X`; empty where the line is no such entry.
std::string entry(const std::string& line, const std::string& key) {
  const auto colon = line.find(':');
  if (colon == std::string::npos || lower(line.substr(0, colon)) != key) return "";
  return std::string{recording::trimmed(line.substr(colon + 1))};
}

/// All numbers of a line; nothing where a cell is none. Decimal commas are taken as points.
bool numbers_of(std::string line, std::vector<double>& numbers) {
  std::replace(line.begin(), line.end(), ',', '.');
  std::istringstream cells{line};
  std::string cell;
  numbers.clear();
  while (cells >> cell) {
    std::istringstream one{cell};
    double value = 0.0;
    if (!(one >> value) || one.peek() != std::istringstream::traits_type::eof() || !std::isfinite(value))
      return false;
    numbers.push_back(value);
  }
  return !numbers.empty();
}

class Reader {
 public:
  explicit Reader(const std::filesystem::path& file) : file_{file}, lines_{file} {}

  RtlFile run() {
    std::string_view raw;
    while (lines_.next(raw)) {
      ++number_;
      const std::string line{recording::trimmed(raw)};
      if (line.empty()) continue;
      if (line.ends_with("::"))
        section_ = lower(line.substr(0, line.size() - 2));
      else
        take(line);
    }
    if (result_.targets.size() < 2)
      throw InputError{file_.string(), "names fewer than two targets", "export the whole file again"};
    if (result_.readings.empty())
      throw InputError{file_.string(), "holds no deviations", "export it with its runs"};
    finish();
    return std::move(result_);
  }

 private:
  [[noreturn]] void refuse(const std::string& what, const std::string& mend) const {
    throw InputError{file_.string() + ":" + std::to_string(number_), what, mend};
  }

  void take(const std::string& line) {
    if (const std::string kind = lower(entry(line, "file type") + entry(line, "filetype")); !kind.empty()) {
      result_.rotary = kind.find("rotary") != std::string::npos || kind.find("angular") != std::string::npos;
      if (!result_.rotary && kind.find("linear") == std::string::npos)
        refuse("a file of type `" + kind + "`", "linear and rotary ones can be read");
    }
    if (const std::string axis = entry(line, "axis"); !axis.empty() && result_.axis.empty())
      result_.axis = std::string(1, static_cast<char>(std::toupper(static_cast<unsigned char>(axis[0]))));
    std::vector<double> numbers;
    if (section_ == "target data" && line.find(':') == std::string::npos) {
      if (!numbers_of(line, numbers)) refuse("a target is no number", "export the file again");
      if (result_.targets.size() + numbers.size() > most_targets_of_file)
        refuse("too many targets", "read lines.csv instead");
      result_.targets.insert(result_.targets.end(), numbers.begin(), numbers.end());
    } else if (section_ == "deviations" && line.find(':') == std::string::npos) {
      if (!numbers_of(line, numbers) || numbers.size() != 3)
        refuse("a deviation is not `run target deviation`", "export the file again");
      const double target = numbers[1];
      if (!(target >= 1.0 && target <= static_cast<double>(result_.targets.size())) ||
          target != std::floor(target))
        refuse("names a target that is not there", "export the whole file again");
      result_.readings.push_back(
          {static_cast<int>(numbers[0]), static_cast<std::size_t>(target) - 1, numbers[2], 1});
    }
  }

  /// Units, and the sense of each run by the order of its targets.
  void finish() {
    for (double& target : result_.targets) target *= result_.rotary ? degree : 1e-3;
    auto& readings = result_.readings;
    for (std::size_t begin = 0; begin < readings.size();) {
      std::size_t end = begin;
      while (end < readings.size() && readings[end].run == readings[begin].run) ++end;
      const double way = result_.targets[readings[end - 1].target] - result_.targets[readings[begin].target];
      for (std::size_t i = begin; i < end; ++i) {
        readings[i].direction = way < 0.0 ? -1 : 1;
        readings[i].deviation *= result_.rotary ? arcsec : 1e-6;
      }
      begin = end;
    }
  }

  std::filesystem::path file_;
  recording::TextLines lines_;
  std::size_t number_ = 0;
  std::string section_;
  RtlFile result_;
};

}  // namespace

bool is_rtl(const std::filesystem::path& file) {
  recording::TextLines lines{file};
  std::string_view line;
  while (lines.next(line))
    if (const auto text = recording::trimmed(line); !text.empty()) return text == "HEADER::";
  return false;
}

RtlFile load_rtl(const std::filesystem::path& file) { return Reader{file}.run(); }

}  // namespace invar::tools
