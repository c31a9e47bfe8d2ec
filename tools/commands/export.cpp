// `invar export`: a recording as CSV tables or JSON lines, one file a topic.
#include "core/recording/export.hpp"

#include <iostream>
#include <memory>

#include "tools/command.hpp"

namespace invar::tools {

namespace {

struct ExportCommand {
  std::filesystem::path recording, out;
  std::vector<std::string> topics;
  std::optional<double> from, to;
  std::size_t elements = 64;
  bool json = false;
};

int export_(const ExportCommand& options) {
  const auto recording = recording::Recording::open(options.recording);
  recording::ExportOptions how;
  how.json = options.json;
  how.longest = options.elements;
  how.selection.topics = {options.topics.begin(), options.topics.end()};
  const Instant start = recording.statistics().start;
  if (options.from) how.selection.from = start + Duration::seconds(*options.from);
  if (options.to) how.selection.to = start + Duration::seconds(*options.to);
  const auto report = recording::export_recording(recording, options.out, how);
  bool complete = report.damaged_chunks == 0 && recording.has_all_data();
  for (const std::string& damage : recording.damage())
    std::cerr << options.recording.string() << ": " << damage << '\n';
  if (report.damaged_chunks > 0)
    std::cerr << options.recording.string() << ": " << report.damaged_chunks
              << " damaged chunks were left out\n";
  for (const auto& topic : report.topics) {
    if (!topic.file.empty()) std::cout << topic.file.string() << ": " << topic.rows << " rows\n";
    for (const std::string& path : topic.shortened)
      std::cerr << options.recording.string() << ": " << topic.topic << ": only the first "
                << options.elements << " elements of `" << path << "` are written; see --elements\n";
    if (topic.problem.empty()) continue;
    complete = false;
    std::cerr << options.recording.string() << ": " << topic.topic << ": ";
    if (topic.undecodable > 0)
      std::cerr << topic.undecodable << " messages cannot be read (";
    else
      std::cerr << "left out (";
    std::cerr << topic.problem << ")\n";
  }
  return complete ? 0 : 1;
}

}  // namespace

void add_export(CLI::App& program) {
  auto* command = program.add_subcommand("export", "Write a recording's topics as CSV tables with units");
  command->footer(
      "Example: invar export run.mcap --out tables --topic stage.state --from 10 --to 20\n"
      "Column `time` is the stamp `at` of the sample, or the time of sending where it has none. Column "
      "`received` is\n"
      "the time of arrival at the recorder; --from and --to go by it. Both are in s since the recording's "
      "first message.\n"
      "Exit status: 0 every message was written, 1 some could not be read, 2 a fault of the call");
  auto options = std::make_shared<ExportCommand>();
  command->add_option("recording", options->recording, "the recording (.mcap)")->required();
  command->add_option("--out", options->out, "folder for the tables; made where missing")->required();
  command->add_option("--topic", options->topics,
                      "only this topic, by its full name or component.port; may stand several times");
  command->add_option("--from", options->from, "only from here on, in s since the recording's first message");
  command->add_option("--to", options->to, "only before this, in s since the recording's first message");
  command->add_option("--elements", options->elements,
                      "elements of an array or sequence that get columns (64)");
  command->add_flag("--json", options->json, "one JSON object a message (.jsonl) instead of CSV");
  command->callback([options] {
    if (const int status = export_(*options); status != 0) throw CLI::RuntimeError(status);
  });
}

}  // namespace invar::tools
