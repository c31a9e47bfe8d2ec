#include "core/compensation/model_file.hpp"

#include <zlib.h>

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>

#include "core/base/contract.hpp"
#include "core/base/fault.hpp"
#include "core/base/name.hpp"
#include "core/base/new_file.hpp"
#include "core/config/quotes.hpp"

namespace invar::compensation {

namespace {

std::string digits(double value) {
  if (std::isnan(value)) return ".nan";
  if (std::isinf(value)) return value > 0.0 ? ".inf" : "-.inf";
  std::array<char, 40> buffer{};
  return {buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr};
}

std::string all_of(const std::filesystem::path& file) {
  std::ifstream stream{file, std::ios::binary};
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

}  // namespace

ModelText::ModelText(const std::string& kind, const std::vector<std::filesystem::path>& sources) {
  text_ = "invar_compensation: 1\nkind: " + kind + "\n";
  if (sources.empty()) return;
  open_list("identified_from");
  for (const auto& source : sources)
    item().text("file", source.filename().string()).text("crc32", checksum(all_of(source)));
  close();
}

std::string& ModelText::line(const std::string& key) {
  std::string indent(depth_ * 2, ' ');
  if (item_begins_) indent.replace(indent.size() - 2, 2, "- ");
  item_begins_ = false;
  return text_ += indent + key + ":";
}

ModelText& ModelText::comment(const std::string& text) {
  text_ += std::string(depth_ * 2, ' ') + "# " + printable(text) + "\n";
  return *this;
}

ModelText& ModelText::open(const std::string& key) {
  line(key) += "\n";
  steps_.push_back(1);
  depth_ += 1;
  return *this;
}

ModelText& ModelText::open_list(const std::string& key) {
  line(key) += "\n";
  steps_.push_back(2);
  depth_ += 2;
  return *this;
}

ModelText& ModelText::item() {
  item_begins_ = true;
  return *this;
}

ModelText& ModelText::close() {
  INVAR_EXPECTS(!steps_.empty());
  depth_ -= steps_.back();
  steps_.pop_back();
  return *this;
}

ModelText& ModelText::number(const std::string& key, double value) {
  line(key) += " " + digits(value) + "\n";
  return *this;
}

ModelText& ModelText::integer(const std::string& key, long value) {
  line(key) += " " + std::to_string(value) + "\n";
  return *this;
}

ModelText& ModelText::text(const std::string& key, const std::string& value) {
  line(key) += " " + config::in_quotes(value) + "\n";
  return *this;
}

ModelText& ModelText::range(const std::string& key, const Range& value) {
  line(key) += " [" + digits(value.lower) + ", " + digits(value.upper) + "]\n";
  return *this;
}

ModelText& ModelText::numbers(const std::string& key, const double* first, std::size_t count) {
  std::string& out = line(key) += " [";
  for (std::size_t i = 0; i < count; ++i) out += (i > 0 ? ", " : "") + digits(first[i]);
  out += "]\n";
  return *this;
}

ModelText& ModelText::numbers(const std::string& key, const std::vector<double>& values) {
  return numbers(key, values.data(), values.size());
}

ModelText& ModelText::numbers(const std::string& key, const Eigen::Ref<const Eigen::VectorXd>& values) {
  return numbers(key, values.data(), static_cast<std::size_t>(values.size()));
}

std::string ModelText::sealed() const { return text_ + "checksum: \"" + checksum(text_) + "\"\n"; }

void ModelText::write(const std::filesystem::path& file) const { write_file(file, sealed()); }

std::string checksum(const std::string& text) {
  const auto value = crc32(0, reinterpret_cast<const Bytef*>(text.data()), static_cast<uInt>(text.size()));
  std::array<char, 16> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%08lx", value);
  return buffer.data();
}

std::uint32_t check_seal(const config::Yaml& model) {
  if (!model.root().has("checksum")) return 0;
  const std::string said = model.root().text("checksum");
  const auto at = model.text().rfind("\nchecksum:");
  if (at == std::string::npos || checksum(model.text().substr(0, at + 1)) != said)
    throw InputError{model.file().string(), "its checksum does not fit its text: it is damaged or was edited",
                     "calibrate again, or remove the line `checksum` if the edit was meant"};
  return checksum_number(said);
}

std::uint32_t checksum_number(const std::string& text) {
  std::uint32_t number = 0;
  (void)std::from_chars(text.data(), text.data() + text.size(), number, 16);
  return number;
}

std::vector<double> exactly(const config::Node& node, std::size_t count, const char* unit) {
  std::vector<double> values = node.as_numbers(unit);
  if (values.size() != count) {
    node.fault("holds " + std::to_string(values.size()) + " numbers, " + std::to_string(count) +
               " belong here");
    values.assign(count, 0.0);
  }
  return values;
}

}  // namespace invar::compensation
