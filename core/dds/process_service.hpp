// ProcessService: puts the control of one process on the wire - its status, its notices, requests to it.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "core/dds/cell_client.hpp"
#include "core/dds/node.hpp"
#include "core/dds/received_models.hpp"
#include "core/executor/process_control.hpp"
#include "core/executor/recent.hpp"

namespace invar {
class Standby;
}

namespace invar::dds {

/// Has a thread of its own; nothing of it runs on the loop's.
class ProcessService {
 public:
  struct Options {
    std::uint32_t cell = 0;                           // number of the cell, for keys
    std::string host;                                 // name of the host in the cell file
    Duration interval = Duration::milliseconds(500);  // between two status samples
    /// Where models go that are sent to this process; empty: none is taken.
    std::filesystem::path models;
    /// Called when somebody asks the process to stop; on the service's thread.
    std::function<void()> stop_process;
    /// The fault of the component of this index although it is stepped; empty: none. Any thread.
    std::function<std::string(std::size_t component)> fault_of;
    /// Number of the component in its cell file, by which its status is known; none: that of its samples.
    std::function<std::uint32_t(std::size_t component)> id_of{};
    /// The one of two components, of which one stands by for the other; nullptr: nobody does.
    std::function<Standby*(std::size_t component)> standby_of{};
    /// Every notice in this process's name, once; on the thread that publishes it.
    std::function<void(const event::Notice&)> on_notice;
    /// How often the process was started again, and how its last life ended.
    std::uint32_t restarts = 0;
    std::string last_end;
    /// Host with whose clock the others are compared; empty: a cell on one host.
    std::string clock_reference;
  };
  ProcessService(Node& node, ProcessControl& control, Options options);
  ~ProcessService();
  ProcessService(const ProcessService&) = delete;
  ProcessService& operator=(const ProcessService&) = delete;

  /// Serves requests and publishes statuses from now on, on a thread of its own. Ports are bound before: their numbers are told.
  void start();
  /// Publishes a notice in this process's name. Any thread but the loop's.
  void publish(event::Severity level, const std::string& source, const std::string& text);
  /// Publishes all statuses now, as after a transition.
  void publish_status();

 private:
  using Message =
      std::variant<lifecycle::LifecycleRequest, lifecycle::ParameterRequest, transfer::ModelRequest>;
  struct Request {
    Message message;
    Duration age;  // by the clocks of the two PCs: what it took to come, and by how much they disagree
  };
  void enqueue(Request request);
  void run();
  [[nodiscard]] Standby* standby_of(std::size_t component) const;
  void publish_news();
  void follow_clock();
  void tell_clock(lifecycle::ProcessStatus& process) const;
  void publish_late(const ProcessStatus& status);
  void serve(const lifecycle::LifecycleRequest& request, Duration age);
  void serve(const lifecycle::ParameterRequest& request, Duration age);
  void serve(const transfer::ModelRequest& request, Duration age);
  /// Why a request of that age is not carried out; empty: it is.
  [[nodiscard]] std::string too_late(Duration age) const;
  void tell_clocks(Duration age);
  [[nodiscard]] lifecycle::ParameterReply answer(const lifecycle::ParameterRequest& request);
  [[nodiscard]] base::Stamp stamp() const;

  Node& node_;
  ProcessControl& control_;
  Options options_;
  std::uint32_t number_;
  Writer<lifecycle::ProcessStatus> process_;
  Writer<lifecycle::ComponentStatus> component_;
  Writer<event::Notice> notice_;
  Writer<lifecycle::LifecycleReply> lifecycle_;
  Writer<lifecycle::ParameterReply> parameter_;
  Writer<transfer::ModelReply> model_;
  ReceivedModels models_;
  std::mutex mutex_;
  std::condition_variable news_;
  std::deque<Request> requests_;
  bool stopping_ = false;
  std::mutex status_turn_;  // two threads may publish the status
  RecentStatistics recent_;
  std::map<std::string, std::uint64_t> told_late_;  // declared latencies not kept, as told so far
  std::optional<Instant> told_clocks_;              // when a client's clock was told to be ahead
  bool told_apart_ = false;  // the host's clock was set, and the stamps are not there yet
  std::deque<lifecycle::ParameterReply> answered_;  // repeated requests get the same answer
  std::vector<std::unique_ptr<Connection>> readers_;
  std::thread thread_;
};

}  // namespace invar::dds
