#include "tools/cell/black_box_file.hpp"

#include <cctype>
#include <cstring>
#include <string>
#include <vector>

#include "core/base/fault.hpp"
#include "core/recording/recording_writer.hpp"

namespace invar::tools {

namespace {

/// A member's name in IDL: letters, digits and underscores.
std::string member_name(const std::string& signal) {
  std::string name;
  for (const char c : signal) name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
  return name;
}

std::string idl_of(const BlackBoxRecord& record) {
  std::string text =
      "module invar { module blackbox {\n@final\nstruct Cycle {\n  int64 time_ns;\n  uint64 cycle;\n"
      "  int64 wake_up_ns;\n  int64 compute_ns;\n  uint64 overruns;\n  uint64 skipped;\n";
  for (const auto& signal : record.signals)
    text += "  @unit(\"" + signal.unit + "\") double " + member_name(signal.name) + ";\n";
  return text + "};\n}; };\n";
}

/// Every member is eight bytes long, so CDR is the encapsulation and then the members one behind the other.
template <class T>
void append(std::vector<std::uint8_t>& cdr, T value) {
  static_assert(sizeof(T) == 8);
  const auto at = cdr.size();
  cdr.resize(at + sizeof value);
  std::memcpy(cdr.data() + at, &value, sizeof value);
}

}  // namespace

std::filesystem::path write_black_box(const BlackBoxRecord& record, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  const auto file =
      folder / ("black-box-" + record.process + "-" + std::to_string(record.tripped_cycle) + ".mcap");
  recording::RecordingWriter writer{file};
  const auto channel = writer.add_channel({.topic = "black_box/" + record.process,
                                           .type = "invar::blackbox::Cycle",
                                           .idl = idl_of(record),
                                           .qos = "",
                                           .partitions = "",
                                           .more = {{"reason", record.reason}}});
  std::vector<std::uint8_t> cdr;
  for (std::size_t i = 0; i < record.cycles.size(); ++i) {
    const CycleRecord& cycle = record.cycles[i];
    cdr = {0, 1, 0, 0};
    append(cdr, cycle.due.ns);
    append(cdr, cycle.cycle);
    append(cdr, cycle.wake_up.ns);
    append(cdr, cycle.compute.ns);
    append(cdr, cycle.overruns);
    append(cdr, cycle.skipped);
    for (std::size_t k = 0; k < record.signals.size(); ++k)
      append(cdr, record.samples[i * record.signals.size() + k]);
    writer.write(channel, static_cast<std::uint32_t>(i + 1), cycle.due, cycle.due, cdr);
  }
  if (!writer.close()) {
    std::filesystem::remove(file);
    throw InputError{file.string(), "cannot be written whole", "make room on the disk"};
  }
  return file;
}

}  // namespace invar::tools
