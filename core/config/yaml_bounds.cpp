#include "core/config/yaml_bounds.hpp"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <map>
#include <sstream>
#include <vector>

#include "core/base/fault.hpp"
#include "core/base/limits.hpp"
#include "core/base/name.hpp"
#include "core/base/shown.hpp"

namespace invar::config {

namespace {

class Bounds final : public YAML::EventHandler {
 public:
  explicit Bounds(const std::string& name) : name_{name} {}

  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override { add(mark, anchor, 1); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    const auto found = sizes_.find(anchor);
    if (found == sizes_.end()) refuse(mark, "an alias stands within what it names", "write it out");
    add(mark, {}, found->second);
  }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& text) override {
    check_tag(mark, tag);
    const bool key = !open_.empty() && open_.back().is_map && open_.back().items % 2 == 0;
    if (text.size() > limits::yaml_text)
      refuse(mark, "a text has " + std::to_string(text.size()) + " bytes",
             "use at most " + std::to_string(limits::yaml_text));
    if (const auto flaw = key ? flaw_of_label(text) : flaw_of_text(text))
      refuse(mark, (key ? "key `" : "`") + clipped(text) + "` " + flaw->what, flaw->mend);
    add(mark, anchor, 1);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    check_tag(mark, tag);
    open(mark, anchor, false);
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    check_tag(mark, tag);
    open(mark, anchor, true);
  }
  void OnMapEnd() override { close(); }

 private:
  struct Open {
    YAML::Mark mark;
    YAML::anchor_t anchor;
    bool is_map;
    std::size_t items = 0, values = 1;
  };

  [[noreturn]] void refuse(const YAML::Mark& mark, const std::string& what, const std::string& mend) const {
    throw InputError{name_ + ":" + std::to_string(mark.line + 1), what, mend};
  }
  /// No tag changes how a value is read, so one that is written says something that is not done. `?` and `!` are the parser's
  /// own, for plain and quoted text.
  void check_tag(const YAML::Mark& mark, const std::string& tag) const {
    if (!tag.empty() && tag != "?" && tag != "!")
      refuse(mark, "the tag `" + clipped(tag) + "` is not understood", "remove it");
  }
  void open(const YAML::Mark& mark, YAML::anchor_t anchor, bool is_map) {
    if (open_.size() == limits::yaml_depth)
      refuse(mark, "the values are nested more than " + std::to_string(limits::yaml_depth) + " deep",
             "nest them less");
    open_.push_back({mark, anchor, is_map});
  }
  void close() {
    const Open done = open_.back();
    open_.pop_back();
    add(done.mark, done.anchor, done.values);
  }
  void add(const YAML::Mark& mark, YAML::anchor_t anchor, std::size_t values) {
    if (anchor != 0) sizes_[anchor] = values;
    std::size_t& sum = open_.empty() ? at_root_ : open_.back().values;
    sum += values;
    if (!open_.empty()) ++open_.back().items;
    if (sum > limits::yaml_values || ++events_ > limits::yaml_values)
      refuse(mark, "holds more than " + std::to_string(limits::yaml_values) + " values up to here",
             "name a file that is meant for this, or take fewer (an alias counts with all it stands for)");
  }

  const std::string& name_;
  std::vector<Open> open_;
  std::map<YAML::anchor_t, std::size_t> sizes_;
  std::size_t at_root_ = 0, events_ = 0;
};

}  // namespace

void check_bounds(const std::string& text, const std::string& name) {
  if (text.size() > limits::yaml_bytes)
    throw InputError{name, "has more than " + std::to_string(limits::yaml_bytes / limits::mib) + " MiB",
                     "no YAML file is so long: name the right one"};
  std::istringstream stream{text};
  YAML::Parser parser{stream};
  Bounds bounds{name};
  while (parser.HandleNextDocument(bounds)) {
  }
}

}  // namespace invar::config
