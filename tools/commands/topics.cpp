// `invar topics`: what is written and read in a cell's domain, and which ends do not meet.
#include <algorithm>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "tools/live/commands.hpp"
#include "tools/live/live_cell.hpp"
#include "tools/live/text_table.hpp"
#include "tools/live/topic_json.hpp"

namespace invar::tools {

namespace {

struct TopicsOptions {
  explicit TopicsOptions(CLI::App& command) : call{command, {}} {}
  CellCall call;
  bool all = false;
  bool json = false;
};

struct Topic {
  std::vector<dds::Endpoint> writers, readers;
  std::vector<std::string> problems;
};

std::map<std::string, Topic> topics_of(const dds::Snapshot& snapshot, bool all) {
  std::map<std::string, Topic> topics;
  for (const auto& end : snapshot.endpoints) {
    if (end.is_local || (!all && is_service_topic(end.topic))) continue;
    Topic& topic = topics[end.topic];
    (end.is_writer ? topic.writers : topic.readers).push_back(end);
  }
  for (auto& [name, topic] : topics)
    for (const auto& writer : topic.writers)
      for (const auto& reader : topic.readers) {
        std::string why;
        if (writer.type != reader.type)
          why = "type: " + writer.type + " is sent, " + reader.type + " is read";
        for (const auto& mismatch : dds::mismatches(writer.qos, reader.qos))
          why += (why.empty() ? "" : "; ") + mismatch.text();
        if (!why.empty())
          topic.problems.push_back(writer.participant + " -> " + reader.participant + ": " + why);
      }
  return topics;
}

const dds::Endpoint& first_end(const Topic& topic) {
  return topic.writers.empty() ? topic.readers.front() : topic.writers.front();
}

std::string qos_of(const Topic& topic) {
  return topic.writers.empty() ? "(nobody writes)" : qos_text(topic.writers.front().qos);
}

std::string counted(std::size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

/// Names of topics and types stay whole, so that they can be searched for and copied: a line a topic where `width` has room, else
/// two.
void print_topics(const std::map<std::string, Topic>& topics, std::size_t width) {
  TextTable table{{"topic", "type", "writers>", "readers>", "qos of the writer"}};
  std::size_t name_width = 0, type_width = 0;
  for (const auto& [name, topic] : topics) {
    const std::string& type = first_end(topic).type;
    name_width = std::max(name_width, name.size());
    type_width = std::max(type_width, type.size());
    table.add({name, type, std::to_string(topic.writers.size()), std::to_string(topic.readers.size()),
               qos_of(topic)});
  }
  constexpr std::size_t numbers_and_qos = 40;  // two columns of numbers, and room for words of a QoS
  if (topics.empty()) return;
  if (width >= name_width + type_width + numbers_and_qos) return table.print(std::cout, width);
  for (const auto& [name, topic] : topics) {
    print_wrapped(name + "  " + first_end(topic).type, 2, std::cout);
    print_wrapped("  " + counted(topic.writers.size(), "writer") + ", " +
                      counted(topic.readers.size(), "reader") + "; " + qos_of(topic),
                  4, std::cout);
  }
}

int topics(TopicsOptions& options) {
  options.call.resolve();
  LiveCell cell{options.call};
  if (cell.found() && cell.file() != nullptr) cell.wait_for_processes();
  cell.settle();
  const auto found = topics_of(cell.node().snapshot(), options.all);
  bool good = !found.empty();
  if (options.json) {
    auto json = nlohmann::ordered_json::array();
    for (const auto& [name, topic] : found) {
      json.push_back(json_of(name, topic.writers, topic.readers));
      json.back()["problems"] = topic.problems;
      good = good && topic.problems.empty();
    }
    std::cout << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
  } else {
    print_topics(found, is_shown_to_a_person() ? line_width() : std::numeric_limits<std::size_t>::max());
    for (const auto& [name, topic] : found)
      for (const auto& problem : topic.problems) {
        print_wrapped("no samples flow on " + name + ": " + problem, 2, std::cout);
        good = false;
      }
  }
  if (found.empty()) cell.say_not_found("invar topics");
  return good ? 0 : 1;
}

}  // namespace

void add_topics(CLI::App& program) {
  auto* command =
      program.add_subcommand("topics", "List a running cell's topics, their types, ends and mismatches");
  command->footer(
      "Example: invar topics deployment/xy-table.yaml\n"
      "Exit status: 0; 1 no topic was found, or a writer and a reader of one topic do not meet; 2 a fault of "
      "the "
      "call or the file");
  auto options = std::make_shared<TopicsOptions>(*command);
  command->add_flag("--all", options->all, "also the topics by which processes are watched and kept in step");
  command->add_flag("--json", options->json, "print it as JSON, with every writer and reader");
  command->callback([options] {
    if (const int result = topics(*options); result != 0) throw CLI::RuntimeError(result);
  });
}

}  // namespace invar::tools
