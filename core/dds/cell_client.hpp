// CellClient: what tools and the supervisor see of a running cell, and what they may ask of it.
#pragma once

#include <condition_variable>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/dds/node.hpp"
#include "idl/event.h"
#include "idl/lifecycle.h"
#include "idl/transfer.h"

namespace invar::dds {

/// The topics by which every process of a cell can be watched and asked.
struct ServiceTopics {
  explicit ServiceTopics(const std::string& cell);
  std::string process_status, component_status, notices;
  std::string lifecycle_request, lifecycle_reply, parameter_request, parameter_reply;
  std::string model_request, model_reply;
};

/// Any thread.
class CellClient {
 public:
  /// `cell`: its name, where it is not the node's own.
  explicit CellClient(Node& node, const std::string& cell = "");

  /// The newest status of each process and component that was heard of, by name.
  [[nodiscard]] std::vector<lifecycle::ProcessStatus> processes() const;
  [[nodiscard]] std::vector<lifecycle::ComponentStatus> components() const;
  /// Notices since the last call, oldest first; the first call gives those that the cell still keeps.
  [[nodiscard]] std::vector<event::Notice> take_notices();
  /// How far the clock of this PC is ahead of that of a process, at most, by its statuses; nothing: none came.
  [[nodiscard]] std::optional<Duration> clock_ahead(const std::string& process) const;
  /// Warning that the clocks of this PC and of a process are so far apart that commands may be taken for old ones. Empty:
  /// they are not, as far as its status says.
  [[nodiscard]] std::string clocks_apart(const std::string& process) const;
  /// The process in which a component runs; empty: not heard of.
  [[nodiscard]] std::string process_of(const std::string& component) const;

  /// Asks until there is a reply or patience ends; asking again does not carry out twice. `component` empty: all of
  /// the process. Nothing: no reply.
  std::optional<lifecycle::LifecycleReply> request(const std::string& process, const std::string& component,
                                                   lifecycle::Transition wanted, Duration patience);
  std::optional<lifecycle::ParameterReply> parameter(const std::string& process, const std::string& component,
                                                     lifecycle::ParameterAction action,
                                                     const std::string& path, const std::string& value,
                                                     Duration patience);
  /// Brings a model's text to the process of a component; the reply names the file that the component may stage.
  std::optional<transfer::ModelReply> model(const std::string& process, const std::string& component,
                                            const std::string& text, Duration patience);

 private:
  /// A writer of requests. Where the certificate permits none it is made at the first request, which then says so.
  template <class Request>
  class Asking {
   public:
    Asking(Node& node, std::string topic);
    Writer<Request>& writer();

   private:
    Node& node_;
    std::string topic_;
    std::mutex mutex_;
    std::unique_ptr<Writer<Request>> writer_;
  };
  /// The request is sent again after each `interval` without a reply.
  template <class Request, class Reply>
  std::optional<Reply> call(Asking<Request>& asking, std::map<std::uint64_t, Reply>& replies, Request request,
                            const std::string& process, Duration patience,
                            Duration interval = Duration::milliseconds(50));
  template <class Reply>
  std::unique_ptr<Connection> listen(Node& node, const std::string& topic,
                                     std::map<std::uint64_t, Reply>& replies);

  std::uint64_t client_;
  mutable std::mutex mutex_;
  std::condition_variable news_;
  std::uint64_t requests_ = 0;
  std::map<std::string, lifecycle::ProcessStatus> processes_;
  std::map<std::string, lifecycle::ComponentStatus> components_;
  std::map<std::string, Duration>
      ages_;  // of the statuses of a process: the least, by the clocks of the two PCs
  std::deque<event::Notice> notices_;
  std::map<std::uint64_t, lifecycle::LifecycleReply> lifecycle_replies_;
  std::map<std::uint64_t, lifecycle::ParameterReply> parameter_replies_;
  std::map<std::uint64_t, transfer::ModelReply> model_replies_;
  Asking<lifecycle::LifecycleRequest> lifecycle_;
  Asking<lifecycle::ParameterRequest> parameter_;
  Asking<transfer::ModelRequest> model_;
  std::vector<std::unique_ptr<Connection>> readers_;  // last: nothing arrives before all else stands
};

/// The words of the command line: "configure", ..., "stop".
[[nodiscard]] std::optional<lifecycle::Transition> parse_wire_transition(std::string_view text);

}  // namespace invar::dds
