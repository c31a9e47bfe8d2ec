#include "core/config/yaml.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <numeric>
#include <set>
#include <sstream>

#include "core/base/shown.hpp"
#include "core/base/unit.hpp"

namespace invar::config {

namespace detail {

struct Place {
  YAML::Node yaml;
  std::string path;
  std::string key;
  int line = 0;
  bool accept_all = false;
  std::set<std::string> known;
  std::vector<std::pair<std::string, std::shared_ptr<Place>>> children;
};

struct Document {
  std::filesystem::path file;
  std::string text;
  std::shared_ptr<Place> root;
  std::vector<Fault> faults;
};

}  // namespace detail

namespace {

using detail::Document;
using detail::Place;

std::string joined(const std::string& path, const std::string& key) {
  return path.empty() ? key : path + "." + key;
}

int line_of(const YAML::Node& node, int otherwise) {
  return node.IsDefined() && !node.IsNull() && !node.Mark().is_null() ? node.Mark().line + 1 : otherwise;
}

std::string located(const Document& document, const Place& place) {
  std::string where = document.file.string();
  if (place.line > 0) where += ":" + std::to_string(place.line);
  if (!place.path.empty()) where += ": " + place.path;
  return where;
}

/// Keys that stand twice (of which the parser would keep the first) and keys that nobody asked for.
void collect_keys(const Document& document, const Place& place, std::vector<Fault>& faults) {
  const auto located_at = [&](const YAML::Node& key) {
    return document.file.string() + ":" + std::to_string(line_of(key, 0)) + ": " +
           joined(place.path, key.Scalar());
  };
  if (place.yaml.IsDefined() && place.yaml.IsMap()) {
    std::set<std::string> seen;
    for (const auto& entry : place.yaml)
      if (!seen.insert(entry.first.Scalar()).second)
        faults.push_back({located_at(entry.first), "stands twice", "keep one of them"});
  }
  if (place.accept_all) return;
  if (place.yaml.IsDefined() && place.yaml.IsMap() && !place.known.empty()) {
    const std::vector<std::string> known{place.known.begin(), place.known.end()};
    for (const auto& entry : place.yaml) {
      const std::string key = entry.first.Scalar();
      if (place.known.contains(key)) continue;
      std::string mend = "remove it, or use one of: ";
      if (const std::string near = nearest(key, known); !near.empty()) {
        mend = "did you mean `" + near + "`?";
      } else {
        for (const auto& name : known) mend += (name == known.front() ? "" : ", ") + name;
      }
      faults.push_back({located_at(entry.first), "unknown key", mend});
    }
  }
  for (const auto& [key, child] : place.children) collect_keys(document, *child, faults);
}

Yaml fail(const std::filesystem::path& file, const std::string& what, const std::string& mend) {
  throw InputError{file.string(), what, mend};
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
  document_->faults.push_back({where(), std::move(what), std::move(mend)});
}

bool Node::has(std::string_view name) const { return (*this)[name].exists(); }

Node Node::operator[](std::string_view name) const {
  const std::string key{name};
  place_->known.insert(key);
  for (const auto& [known, child] : place_->children)
    if (known == key) return {document_, child};
  auto child = std::make_shared<Place>();
  if (is_map()) {  // a missing key must not become a node of its own: yaml-cpp's "zombie" throws on every use
    const auto& map = static_cast<const YAML::Node&>(place_->yaml);
    if (map[key].IsDefined()) child->yaml.reset(map[key]);
  }
  child->key = key;
  child->path = joined(place_->path, key);
  child->line = line_of(child->yaml, place_->line);
  place_->children.emplace_back(key, child);
  return {document_, child};
}

Node Node::required(std::string_view name) const {
  if (exists() && !is_map())
    fault("a map is expected here", "write `" + std::string{name} + ": ...` below it");
  Node child = (*this)[name];
  if (!child.exists() && is_map()) child.fault("missing", "add `" + std::string{name} + ":`");
  return child;
}

std::vector<Node> Node::children() const {
  std::vector<Node> result;
  if (is_map()) {
    std::set<std::string> seen;
    for (const auto& entry : place_->yaml) {
      const std::string key = entry.first.Scalar();
      if (seen.insert(key).second) result.push_back((*this)[key]);
    }
  } else if (is_list()) {
    std::size_t index = 0;
    for (const auto& entry : place_->yaml) {
      const std::string key = std::to_string(index++);
      auto found = std::find_if(place_->children.begin(), place_->children.end(),
                                [&](const auto& child) { return child.first == key; });
      if (found == place_->children.end()) {
        auto child = std::make_shared<Place>();
        child->yaml.reset(entry);
        child->key = key;
        child->path = place_->path + "[" + key + "]";
        child->line = line_of(entry, place_->line);
        place_->children.emplace_back(key, child);
        found = std::prev(place_->children.end());
      }
      result.push_back({document_, found->second});
    }
  }
  return result;
}

Quantity Node::as_quantity(std::string_view unit, Range range) const {
  const double harmless =
      range.contains(0.0) ? 0.0 : (std::isfinite(range.lower) ? range.lower : range.upper);
  if (!exists()) {
    fault("missing", "write a number here");
    return {harmless, std::nullopt};
  }
  Node number = *this;
  Conversion to_asked;
  Quantity result;
  if (is_map()) {
    number = required("value");
    if (const Node written = (*this)["unit"]; written.exists()) {
      const std::string name = written.as_text();
      if (const auto convert = conversion(name, unit)) {
        to_asked = *convert;
      } else if (!parse_unit(name)) {
        written.fault("`" + name + "` is no unit", "write it in " + std::string{unit});
      } else {
        const bool pure = unit.empty() || unit == "1";
        written.fault("`" + name + "` does not measure the same as " +
                          (pure ? "a number without unit" : std::string{unit}),
                      pure ? "leave the unit out" : "write it in " + std::string{unit});
      }
    }
    if (const Node sigma = (*this)["sigma"]; sigma.exists())
      result.sigma = sigma.as_number("", Range::not_negative()) * std::abs(to_asked.factor);
    if (!number.exists()) return {harmless, result.sigma};
  }
  double value = 0.0;
  if (!number.is_scalar() || !YAML::convert<double>::decode(number.raw(), value)) {
    number.fault(
        "`" + (number.is_scalar() ? number.raw().Scalar() : std::string{"..."}) + "` is not a number",
        unit.empty() || unit == "1"
            ? "write a number"
            : "write a number in " + std::string{unit} + ", or {value: ..., unit: ...}");
    return {harmless, result.sigma};
  }
  value = to_asked(value);
  if (!std::isfinite(value)) {
    number.fault("`" + number.raw().Scalar() + "` is not finite", "write a finite number");
    return {harmless, result.sigma};
  }
  if (!range.contains(value)) {
    number.fault("`" + number.raw().Scalar() + "` is out of range", "it must be " + range_text(range, unit));
    return {harmless, result.sigma};
  }
  result.value = value;
  return result;
}

double Node::as_number(std::string_view unit, Range range) const { return as_quantity(unit, range).value; }

std::int64_t Node::as_integer(std::int64_t lower, std::int64_t upper) const {
  std::int64_t value = 0;
  if (!is_scalar() || !YAML::convert<std::int64_t>::decode(place_->yaml, value)) {
    fault("`" + (is_scalar() ? place_->yaml.Scalar() : std::string{"..."}) + "` is not a whole number",
          "write a whole number");
    return lower;
  }
  if (value < lower || value > upper) {
    fault("`" + place_->yaml.Scalar() + "` is out of range",
          "it must be between " + std::to_string(lower) + " and " + std::to_string(upper));
    return lower;
  }
  return value;
}

std::string Node::as_text() const {
  if (!exists()) return {};
  if (!is_scalar()) {
    fault("a text is expected here", "write one word or a quoted text");
    return {};
  }
  return place_->yaml.Scalar();
}

std::string Node::as_choice(std::initializer_list<std::string_view> choices) const {
  const std::string word = as_text();
  for (const auto& choice : choices)
    if (word == choice) return word;
  if (exists() && is_scalar()) {
    std::string mend = "use one of: ";
    for (const auto& choice : choices) mend += (choice == *choices.begin() ? "" : ", ") + std::string{choice};
    fault("`" + word + "` is not known here", mend);
  }
  return std::string{*choices.begin()};
}

bool Node::as_flag() const {
  bool value = false;
  if (!is_scalar() || !YAML::convert<bool>::decode(place_->yaml, value))
    fault("`" + (is_scalar() ? place_->yaml.Scalar() : std::string{"..."}) + "` is neither true nor false",
          "write true or false");
  return value;
}

Range Node::as_range(std::string_view unit) const {
  const auto numbers = as_numbers(unit);
  if (numbers.size() != 2 || !(numbers[0] < numbers[1])) {
    fault("a range is expected here", "write [lower, upper] with lower < upper");
    return {0.0, 1.0};
  }
  return {numbers[0], numbers[1]};
}

std::vector<double> Node::as_numbers(std::string_view unit) const {
  std::vector<double> result;
  if (exists() && !is_list()) fault("a list of numbers is expected here", "write [1, 2, 3]");
  for (const Node& child : children()) result.push_back(child.as_number(unit));
  return result;
}

std::vector<std::string> Node::as_texts() const {
  std::vector<std::string> result;
  if (exists() && !is_list()) fault("a list is expected here", "write [a, b, c]");
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
  if (std::filesystem::is_directory(file)) return fail(file, "is a folder", "name a file");
  std::ifstream stream{file, std::ios::binary};
  if (!stream) return fail(file, "cannot be read", "check the path and its permissions");
  std::ostringstream text;
  text << stream.rdbuf();
  return parse(text.str(), file.string());
}

Yaml Yaml::parse(const std::string& text, const std::string& name) {
  Yaml result;
  result.document_ = std::make_shared<Document>();
  result.document_->file = name;
  result.document_->text = text;
  result.document_->root = std::make_shared<Place>();
  if (text.find('\0') != std::string::npos) return fail(name, "is not a text file", "name a YAML file");
  try {
    result.document_->root->yaml.reset(YAML::Load(text));
  } catch (const YAML::Exception& error) {
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
  collect_keys(*document_, *document_->root, faults);
  return faults;
}

std::size_t Yaml::fault_count() const { return document_->faults.size(); }

void Yaml::finish() const {
  if (auto all = faults(); !all.empty()) throw InputError{std::move(all)};
}

/// Letters inserted, left out, exchanged or swapped with their neighbour (the optimal string alignment distance).
static std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), above(b.size() + 1), row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    before = above;
    above = row;
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      row[j + 1] = std::min({above[j + 1] + 1, row[j] + 1, above[j] + (a[i] == b[j] ? 0U : 1U)});
      if (i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j])
        row[j + 1] = std::min(row[j + 1], before[j - 1] + 1);
    }
  }
  return row.back();
}

std::string nearest(std::string_view word, const std::vector<std::string>& choices) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(1, word.size() / 3) + 1;
  for (const auto& choice : choices) {
    if (const std::size_t distance = edits(word, choice); distance < best_distance) {
      best_distance = distance;
      best = choice;
    }
  }
  return best;
}

}  // namespace invar::config
