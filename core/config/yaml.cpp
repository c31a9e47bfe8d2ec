#include "core/config/yaml.hpp"

#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <sstream>

#include "core/base/input_file.hpp"
#include "core/base/limits.hpp"
#include "core/base/shown.hpp"
#include "core/base/unit.hpp"
#include "core/config/quotes.hpp"
#include "core/config/yaml_bounds.hpp"
#include "core/config/yaml_document.hpp"

namespace invar::config {

namespace {

using detail::Document;
using detail::joined;
using detail::located;
using detail::Place;

int line_of(const YAML::Node& node, int otherwise) {
  return node.IsDefined() && !node.IsNull() && !node.Mark().is_null() ? node.Mark().line + 1 : otherwise;
}

Yaml fail(const std::filesystem::path& file, const std::string& what, const std::string& mend) {
  throw InputError{file.string(), what, mend};
}

InputError open_quote_at(const std::string& name, int line) {
  return {name + ":" + std::to_string(line), "a quote is not closed", "close it on this line"};
}

/// A text is one line, however it is folded in the file.
std::string one_line(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\t'; }, ' ');
  text.erase(text.find_last_not_of(' ') + 1);
  return text;
}

/// yaml-cpp closes an open quote at the end of the file, or another opening quote closes it some lines below. `seen`: places
/// and kinds looked at already, since an alias may repeat a part without end.
void check_quotes(const std::string& text, const std::string& name, const YAML::Node& node,
                  std::set<std::pair<int, int>>& seen) {
  if (!seen.emplace(node.Mark().pos, static_cast<int>(node.Type())).second) return;
  if (node.IsMap())
    for (const auto& entry : node) {
      check_quotes(text, name, entry.first, seen);
      check_quotes(text, name, entry.second, seen);
    }
  if (node.IsSequence())
    for (const auto& entry : node) check_quotes(text, name, entry, seen);
  if (!node.IsScalar() || node.Tag() != "!" || node.Mark().is_null()) return;
  const auto begin = static_cast<std::size_t>(node.Mark().pos);
  if (begin >= text.size() || (text[begin] != '"' && text[begin] != '\'')) return;
  if (const Quoted found = quoted(text, begin); !found.closed || found.swallows_keys)
    throw open_quote_at(name, node.Mark().line + 1);
}

std::string range_text(Range range, std::string_view unit) {
  const std::string suffix = unit.empty() || unit == "1" ? "" : " " + std::string{unit};
  if (range.lower == Range::positive().lower) {
    return std::isinf(range.upper) ? "above 0" + suffix
                                   : "above 0 and at most " + shown(range.upper) + suffix;
  }
  if (std::isinf(range.upper)) return "at least " + shown(range.lower) + suffix;
  if (std::isinf(range.lower)) return "at most " + shown(range.upper) + suffix;
  return "between " + shown(range.lower) + " and " + shown(range.upper) + suffix;
}

/// A word of the file as a message shows it.
std::string word_of(const Node& node) { return node.is_scalar() ? clipped(node.raw().Scalar()) : "..."; }

/// How a list of numbers is written: plainly, and as the file has it with one unit for all: {value: [0, 200], unit: mm}.
std::string mend_list(const Node& at, const std::string& plain, std::string_view unit) {
  if (unit.empty() || unit == "1") return "write " + plain;
  const std::string mend = "write " + plain + " in " + std::string{unit};
  if (!at.is_map()) return mend;
  at.accept_all();
  const Node values = at["value"], other = at["unit"];
  if (!values.is_list() || values.children().size() > 3 || !other.is_scalar()) return mend;
  std::string listed;
  for (const Node& number : values.children())
    listed +=
        (listed.empty() ? "{value: " : ", {value: ") + word_of(number) + ", unit: " + word_of(other) + "}";
  return mend + ", or [" + listed + "]";
}

}  // namespace

Node::Node(std::shared_ptr<Document> document, std::shared_ptr<Place> place)
    : document_{std::move(document)}, place_{std::move(place)} {}

std::string Node::where() const { return located(*document_, *place_); }
const std::string& Node::path() const { return place_->path; }
std::string Node::key() const { return place_->key; }
bool Node::exists() const { return place_->yaml.IsDefined() && !place_->yaml.IsNull(); }
bool Node::is_map() const { return exists() && place_->yaml.IsMap(); }
bool Node::is_list() const { return exists() && place_->yaml.IsSequence(); }
bool Node::is_scalar() const { return exists() && place_->yaml.IsScalar(); }
const YAML::Node& Node::raw() const { return place_->yaml; }
void Node::accept_all() const { place_->accept_all = true; }

void Node::fault(std::string what, std::string mend) const {
  document_->faults.add({where(), std::move(what), std::move(mend)});
}

void Node::missing(std::string mend) const { fault(detail::missing, std::move(mend)); }

std::size_t Node::fault_count() const { return document_->faults.count(); }

bool Node::has(std::string_view name) const { return (*this)[name].exists(); }

Node Node::operator[](std::string_view name) const {
  const std::string key{name};
  place_->known.insert(key);
  if (auto known = place_->child(key)) return {document_, std::move(known)};
  if (is_scalar() || is_list()) fault("a map is expected here", "write `" + key + ": ...` below it");
  auto child = std::make_shared<Place>();
  bool stands = false;
  if (is_map()) {
    place_->look_at_keys();
    const auto value = place_->values->find(key);
    stands = value != place_->values->end();
    if (stands) child->yaml.reset(value->second);
  }
  child->key = key;
  child->path = joined(place_->path, key);
  child->line = line_of(child->yaml, place_->line);
  const Node result{document_, place_->add(key, child)};
  if (stands && !result.exists()) {
    child->empty = true;
    if (const auto line = place_->lines.find(key); line != place_->lines.end()) child->line = line->second;
    result.fault("has no value", "write one behind the colon, or remove the key");
  }
  return result;
}

Node Node::required(std::string_view name) const {
  Node child = (*this)[name];
  if (!child.exists() && !child.place_->empty && is_map()) child.missing("add `" + std::string{name} + ":`");
  return child;
}

std::vector<Node> Node::list() const {
  if (exists() && !is_list()) {
    fault("a list is expected here", "write [a, b, c], or one a line with `- ` before it");
    return {};
  }
  return children();
}

std::vector<Node> Node::map() const {
  if (exists() && !is_map()) {
    fault("a map is expected here", "write `key: value` lines below it");
    return {};
  }
  return children();
}

std::vector<Node> Node::children() const {
  std::vector<Node> result;
  if (is_scalar())
    fault("a list or a map is expected here", "write [a, b, c], or `key: value` lines below it");
  if (is_map()) {
    std::set<std::string> seen;
    for (const auto& entry : place_->yaml) {
      if (!entry.first.IsScalar()) continue;  // `faults` tells it
      const std::string key = entry.first.Scalar();
      if (seen.insert(key).second) result.push_back((*this)[key]);
    }
  } else if (is_list()) {
    std::size_t index = 0;
    for (const auto& entry : place_->yaml) {
      const std::string key = std::to_string(index++);
      auto child = place_->child(key);
      if (child == nullptr) {
        child = place_->add(key, std::make_shared<Place>());
        child->yaml.reset(entry);
        child->key = key;
        child->path = place_->path + "[" + key + "]";
        child->line = line_of(entry, place_->line);
      }
      result.push_back({document_, child});
    }
  }
  return result;
}

Quantity Node::as_quantity(std::string_view unit, Range range) const {
  const double harmless =
      range.contains(0.0) ? 0.0 : (std::isfinite(range.lower) ? range.lower : range.upper);
  if (!exists()) {
    missing("write a number here");
    return {harmless, std::nullopt};
  }
  Node number = *this;
  Conversion to_asked;
  Quantity result;
  std::optional<std::string> written_unit;
  if (is_map()) {
    number = required("value");
    if (const Node written = (*this)["unit"]; written.exists()) {
      const std::string name = written.as_text();
      if (const auto convert = conversion(name, unit)) {
        to_asked = *convert;
        written_unit = name;
      } else if (!parse_unit(name)) {
        written.fault("`" + clipped(name) + "` is no unit", unit.empty() || unit == "1"
                                                                ? "leave the unit out"
                                                                : "write it in " + std::string{unit});
      } else {
        const bool pure = unit.empty() || unit == "1";
        written.fault("`" + name + "` does not measure the same as " +
                          (pure ? "a number without unit" : std::string{unit}),
                      pure ? "leave the unit out" : "write it in " + std::string{unit});
      }
      if (!written_unit) {  // what the number means is not known
        (void)(*this)["sigma"];
        return {harmless, std::nullopt};
      }
    }
    if (const Node sigma = (*this)["sigma"]; sigma.exists())
      result.sigma = sigma.as_number("", Range::not_negative()) * std::abs(to_asked.factor);
    if (!number.exists()) return {harmless, result.sigma};
  }
  double value = 0.0;
  if (!number.is_scalar() || !YAML::convert<double>::decode(number.raw(), value)) {
    number.fault("`" + number.shown_scalar() + "` is not a number",
                 unit.empty() || unit == "1"
                     ? "write a number"
                     : "write a number in " + std::string{unit} + ", or {value: ..., unit: ...}");
    return {harmless, result.sigma};
  }
  value = to_asked(value);
  if (!std::isfinite(value)) {
    number.fault("`" + number.shown_scalar() + "` is not finite", "write a finite number");
    return {harmless, result.sigma};
  }
  if (!range.contains(value)) {
    const bool converted = written_unit && !written_unit->empty() && *written_unit != unit;
    number.fault("`" + number.shown_scalar() + (converted ? " " + *written_unit : "") + "`" +
                     (converted ? " = " + shown(value) + " " + std::string{unit} : "") + " is out of range",
                 "it must be " + range_text(range, unit));
    return {harmless, result.sigma};
  }
  result.value = value;
  return result;
}

double Node::as_number(std::string_view unit, Range range) const { return as_quantity(unit, range).value; }

std::int64_t Node::as_integer(std::int64_t lower, std::int64_t upper) const {
  std::int64_t value = 0;
  if (is_map() && has("value")) {
    accept_all();
    const Node number = (*this)["value"];
    const bool whole = number.is_scalar() && YAML::convert<std::int64_t>::decode(number.raw(), value);
    fault("a whole number has no unit", "write " + (whole ? number.shown_scalar() : "it alone"));
    return lower;
  }
  if (!is_scalar() || !YAML::convert<std::int64_t>::decode(place_->yaml, value)) {
    fault("`" + shown_scalar() + "` is not a whole number", "write a whole number");
    return lower;
  }
  if (value < lower || value > upper) {
    // One number alone is asked for of versions.
    fault("`" + shown_scalar() + "` is out of range",
          lower == upper ? "this program reads version " + std::to_string(lower)
                         : "it must be between " + std::to_string(lower) + " and " + std::to_string(upper));
    return lower;
  }
  return value;
}

std::string Node::shown_scalar() const { return is_scalar() ? clipped(place_->yaml.Scalar()) : "..."; }

std::string Node::as_text() const {
  if (!exists()) return {};
  if (!is_scalar()) {
    fault("a text is expected here", "write one word or a quoted text");
    return {};
  }
  return one_line(place_->yaml.Scalar());
}

std::string Node::as_choice(std::initializer_list<std::string_view> choices) const {
  const std::string word = as_text();
  for (const auto& choice : choices)
    if (word == choice) return word;
  if (exists() && is_scalar()) {
    std::string mend = "use one of: ";
    for (const auto& choice : choices) mend += (choice == *choices.begin() ? "" : ", ") + std::string{choice};
    fault("`" + clipped(word) + "` is not known here", mend);
  }
  return std::string{*choices.begin()};
}

bool Node::as_flag() const {
  bool value = false;
  if (!is_scalar() || !YAML::convert<bool>::decode(place_->yaml, value))
    fault("`" + shown_scalar() + "` is neither true nor false", "write true or false");
  return value;
}

Range Node::as_range(std::string_view unit) const {
  if (exists() && !is_list()) {
    fault("a range is expected here", mend_list(*this, "[low, high]", unit));
    return {0.0, 1.0};
  }
  const std::size_t known = fault_count();
  const auto numbers = as_numbers(unit);
  if (fault_count() > known) return {0.0, 1.0};
  if (numbers.size() != 2 || !(numbers[0] < numbers[1])) {
    fault("a range is expected here", "write [lower, upper] with lower < upper");
    return {0.0, 1.0};
  }
  return {numbers[0], numbers[1]};
}

std::vector<double> Node::as_numbers(std::string_view unit, Range each) const {
  std::vector<double> result;
  if (exists() && !is_list())
    fault("a list of numbers is expected here", mend_list(*this, "[1, 2, 3]", unit));
  if (is_list())
    for (const Node& child : children()) result.push_back(child.as_number(unit, each));
  return result;
}

std::vector<std::string> Node::as_texts() const {
  std::vector<std::string> result;
  if (exists() && !is_list()) fault("a list is expected here", "write [a, b, c]");
  if (is_list())
    for (const Node& child : children()) result.push_back(child.as_text());
  return result;
}

double Node::number(std::string_view name, std::string_view unit, Range range) const {
  const Node child = required(name);
  return child.exists() ? child.as_number(unit, range) : (range.contains(0.0) ? 0.0 : range.lower);
}
double Node::number(std::string_view name, std::string_view unit, Range range, double otherwise) const {
  return has(name) ? (*this)[name].as_number(unit, range) : otherwise;
}
std::int64_t Node::integer(std::string_view name, std::int64_t lower, std::int64_t upper) const {
  const Node child = required(name);
  return child.exists() ? child.as_integer(lower, upper) : lower;
}
std::int64_t Node::integer(std::string_view name, std::int64_t lower, std::int64_t upper,
                           std::int64_t otherwise) const {
  return has(name) ? (*this)[name].as_integer(lower, upper) : otherwise;
}
std::string Node::text(std::string_view name) const { return required(name).as_text(); }
std::string Node::text(std::string_view name, std::string_view otherwise) const {
  return has(name) ? (*this)[name].as_text() : std::string{otherwise};
}
std::string Node::choice(std::string_view name, std::initializer_list<std::string_view> choices,
                         std::string_view otherwise) const {
  if (!has(name) && !otherwise.empty()) return std::string{otherwise};
  const Node child = required(name);
  return child.exists() ? child.as_choice(choices) : std::string{*choices.begin()};
}
bool Node::flag(std::string_view name, bool otherwise) const {
  return has(name) ? (*this)[name].as_flag() : otherwise;
}

Yaml Yaml::load(const std::filesystem::path& file) {
  const int opened = open_input(file, "a YAML file");
  std::string text;
  std::array<char, 1U << 16U> block{};
  ssize_t got = 0;
  // One byte beyond the bound is enough for `parse` to refuse it.
  while (text.size() <= limits::yaml_bytes && (got = read(opened, block.data(), block.size())) > 0)
    text.append(block.data(), static_cast<std::size_t>(got));
  close(opened);
  return parse(text, file.string());
}

Yaml Yaml::parse(const std::string& text, const std::string& name) {
  Yaml result;
  result.document_ = std::make_shared<Document>();
  result.document_->file = name;
  result.document_->text = text;
  result.document_->root = std::make_shared<Place>();
  if (text.find('\0') != std::string::npos) return fail(name, "is not a text file", "name a YAML file");
  try {
    check_bounds(text, name);
    auto documents = YAML::LoadAll(text);
    for (std::size_t i = 1; i < documents.size(); ++i)
      if (!documents[i].IsNull())
        throw InputError{name + ":" + std::to_string(line_of(documents[i], 1)),
                         "a second document begins here", "keep one `---` part: a file holds one"};
    if (!documents.empty()) result.document_->root->yaml.reset(documents.front());
    std::set<std::pair<int, int>> seen;
    check_quotes(text, name, result.document_->root->yaml, seen);
  } catch (const YAML::Exception& error) {
    if (const auto line = open_quote(text)) throw open_quote_at(name, *line);
    throw InputError{name + ":" + std::to_string(error.mark.line + 1), "no YAML: " + error.msg,
                     "mend the line or the indentation"};
  }
  if (!result.document_->root->yaml.IsMap())
    return fail(name, "holds no map of keys", "begin with `key: value` lines");
  result.document_->root->line = 1;
  return result;
}

Node Yaml::root() const { return {document_, document_->root}; }
const std::filesystem::path& Yaml::file() const { return document_->file; }
const std::string& Yaml::text() const { return document_->text; }

std::vector<Fault> Yaml::faults() const {
  auto faults = document_->faults;
  detail::collect_keys(*document_, *document_->root, faults);
  return faults.all();
}

std::size_t Yaml::fault_count() const { return document_->faults.count(); }

void Yaml::finish() const {
  if (auto all = faults(); !all.empty()) throw InputError{std::move(all)};
}

}  // namespace invar::config
