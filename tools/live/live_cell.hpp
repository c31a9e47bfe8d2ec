// A running cell as a command finds it: which one is meant, who is there, which topics it has.
#pragma once

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/config/cell.hpp"
#include "core/dds/cell_client.hpp"
#include "core/dds/node.hpp"

namespace invar::tools {

/// One word of a call, as its help shows it.
struct Word {
  std::string name;
  std::string help;
  bool required = true;
};

/// The call of a command about a running cell: `invar NAME CELL WORDS...`, or `invar NAME --domain N WORDS...` where
/// there is no cell file.
class CellCall {
 public:
  /// Set-up of the command line.
  CellCall(CLI::App& command, std::vector<Word> words);
  CellCall(const CellCall&) = delete;
  CellCall& operator=(const CellCall&) = delete;

  /// After parsing. Throws InputError when a word is missing or there is one too many.
  void resolve();
  [[nodiscard]] const std::string& word(std::size_t index) const { return words_[index]; }

  std::string command;
  std::filesystem::path file;  // empty: none
  int domain = -1;             // with a file: that of the file unless given
  std::string cell;            // its name, where several share the domain
  std::vector<std::string> addresses;
  std::vector<std::string> peers;
  std::string as;         // in whose name, where the cell is secured; empty: whose key this user can read
  double patience = 5.0;  // s

 private:
  std::vector<Word> described_;
  std::vector<std::string> words_;  // one more than described: CELL comes first
};

/// The structure of a cell file only: what its components ask for is no matter here. Throws InputError.
[[nodiscard]] std::unique_ptr<config::Cell> read_structure(const std::filesystem::path& file);

class LiveCell {
 public:
  /// Takes part in the domain of the cell. Without a file, waits for the one cell that is there. Throws InputError for a
  /// faulty file and where several cells share the domain.
  /// `nobody`: the call's name of the cell counts, and no process need be there.
  enum class Need { cell, nobody };
  explicit LiveCell(const CellCall& call, Need need = Need::cell);

  [[nodiscard]] dds::Node& node() { return *node_; }
  [[nodiscard]] dds::CellClient& client() { return *client_; }
  /// Empty: no cell was found.
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool found() const { return !name_.empty(); }
  /// Null where the call names none.
  [[nodiscard]] const config::Cell* file() const { return cell_.get(); }
  [[nodiscard]] Duration patience() const { return patience_; }
  /// This program and the cell know each other by certificates.
  [[nodiscard]] bool is_secured() const { return node_->options().identity.has_value(); }

  /// Waits until every process of the file has said how it is; without a file, every one that takes part in the domain.
  /// Returns the processes that did not.
  std::vector<std::string> wait_for_processes();
  /// That a process has ended is kept for late comers, and it may be back, not yet heard: gives it a second.
  void wait_for_restarts();
  /// A cell that was just started activates its components one after the other: waits until all are active or in error, or
  /// the end of patience.
  void wait_for_components();
  /// The same for one component, which discards commands from before its activation. False: it says that it is inactive, or
  /// nothing, to the end of patience.
  bool wait_for_component(const std::string& component);
  /// Waits until all writers and readers of the cell's processes have been discovered. Other participants cannot be asked how
  /// many they have; where some take part, waits until nothing new has come for 3 s. A participant
  /// that missed the first announcements hears the next after 1.5 s.
  void settle();
  /// The writers of the topic that `text` means: its full name, or `component.port` of this cell. Waits for one.
  std::vector<dds::Endpoint> wait_for_writers(const std::string& text);
  [[nodiscard]] std::string topic(const std::string& text) const;
  /// Whose process a component is in: by the file, or by what the cell says. Empty: nobody has it.
  std::string process_of(const std::string& component);

  /// The cell's number, by its file or by what its processes say: a component takes no command of another cell.
  [[nodiscard]] std::uint32_t cell_id();
  /// Why a process would take every command of this PC for an old one: the clock here is behind by more than a command's
  /// lifespan. Empty: it would not. Waits for the process to say how it is.
  std::string too_far_behind(const std::string& process);
  /// Follows on "... does not answer": that the clocks of the two PCs may be why. Empty: they agree.
  [[nodiscard]] std::string clocks_apart(const std::string& process) const;

  /// Says on stderr that no cell answered and where it was looked for.
  void say_not_found(const std::string& command) const;

 private:
  [[nodiscard]] bool knows_all(const dds::Snapshot& snapshot) const;
  std::unique_ptr<config::Cell> cell_;
  std::unique_ptr<dds::Node> node_;
  std::string name_;
  std::unique_ptr<dds::CellClient> client_;
  Duration patience_;
  std::string where_;
  std::string ports_;  // of its domain, for a firewall
};

/// A profile that takes all that `writers` of one topic send: reads as reliably and as late as the weakest of them allows.
[[nodiscard]] dds::Profile reader_profile(const std::vector<dds::Endpoint>& writers,
                                          std::int64_t depth = 1000);

/// Processes of the cell that none of these statuses is of.
[[nodiscard]] std::vector<std::string> not_heard(const config::Cell& cell,
                                                 const std::vector<lifecycle::ProcessStatus>& heard);

/// Data topics, not those by which processes are watched and kept in step.
[[nodiscard]] bool is_service_topic(const std::string& topic);

}  // namespace invar::tools
