#include "core/model/recording_file.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <type_traits>

#include "core/model/record_file.hpp"
#include "core/recording/cdr.hpp"
#include "core/recording/idl_type.hpp"
#include "core/recording/recording_reader.hpp"

namespace invar::model {

namespace {

using recording::Value;

constexpr const char* remainder = "remainder";

constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

std::string trimmed(std::string_view text) {
  const auto begin = text.find_first_not_of(' ');
  if (begin == std::string_view::npos) return {};
  return std::string{text.substr(begin, text.find_last_not_of(' ') - begin + 1)};
}

/// `stage_x.state[axis=0].setpoint_position + correction`, taken apart.
struct Source {
  std::string signal, text;
  std::string output;                                    // "stage_x/state"
  std::vector<std::pair<std::string, double>> instance;  // what its key must be
  std::vector<std::string> fields;
};

std::optional<Source> parse(const physics::Signal& signal) {
  Source source{signal.name, signal.column, {}, {}, {}};
  const std::string& text = signal.column;
  const auto dot = text.find('.');
  if (dot == 0 || dot == std::string::npos) return std::nullopt;
  const auto end = text.find_first_of(".[", dot + 1);
  if (end == std::string::npos || end == dot + 1) return std::nullopt;
  source.output = text.substr(0, dot) + "/" + text.substr(dot + 1, end - dot - 1);
  std::size_t at = end;
  if (text[at] == '[') {
    const auto close = text.find(']', at), equals = text.find('=', at);
    if (close == std::string::npos || equals > close) return std::nullopt;
    double key = 0.0;
    const auto read = std::from_chars(text.data() + equals + 1, text.data() + close, key);
    if (read.ec != std::errc{} || read.ptr != text.data() + close) return std::nullopt;
    source.instance.emplace_back(trimmed(text.substr(at + 1, equals - at - 1)), key);
    at = close + 1;
  }
  if (at >= text.size() || text[at] != '.') return std::nullopt;
  for (++at; at <= text.size();) {
    const auto plus = std::min(text.find('+', at), text.size());
    source.fields.push_back(trimmed(std::string_view{text}.substr(at, plus - at)));
    if (source.fields.back().empty()) return std::nullopt;
    at = plus + 1;
  }
  return source;
}

/// The member at "at.time_ns" of a structure; null where there is none.
const recording::Member* member_at(const recording::Type& type, std::string_view path) {
  const auto dot = path.find('.');
  const auto name = path.substr(0, dot);
  const auto found = std::find_if(type.members.begin(), type.members.end(),
                                  [&](const auto& member) { return member.name == name; });
  if (found == type.members.end()) return nullptr;
  return dot == std::string_view::npos ? &*found : member_at(*found->type, path.substr(dot + 1));
}

/// Says a sample when it was made, and in which cycle, in the numbers that a stamp has?
bool has_stamp(const recording::Type& type) {
  const auto* time = member_at(type, "at.time_ns");
  const auto* cycle = member_at(type, "at.cycle");
  return time != nullptr && cycle != nullptr && time->type->kind == recording::Kind::int64 &&
         cycle->type->kind == recording::Kind::uint64;
}

std::string names_of(const recording::Type& type) {
  std::string list;
  for (const auto& member : type.members) list += (list.empty() ? "" : ", ") + member.name;
  return list;
}

/// The messages of a topic: their stamps and what the model wants of them. In columns, since an hour of a loop is millions.
struct Samples {
  std::vector<std::int64_t> time, cycle;
  std::vector<bool> enabled;
  std::vector<std::vector<double>> values;  // by source of the topic

  [[nodiscard]] std::size_t size() const { return time.size(); }
  /// By stamp, one each.
  void put_in_order() {
    if (std::adjacent_find(time.begin(), time.end(), std::greater_equal<>{}) == time.end()) return;
    std::vector<std::size_t> order(size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [this](auto a, auto b) { return time[a] < time[b]; });
    const auto twice =
        std::unique(order.begin(), order.end(), [this](auto a, auto b) { return time[a] == time[b]; });
    order.erase(twice, order.end());
    const auto reorder = [&](auto& column) {
      std::remove_reference_t<decltype(column)> ordered;
      ordered.reserve(order.size());
      for (const auto i : order) ordered.push_back(column[i]);
      column = std::move(ordered);
    };
    for (auto& column : values) reorder(column);
    reorder(enabled);
    reorder(cycle);
    reorder(time);  // last: the order is by it
  }
};

/// A topic of the recording with what the model wants of it.
struct Topic {
  std::string name;
  recording::TypePointer type;
  std::vector<Source> sources;
  std::vector<std::pair<std::string, double>> instance;
  std::vector<std::string> units;
  Samples samples;
};

class Reader {
 public:
  Reader(const std::filesystem::path& file, const physics::Model& model)
      : file_{file.string()}, model_{model}, recording_{recording::Recording::open(file)} {}

  std::vector<recording::Table> run() {
    if (model_.row_rate)
      refuse("has stamps, and the model says a `rate` in place of them",
             "name the stamp, such as `time: stage_x.state.at`");
    if (recording_.channels().empty()) refuse("holds no topic", "record with `invar record`");
    find_topics();
    read_samples();
    const Topic& clock = *clock_;
    check_cycles(clock);
    std::vector<recording::Table> tables;
    std::size_t begin = 0;
    while (begin < clock.samples.size()) {
      std::size_t end = begin + 1;
      while (end < clock.samples.size() && clock.samples.enabled[end] == clock.samples.enabled[begin] &&
             clock.samples.cycle[end] > clock.samples.cycle[end - 1])
        ++end;
      if (clock.samples.enabled[begin]) {
        auto rows = until_rest(table(begin, end));
        tables.push_back(begin == 0 && has_enabled_ ? from_standstill(std::move(rows)) : std::move(rows));
      }
      begin = end;
    }
    if (tables.empty())
      throw InputError{file_, "`" + clock.name + "` never says that its axis is enabled",
                       "record while the axis moves"};
    std::stable_sort(tables.begin(), tables.end(),
                     [](const auto& a, const auto& b) { return a.rows() > b.rows(); });
    const std::size_t longest = tables.front().rows();
    std::erase_if(tables, [&](const auto& table) { return 20 * table.rows() < longest; });
    return tables;
  }

 private:
  /// What is wrong with the file itself comes first.
  [[noreturn]] void refuse(const std::string& what, const std::string& mend) const {
    if (recording_.bytes() == 0) throw InputError{file_, "is empty", "record again"};
    if (damaged_chunks_ > 0)
      throw InputError{file_,
                       "is damaged, chunks that cannot be read: " + std::to_string(damaged_chunks_) +
                           "; the rest: " + what,
                       "copy the file again"};
    if (!recording_.complete() && !recording_.damage().empty())
      throw InputError{file_, recording_.damage().front() + "; there: " + what,
                       "copy the file again, or record again"};
    throw InputError{file_, what, mend};
  }

  void find_topics() {
    std::vector<Fault> faults;
    for (const auto& signal : model_.signals) {
      if (signal.name == "feedforward" && signal.column == remainder) continue;
      auto source = parse(signal);
      if (!source) {
        faults.push_back(
            {file_, "column `" + signal.column + "` for `" + signal.name + "` is no field of a topic",
             signal.name == "time" ? "write component.port.at, such as `stage_x.state.at`"
                                   : "write component.port.field, such as `stage_x.state.position`"});
        continue;
      }
      try {
        Topic& topic = topic_of(*source);
        if (signal.name == "time") {
          clock_ = &topic;
          continue;
        }
        topic.units.push_back(unit_of(topic, *source));
        topic.sources.push_back(std::move(*source));
      } catch (const InputError& error) {
        faults.insert(faults.end(), error.faults().begin(), error.faults().end());
      }
    }
    if (!faults.empty()) throw InputError{faults};
    if (clock_ == nullptr) refuse("the model names no column for `time`", "add `time: stage_x.state.at`");
  }

  Topic& topic_of(const Source& source) {
    std::set<std::string> there, matching;
    std::uint16_t schema = 0;
    for (const auto& [id, channel] : recording_.channels()) {
      there.insert(channel.topic);
      if (channel.topic != source.output && !channel.topic.ends_with("/" + source.output)) continue;
      matching.insert(channel.topic);
      schema = channel.schema_id;
    }
    if (matching.empty()) {
      std::string list;
      for (const auto& topic : there)
        if (topic.ends_with(source.output.substr(source.output.find('/'))))
          list += (list.empty() ? "" : ", ") + topic;
      refuse("holds no topic `" + source.output + "` for `" + source.signal + "`",
             list.empty() ? "`invar recording info` lists what it holds" : "there are: " + list);
    }
    if (matching.size() > 1)
      refuse(
          "holds `" + source.output + "` of several cells: " + *matching.begin() + ", " + *matching.rbegin(),
          "record one cell");
    auto& topic = topics_[*matching.begin()];
    if (topic.type == nullptr) {
      topic.name = *matching.begin();
      const auto found = recording_.schemas().find(schema);
      if (found == recording_.schemas().end() || found->second.encoding != "omgidl")
        refuse("`" + topic.name + "` has no IDL schema", "record it with `invar record`");
      topic.type = recording::parse_idl(found->second.data, file_ + ": schema " + found->second.name)
                       .find(found->second.name);
      if (topic.type == nullptr || !has_stamp(*topic.type))
        refuse("`" + topic.name + "` carries no stamp `at`",
               "name a topic whose samples say when they were made");
    }
    for (const auto& key : source.instance) {
      if (member_at(*topic.type, key.first) == nullptr)
        refuse("`" + topic.name + "` has no field `" + key.first + "`", "it has: " + names_of(*topic.type));
      topic.instance.push_back(key);
    }
    return topic;
  }

  std::string unit_of(const Topic& topic, const Source& source) const {
    std::string unit;
    for (const auto& field : source.fields) {
      const auto* member = member_at(*topic.type, field);
      if (member == nullptr)
        refuse("`" + topic.name + "` has no field `" + field + "` for `" + source.signal + "`",
               "it has: " + names_of(*topic.type));
      unit = member->unit;
    }
    return unit;
  }

  /// Whether a message is of the instance that the columns ask for.
  static bool is_wanted(const Topic& topic, const Value& value) {
    return std::all_of(topic.instance.begin(), topic.instance.end(),
                       [&](const auto& key) { return value.at(key.first)->number() == key.second; });
  }

  void read_samples() {
    recording::Selection selection;
    for (const auto& [name, topic] : topics_) selection.topics.insert(name);
    auto stream = recording_.messages(selection);
    std::map<std::string, std::vector<double>> instances;
    while (const auto message = stream.next()) {
      Topic& topic = topics_.at(message->channel->topic);
      const auto decoded = recording::decode(*topic.type, message->data);
      if (!decoded.ok() || !is_wanted(topic, decoded.value())) continue;
      const Value& value = decoded.value();
      std::vector<double> key;
      for (const auto& member : topic.type->members)
        if (member.key) key.push_back(value.at(member.name)->number().value_or(0.0));
      if (const auto [known, is_new] = instances.try_emplace(topic.name, key);
          !is_new && known->second != key)
        refuse("`" + topic.name + "` carries several instances",
               "say which, such as `stage_x.state[axis=0].position`");
      Samples& samples = topic.samples;
      samples.time.push_back(std::get<std::int64_t>(value.at("at.time_ns")->content));
      samples.cycle.push_back(
          static_cast<std::int64_t>(std::get<std::uint64_t>(value.at("at.cycle")->content)));
      samples.enabled.push_back(true);
      if (const auto* enabled = value.at("enabled"); enabled != nullptr && enabled->number())
        samples.enabled.back() = *enabled->number() != 0.0, has_enabled_ = has_enabled_ || &topic == clock_;
      samples.values.resize(topic.sources.size());
      for (std::size_t k = 0; k < topic.sources.size(); ++k) {
        double sum = 0.0;
        for (const auto& field : topic.sources[k].fields) sum += value.at(field)->number().value_or(nothing);
        samples.values[k].push_back(sum);
      }
    }
    damaged_chunks_ = stream.damaged_chunks();
    for (auto& [name, topic] : topics_) {
      if (topic.samples.size() == 0)
        refuse("`" + name + "` holds no sample", "record it while the cell runs");
      topic.samples.put_in_order();
    }
  }

  /// Every cycle must be there, but for a few, and last as long as the model believes.
  void check_cycles(const Topic& clock) {
    const auto& samples = clock.samples;
    std::vector<std::int64_t> steps;
    std::vector<double> periods;
    for (std::size_t i = 1; i < samples.size(); ++i) {
      steps.push_back(samples.cycle[i] - samples.cycle[i - 1]);
      if (steps.back() > 0)
        periods.push_back(1e-9 * static_cast<double>(samples.time[i] - samples.time[i - 1]) /
                          static_cast<double>(steps.back()));
    }
    if (periods.size() < 8) refuse("`" + clock.name + "` holds hardly a sample", "record for longer");
    std::int64_t missing = 0;
    for (const auto step : steps) missing += std::max<std::int64_t>(0, step - 1);
    const auto middle = [](auto& values) {
      std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                       values.end());
      return values[values.size() / 2];
    };
    const std::string output = clock.name.substr(clock.name.rfind('/') + 1);
    if (const auto step = middle(steps); step > 1)
      refuse("`" + clock.name + "` holds only each " + std::to_string(step) + "th cycle of its loop",
             "leave `" + output + "` out of `publish` in the cell file: every cycle is needed");
    period_ = middle(periods);
    if (model_.controller && std::abs(period_ * model_.controller->rate - 1.0) > 0.01) {
      char text[96];
      std::snprintf(text, sizeof text,
                    "was recorded in a loop of %.6g Hz, the model's controller runs at %.6g Hz",
                    1.0 / period_, model_.controller->rate);
      refuse(text, "write the loop's rate into `controller`");
    }
    const auto all = static_cast<std::int64_t>(samples.size()) + missing;
    if (static_cast<double>(missing) > most_lost * static_cast<double>(all))
      refuse("lacks " + std::to_string(missing) + " of " + std::to_string(all) + " cycles of `" + clock.name +
                 "`",
             "record on the PC of the loop, or on one with less load");
  }

  recording::Table table(std::size_t begin, std::size_t end) const {
    recording::Table table;
    table.file = file_;
    std::vector<double> time;
    const auto& rows = clock_->samples;
    for (std::size_t row = begin; row < end; ++row)
      time.push_back(period_ * static_cast<double>(rows.cycle[row] - rows.cycle[begin]));
    table.add(model_.signal("time")->column, "s", std::move(time));
    for (const auto& [name, topic] : topics_)
      for (std::size_t k = 0; k < topic.sources.size(); ++k) {
        std::vector<double> values;
        std::size_t next = 0;
        for (std::size_t row = begin; row < end; ++row) {
          while (next < topic.samples.size() && topic.samples.time[next] <= rows.time[row]) ++next;
          values.push_back(next == 0 ? nothing : topic.samples.values[k][next - 1]);
        }
        table.add(topic.sources[k].text, topic.units[k], std::move(values));
      }
    return table;
  }

  /// Whoever recorded was slower than the motion. An axis that stands is held by dry friction, and what its controller asks
  /// for meanwhile is a matter of where it came to rest: behind half a second of that the recording says nothing.
  recording::Table until_rest(recording::Table table) const {
    const auto* signal = model_.signal("reference");
    if (signal == nullptr) return table;
    const auto& reference = table.find(signal->column)->values;
    std::size_t moved = 0;
    for (std::size_t i = 1; i < reference.size(); ++i)
      if (reference[i] != reference[i - 1]) moved = i;
    const auto& time = table.find(model_.signal("time")->column)->values;
    const auto end = std::upper_bound(time.begin(), time.end(), time[moved] + 0.5) - time.begin();
    if (moved == 0) return table;
    table.behind += table.rows() - static_cast<std::size_t>(end);
    for (auto& column : table.columns) column.values.resize(static_cast<std::size_t>(end));
    return table;
  }

  /// The loop ran before: what its controller remembers is known at rest alone.
  recording::Table from_standstill(recording::Table table) const {
    const auto* signal = model_.signal("reference");
    if (signal == nullptr) return table;
    const auto& reference = table.find(signal->column)->values;
    constexpr std::size_t still = 20;
    std::size_t begin = 0, since = 0;
    for (std::size_t i = 1; i < reference.size() && begin == 0; ++i) {
      if (reference[i] != reference[i - 1]) since = i;
      if (i - since >= still) begin = i - still + 1;
    }
    if (begin <= 1) return table;
    table.before += begin;
    for (auto& column : table.columns)
      column.values.erase(column.values.begin(), column.values.begin() + static_cast<std::ptrdiff_t>(begin));
    return table;
  }

  std::string file_;
  const physics::Model& model_;
  recording::Recording recording_;
  std::map<std::string, Topic> topics_;
  const Topic* clock_ = nullptr;
  bool has_enabled_ = false;
  std::size_t damaged_chunks_ = 0;
  double period_ = 0.0;
};

physics::Model without_feedforward(physics::Model model) {
  std::erase_if(model.signals, [](const auto& signal) { return signal.name == "feedforward"; });
  return model;
}

/// What the stage fed forward: its current less what the controller makes of reference and position. A constant may belong to
/// either; it is the loop's sum or the feedforward to the same effect. Behind lost cycles, and where the current is at its
/// limit, nobody knows: the simulation bridges.
void add_remainder(recording::Table& table, const physics::Model& model) {
  const auto* asked = model.signal("feedforward");
  if (asked == nullptr || asked->column != remainder || table.has(remainder)) return;
  if (!model.controller)
    throw InputError{table.file.string(), "`feedforward: remainder` needs the law of the controller",
                     "add `controller` to the model, or name a column"};
  constexpr int settling = 3;  // cycles that the velocity filter needs
  const auto record = to_record(table, without_feedforward(model), true).record;
  const auto &reference = *record.find("reference"), &position = *record.find("position"),
             &current = *record.find("current");
  physics::AxisController controller{*model.controller};
  const double rate = model.controller->rate, limit = model.controller->limit;
  std::vector<double> values;
  int unsure = 0;
  for (std::size_t row = 0; row < record.rows(); ++row) {
    const auto ticks = row == 0 ? 1L : std::lround((record.time[row] - record.time[row - 1]) * rate);
    const bool known =
        std::isfinite(reference[row]) && std::isfinite(position[row]) && std::isfinite(current[row]);
    if (row > 0 && ticks > 1 && ticks < 100 && known && std::isfinite(reference[row - 1] + position[row - 1]))
      for (long k = 1; k < ticks; ++k) {
        const double share = static_cast<double>(k) / static_cast<double>(ticks);
        (void)controller.step(reference[row - 1] + share * (reference[row] - reference[row - 1]),
                              position[row - 1] + share * (position[row] - position[row - 1]));
      }
    unsure = ticks != 1 || !known ? settling : unsure - 1;
    const double command = known ? controller.step(reference[row], position[row]) : nothing;
    const bool at_limit = limit > 0.0 && !(std::abs(current[row]) < 0.999 * limit);
    values.push_back(unsure > 0 || at_limit ? nothing : current[row] - command);
  }
  table.add(remainder, model.signal("current")->unit, std::move(values));
}

}  // namespace

std::vector<std::string> columns_of(const physics::Model& model) {
  std::vector<std::string> columns;
  for (const auto& signal : model.signals)
    if (signal.name != "time" || !model.row_rate) columns.push_back(signal.column);
  return columns;
}

std::vector<recording::Table> read_recording(const std::filesystem::path& file, const physics::Model& model) {
  std::vector<recording::Table> tables;
  if (file.extension() == ".mcap")
    tables = Reader{file, model}.run();
  else
    tables.push_back(recording::Table::read_columns(file, columns_of(model)));
  for (auto& table : tables) add_remainder(table, model);
  return tables;
}

}  // namespace invar::model
