#include "core/recording/export.hpp"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "core/base/fault.hpp"
#include "core/base/name.hpp"
#include "core/base/new_file.hpp"
#include "core/base/shown.hpp"
#include "core/recording/cdr.hpp"
#include "core/recording/columns.hpp"
#include "core/recording/value_json.hpp"

namespace invar::recording {

namespace {

/// A text on its way out, line by line.
class Output {
 public:
  explicit Output(const std::filesystem::path& target)
      : file_{target}, stream_{file_.path(), std::ios::binary} {
    if (!stream_) file_.refuse();
  }

  void write(const std::string& line) {
    stream_.write(line.data(), static_cast<std::streamsize>(line.size()));
  }
  void finish() {
    stream_.close();
    if (!stream_) file_.refuse();
    file_.finish();
  }

 private:
  NewFile file_;
  std::ofstream stream_;
};

/// One topic on its way out.
struct Topic {
  ExportedTopic report;
  TypePointer type;
  std::optional<Columns> columns;
  std::unique_ptr<Output> output;
  Instant newest{0};  // sending of the rows so far, where the samples have no stamp
};

std::string file_name(const std::string& topic) {
  std::string name;
  for (const char c : topic) {
    const bool plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' || c == '.';
    name += c == '/' ? '.' : plain ? c : '_';
  }
  while (name.starts_with('.')) name.erase(0, 1);
  return name.empty() ? "topic" : name;
}

void append_number(std::string& line, auto value) {
  char digits[40];
  line.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
}

constexpr Instant year_2000{946'684'800'000'000'000};
bool is_simulated(Instant time) { return time < year_2000; }

/// When a sample was made: its stamp, an invar::base::Stamp. Nothing: its type has none, or nobody filled it; simulated time
/// begins with 0.
std::optional<Instant> made(const Value& value, Instant received) {
  const Value* stamp = value.at("at");
  const Value* time = stamp == nullptr ? nullptr : stamp->at("time_ns");
  const auto* ns = time == nullptr ? nullptr : std::get_if<std::int64_t>(&time->content);
  return ns == nullptr || (*ns == 0 && !is_simulated(received)) ? std::nullopt : std::optional{Instant{*ns}};
}

Instant sent(const RecordedMessage& message) {
  return message.publish_time.ns == 0 ? message.log_time : message.publish_time;
}

/// Simulated time counts from the start of the cell, as it is; also in a recording that was made by the wall clock.
double seconds_since(Instant start, Instant time) {
  return (is_simulated(time) ? time - Instant{} : time - start).in_seconds();
}

class Exporter {
 public:
  Exporter(const Recording& recording, const std::filesystem::path& folder, const ExportOptions& options)
      : recording_{recording}, options_{options} {
    complete_topics();
    refuse_unknown_topics();
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw InputError{folder.string(), "cannot be made: " + error.message(), "name another folder"};
    for (const auto& [id, channel] : recording_.channels())
      if (options_.selection.topics.empty() || options_.selection.topics.contains(channel.topic))
        add_channel(id, channel, folder);
  }

  ExportReport run() {
    widen();
    for (Topic* topic : in_order_)
      if (topic->output && !options_.json) topic->output->write(header(*topic));
    ExportReport report;
    auto stream = recording_.messages(options_.selection);
    std::string line;
    while (const auto message = stream.next()) {
      Topic& topic = *by_channel_.at(message->channel->id);
      if (!topic.output) continue;
      const auto value = decode(*topic.type, message->data);
      if (!value.ok()) {
        if (topic.report.undecodable++ == 0)
          topic.report.problem =
              "message " + std::to_string(message->sequence) + ": " + std::string{sentence(value.error())};
        continue;
      }
      line.clear();
      if (options_.json)
        append_json(line, *message, value.value());
      else
        append_row(line, topic, *message, value.value());
      topic.output->write(line);
      ++topic.report.rows;
    }
    report.damaged_chunks = stream.damaged_chunks();
    for (Topic* topic : in_order_) {
      if (topic->output) topic->output->finish();
      if (topic->columns) topic->report.shortened = topic->columns->shortened();
      report.topics.push_back(topic->report);
    }
    return report;
  }

 private:
  void refuse_unknown_topics() const {
    for (const std::string& topic : options_.selection.topics) {
      const auto& channels = recording_.channels();
      const bool known = std::any_of(channels.begin(), channels.end(),
                                     [&](const auto& entry) { return entry.second.topic == topic; });
      if (!known)
        throw InputError{"--topic " + topic, "is not in the recording",
                         "`invar recording info` lists its topics"};
    }
  }

  /// `component.port` stands for the topics that end in component/port, as in the commands that look at a running cell.
  void complete_topics() {
    std::set<std::string> whole;
    for (const std::string& topic : options_.selection.topics) {
      const std::size_t dot = topic.find('.');
      const std::string end =
          dot == std::string::npos ? "" : "/" + topic.substr(0, dot) + "/" + topic.substr(dot + 1);
      bool found = false;
      for (const auto& [id, channel] : recording_.channels()) {
        if (end.empty() || !channel.topic.ends_with(end)) continue;
        whole.insert(channel.topic);
        found = true;
      }
      if (!found) whole.insert(topic);
    }
    options_.selection.topics = std::move(whole);
  }

  void add_channel(std::uint16_t id, const mcap::Channel& channel, const std::filesystem::path& folder) {
    const auto schema = recording_.schemas().find(channel.schema_id);
    const std::string type_name = schema == recording_.schemas().end() ? "" : schema->second.name;
    // Channels of one topic and type (several writers) share a file.
    auto& topic = topics_[{channel.topic, channel.schema_id}];
    if (topic == nullptr) {
      topic = std::make_unique<Topic>();
      in_order_.push_back(topic.get());
      topic->report.topic = channel.topic;
      topic->report.type = type_name;
      prepare(*topic, channel, schema == recording_.schemas().end() ? nullptr : &schema->second, folder);
    }
    by_channel_[id] = topic.get();
  }

  void prepare(Topic& topic, const mcap::Channel& channel, const mcap::Schema* schema,
               const std::filesystem::path& folder) {
    if (schema == nullptr || schema->encoding != "omgidl" || channel.message_encoding != "cdr") {
      topic.report.problem = "messages are `" + channel.message_encoding + "` by `" +
                             (schema == nullptr ? "no schema" : schema->encoding) + "`, not cdr by omgidl";
      return;
    }
    try {
      topic.type = parse_idl(schema->data, "schema " + clipped(printable(schema->name))).find(schema->name);
    } catch (const InputError& error) {
      topic.report.problem = error.what();
      return;
    }
    if (topic.type == nullptr) {
      topic.report.problem = "its schema does not define `" + schema->name + "`";
      return;
    }
    try {
      if (!options_.json) topic.columns.emplace(*topic.type, options_.longest);
    } catch (const InputError& error) {
      topic.report.problem = error.what();
      return;
    }
    const std::string stem = file_name(channel.topic);
    std::string name = stem;
    for (int n = 2; !file_names_.insert(name).second; ++n) name = stem + "-" + std::to_string(n);
    topic.report.file = folder / (name + (options_.json ? ".jsonl" : ".csv"));
    topic.output = std::make_unique<Output>(topic.report.file);
  }

  /// A first pass over the topics with sequences, for a table has the columns of its longest message.
  void widen() {
    Selection selection = options_.selection;
    selection.topics.clear();
    for (const Topic* topic : in_order_)
      if (topic->columns && topic->columns->can_widen()) selection.topics.insert(topic->report.topic);
    if (selection.topics.empty()) return;
    auto stream = recording_.messages(selection);
    while (const auto message = stream.next()) {
      Topic& topic = *by_channel_.at(message->channel->id);
      if (!topic.columns) continue;
      const auto value = decode(*topic.type, message->data);
      if (value.ok()) topic.columns->widen(value.value());
    }
  }

  static std::string header(const Topic& topic) {
    const auto fields = topic.columns->names();
    std::string line;
    const std::vector<ColumnName> own{
        {"time", "s"}, {"received", "s"}, {"log_time", "ns"}, {"publish_time", "ns"}, {"sequence", ""}};
    for (const auto& column : own) {
      const bool taken =
          std::any_of(fields.begin(), fields.end(), [&](const auto& f) { return f.path == column.path; });
      line += (line.empty() ? "" : ",") + std::string{taken ? "recording." : ""} + column.path;
      if (!column.unit.empty()) line += " [" + column.unit + "]";
    }
    for (const auto& column : fields)
      line += "," + column.path + (column.unit.empty() ? "" : " [" + column.unit + "]");
    return line + "\n";
  }

  void append_row(std::string& line, Topic& topic, const RecordedMessage& message, const Value& value) {
    const Instant start = recording_.statistics().start;
    // Without a stamp the sender's clock counts, which somebody may have set back.
    topic.newest = std::max(topic.newest, sent(message));
    append_number(line, seconds_since(start, made(value, message.log_time).value_or(topic.newest)));
    line += ',';
    append_number(line, seconds_since(start, message.log_time));
    line += ',';
    append_number(line, message.log_time.ns);
    line += ',';
    append_number(line, message.publish_time.ns);
    line += ',';
    append_number(line, message.sequence);
    topic.columns->fill(value, row_);
    for (const Cell& cell : row_) {
      line += ',';
      append_cell(line, cell);
    }
    line += '\n';
  }

  static void append_json(std::string& line, const RecordedMessage& message, const Value& value) {
    line = to_json_line({{"log_time_ns", message.log_time.ns},
                         {"publish_time_ns", message.publish_time.ns},
                         {"sequence", message.sequence},
                         {"message", to_json(value)}});
    line += '\n';
  }

  const Recording& recording_;
  ExportOptions options_;
  std::map<std::pair<std::string, std::uint16_t>, std::unique_ptr<Topic>> topics_;
  std::vector<Topic*> in_order_;
  std::map<std::uint16_t, Topic*> by_channel_;
  std::set<std::string> file_names_;
  std::vector<Cell> row_;
};

}  // namespace

ExportReport export_recording(const Recording& recording, const std::filesystem::path& folder,
                              const ExportOptions& options) {
  return Exporter{recording, folder, options}.run();
}

}  // namespace invar::recording
